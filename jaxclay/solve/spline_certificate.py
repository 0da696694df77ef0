"""The certificate of :mod:`jaxclay.solve.certificate` for splines.

The bound is the same, r = g + B^T lam - D^T z, with friction's forces lam at its
points and the lower bound's z at the Gauss points.  Only the forces of clay at rest
cannot be read off the gradient point by point: they are the method's own or, for
methods that know none, those that penalties at these points need to hold it.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxclay.numerics.arrays import Array
from jaxclay.numerics.banded import Factor, Model
from jaxclay.schemes.base import Forces
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.space import Displaced
from jaxclay.solve.certificate import STEP, Certificate, accepted_decrement

_AT_REST = (0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5)
_PENALTY, _ROUNDS = 1e6, 6
_CONSISTENT = 1e-12


def certify(problem: SplineProblem, point: Displaced, forces: Forces) -> Certificate:
    """Certify a point; ``forces`` are the method's own multipliers, zeros if it has none."""
    model, limit = problem.smooth_model(point), problem.friction_limit
    energy = model.value + jnp.sum(limit * jnp.abs(point.shift))
    gate = accepted_decrement(energy)
    own = jnp.clip(forces.friction, -limit, limit)
    factor = _factor(problem, point, model, own)
    floor = jnp.where(problem.loose, jnp.maximum(forces.floor, 0.0), 0.0)
    thresholds = jnp.asarray((-1.0, -1.0, *_AT_REST))

    def tried(i):
        moves = jnp.abs(point.shift) > thresholds[i]
        lam = jnp.where((i < 2) | ~moves, own, limit * jnp.sign(point.shift))
        z = jnp.where(i == 1, 0.0, floor)
        held = jnp.where(moves | (i < 2), 0.0, _PENALTY * limit)
        needs = (i >= 2) & jnp.any(held > 0)
        lam = jax.lax.cond(needs, lambda: _held(problem, point, model, lam, z, held), lambda: lam)
        r = model.gradient + problem.from_shift(lam) - problem.from_thickness(z)
        newton = problem.solved(factor, r)
        decrement = r @ newton / 2 + jnp.sum(limit * jnp.abs(point.shift) - lam * point.shift)
        decrement += jnp.sum(z * problem.slack(point))
        step = jnp.max(jnp.abs(problem.shift_change(newton)))
        bad = jnp.isnan(decrement)
        return jnp.where(bad, jnp.inf, decrement), jnp.where(bad, jnp.inf, step), r

    def passes(decrement, step):
        return (decrement <= gate) & (step <= STEP)

    def go_on(carry):
        i, decrement, step, _ = carry
        return (i < thresholds.shape[0]) & ~passes(decrement, step)

    def body(carry):
        i, *best = carry
        now = tried(i)
        better = passes(now[0], now[1]) | (now[0] < best[0])
        return i + 1, *(jnp.where(better, a, b) for a, b in zip(now, best, strict=True))

    first = 0, jnp.asarray(jnp.inf), jnp.asarray(jnp.inf), jnp.full_like(model.gradient, jnp.inf)
    _, decrement, step, r = jax.lax.while_loop(go_on, body, first)
    admissible = _admissible(problem, point)
    positive = factor.positive
    share = problem.space.from_values(problem.space.friction_weight)
    share = jnp.where(problem.free, share, 1.0)
    touches = problem.loose & (problem.slack(point) <= 1e-9 * problem.rest_thickness)
    return Certificate(
        accepted=passes(decrement, step) & positive & admissible,
        decrement=jnp.where(positive, decrement, jnp.inf),
        step=jnp.where(positive, step, jnp.inf),
        residual=jnp.max(jnp.abs(r) / share) / (problem.material.mu + problem.material.k),
        positive=positive,
        admissible=admissible,
        energy_free=energy,
        on_floor=jnp.sum(touches),
    )


def _factor(problem: SplineProblem, point: Displaced, model: Model, lam: Array) -> Factor:
    """The Hessian's factor; where it is indefinite, with clay at rest held by penalties.

    Clay that rests with friction to spare does not move whatever the curvature there.
    """
    limit = problem.friction_limit
    rests = (jnp.abs(point.shift) <= _AT_REST[1]) & (jnp.abs(lam) < limit)

    def with_penalties(penalties):
        return problem.stiffness(point, model.bands, jnp.zeros_like(problem.floor), penalties)

    plain = with_penalties(jnp.zeros_like(limit))
    holds = ~plain.positive & jnp.any(rests)
    penalties = jnp.where(rests, _PENALTY * limit, 0.0)
    return jax.lax.cond(holds, lambda: with_penalties(penalties), lambda: plain)


def _held(problem: SplineProblem, point: Displaced, model, lam: Array, z: Array, penalties: Array):
    """Forces within friction's limits at the points with penalties that balance the others best.

    Method of multipliers: the penalties' forces are added up until the points stay.
    """
    limit = problem.friction_limit
    stiff = problem.stiffness(point, model.bands, jnp.zeros_like(z), penalties)

    def add(_, lam):
        r = model.gradient + problem.from_shift(lam) - problem.from_thickness(z)
        change = penalties * problem.shift_change(-problem.solved(stiff, r))
        return jnp.clip(lam + change, -limit, limit)

    return jax.lax.fori_loop(0, _ROUNDS, add, lam)


def _admissible(problem: SplineProblem, point: Displaced) -> Array:
    """Whether Y_u keeps above the lower bound and the prescribed coefficients are kept."""
    low = -1e-12 * problem.rest_thickness
    above = jnp.all(jnp.where(problem.loose, problem.slack(point) >= low, True))
    missed = jnp.where(problem.fixed, point.coefficients - problem.shift, 0.0)
    again = problem.point(point.coefficients)
    apart = jnp.max(jnp.abs(again.shift - point.shift))
    return above & (jnp.max(jnp.abs(missed)) <= _CONSISTENT) & (apart <= _CONSISTENT)
