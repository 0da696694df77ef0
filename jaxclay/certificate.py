"""The one judge of every answer: how much could the local model still gain?

With g, H the gradient and Hessian of the smooth energy on the free nodes,
d = Y - Y0, friction forces lam with |lam_i| <= h mu and floor forces z >= 0,
r = g + lam - D^T z and positive definite H, the local model gains at most

    decrement = 1/2 r^T H^-1 r + sum (h mu |d_i| - lam_i d_i) + sum z_i (t_i - f t0_i)

by weak duality, whatever lam and z are.  So nobody has to say which nodes rest:
the judge tries the solver's own forces and some read off the point, and keeps
the best.  E_total is not convex; this certifies a local minimum.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxclay import local
from jaxclay._host import pytree
from jaxclay.clay import Array
from jaxclay.problem import Problem
from jaxclay.schemes.paper import Point

DECREMENT = 1e-10  # accepted, relative to max(E_free, SMALL)
SMALL = 1e-3
STEP = 1e-6  # accepted distance to the local model's minimum, over the unit l
_CONSISTENT = 1e-12  # over the unit l
_AT_REST = (0.0, 1e-14, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
_ON_FLOOR = 1e-9  # slack over rest thickness below which the floor may push


class Forces(NamedTuple):
    """Multipliers of the two kinds of kink and bound, energies over lengths.

    Attributes
    ----------
    friction : (n+1,) array
        lam, between -h mu and h mu; h mu sign(d_i) where clay moves.
    floor : (n,) array
        z >= 0, what holds a slice above its least thickness.
    """

    friction: Array
    floor: Array


@pytree
@dataclasses.dataclass(frozen=True)
class Certificate:
    """What the judge found.

    Attributes
    ----------
    accepted : bool
        Whether the answer is a local minimum: decrement <= 1e-10 max(E_free,
        1e-3), step <= 1e-6, curvature positive, thicknesses above the floor.
    decrement : float
        Most energy that the local model can still gain; inf without positive curvature.
    step : float
        Largest move to the local model's minimum, over the unit l.
    residual : float
        max |r_i| / (h (mu + k)).  Shown, never a gate: at exact minima on fine
        grids it is rounding noise.
    positive : bool
        Whether the Hessian is positive definite on the nodes that can move.
    admissible : bool
        Whether heights increase, thicknesses obey the floor and agree with the
        heights, and the fixed nodes are where the tool wants them.
    energy_free : float
        E_free, the terms that touch a free node; gaps are relative to it.
    on_floor : int
        Slices on which the floor pushes.
    """

    accepted: Array
    decrement: Array
    step: Array
    residual: Array
    positive: Array
    admissible: Array
    energy_free: Array
    on_floor: Array


def friction_limit(problem: Problem) -> Array:
    """(n+1,) h mu at the free nodes, 0 at the fixed ones."""
    return jnp.where(problem.free, problem.material.mu / problem.slices, 0.0)


def slack(problem: Problem, point: Point) -> Array:
    """(n,) thickness above the floor."""
    return point.thickness - problem.floor


def certify(problem: Problem, point: Point, forces: Forces) -> Certificate:
    """Judge a point; ``forces`` are the solver's own multipliers, zeros if it has none."""
    n = problem.slices
    limit = friction_limit(problem)
    g = local.gradient(problem, point)
    factor, positive, dropped = _factor(problem, point, g, limit)
    candidates = _candidate_forces(problem, point, g, limit, forces, factor)

    def judge(force: Forces):
        r = g + force.friction - local.to_nodes(force.floor)
        r = jnp.where(problem.free & ~dropped, r, 0.0)
        newton = jax.scipy.linalg.cho_solve((factor, True), r)
        gaps = limit * jnp.abs(point.shift) - force.friction * point.shift
        decrement = r @ newton / 2 + jnp.sum(gaps) + jnp.sum(force.floor * slack(problem, point))
        pushes = jnp.sum((force.floor > 0) & touches_floor(problem, point))
        return decrement, jnp.max(jnp.abs(newton)), jnp.max(jnp.abs(r)), pushes

    decrements, steps, residuals, on_floor = jax.vmap(judge)(candidates)
    decrements = jnp.where(jnp.isnan(decrements), jnp.inf, decrements)
    energy_free = problem.free_terms(point).total
    gate = DECREMENT * jnp.maximum(energy_free, SMALL)
    passes = (decrements <= gate) & (steps <= STEP)
    best = jnp.argmin(jnp.where(passes, -jnp.inf, decrements))
    # A slice on the floor may lie below it by rounding.
    low = -1e-12 * problem.rest.thickness
    above_floor = jnp.all(slack(problem, point) >= low) & jnp.all(point.thickness > 0)
    # Thicknesses and displacements are held apart; the energy is of both, so they must agree.
    apart = jnp.diff(problem.rest.heights + point.shift) - point.thickness
    missed = jnp.where(problem.fixed, point.shift - problem.shift, 0.0)
    admissible = above_floor & (jnp.max(jnp.abs(apart)) <= _CONSISTENT)
    admissible = admissible & (jnp.max(jnp.abs(missed)) <= _CONSISTENT)
    return Certificate(
        accepted=passes[best] & positive & admissible,
        decrement=jnp.where(positive, decrements[best], jnp.inf),
        step=jnp.where(positive, steps[best], jnp.inf),
        residual=residuals[best] * n / (problem.material.mu + problem.material.k),
        positive=positive,
        admissible=admissible,
        energy_free=energy_free,
        on_floor=on_floor[best],
    )


def _factor(problem, point, g, limit):
    """Cholesky factor of H; where H is indefinite, of H without the nodes that rest."""
    H = local.hessian(problem, point)
    whole = jnp.linalg.cholesky(H)
    rests = problem.free & (point.shift == 0) & (jnp.abs(g) < limit)
    definite = jnp.all(jnp.isfinite(whole))
    reduced = jax.lax.cond(
        definite,
        lambda: whole,
        lambda: jnp.linalg.cholesky(local.masked(H, problem.free & ~rests)),
    )
    dropped = rests & ~definite
    positive = jnp.all(jnp.isfinite(reduced))
    return jnp.where(positive, reduced, jnp.eye(H.shape[0])), positive, dropped


def _candidate_forces(problem, point, g, limit, forces, factor) -> Forces:
    """The solver's forces first, then for each threshold: h mu sign(d) beyond, -g within."""
    d = point.shift
    own = jnp.clip(forces.friction, -limit, limit)
    within = jnp.abs(d) <= jnp.asarray(_AT_REST)[:, None]
    lam = jnp.where(within, jnp.clip(-g, -limit, limit), limit * jnp.sign(d))
    friction = jnp.concatenate([own[None], lam])
    pushed = _floor_forces(problem, point, g + friction, factor)
    floor = pushed.at[0].set(jnp.maximum(forces.floor, 0.0))
    # The solver may know its friction without its floor forces, so that pair is tried too.
    return Forces(jnp.concatenate([friction, own[None]]), jnp.concatenate([floor, pushed[:1]]))


def _floor_forces(problem, point, force, factor):
    """For each row of force (m, n+1): z >= 0 on the slices at the floor that balances it best."""
    tight = touches_floor(problem, point)

    def balance():
        D = jnp.diff(jnp.eye(force.shape[1]), axis=0)
        masked = jnp.where(problem.free, force, 0.0)
        DH = jax.scipy.linalg.cho_solve((factor, True), jnp.where(problem.free, D, 0.0).T).T
        gram = local.masked(DH @ D.T, tight)
        z = jnp.linalg.solve(gram, jnp.where(tight, masked @ DH.T, 0.0).T).T
        return jnp.where(tight, jnp.maximum(z, 0.0), 0.0)

    nothing = jnp.zeros((force.shape[0], point.thickness.shape[0]))
    return jax.lax.cond(jnp.any(tight), balance, lambda: nothing)


def touches_floor(problem: Problem, point: Point) -> Array:
    """(n,) loose slices on which the floor may push."""
    return problem.loose & (slack(problem, point) <= _ON_FLOOR * problem.rest.thickness)
