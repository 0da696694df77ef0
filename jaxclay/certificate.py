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

from jaxclay import _repr, local
from jaxclay._host import pytree
from jaxclay.arrays import namespace
from jaxclay.clay import Array
from jaxclay.curvature import Factors, factors_at
from jaxclay.problem import Problem
from jaxclay.schemes.sums import Point

DECREMENT = 1e-10  # accepted, relative to max(E_free, SMALL)
SMALL = 1e-3
STEP = 1e-6  # accepted distance to the local model's minimum, over the unit l
_CONSISTENT = 1e-12  # over the unit l
_AT_REST = (0.0, 1e-14, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
_SPRING_ROUNDS = 4
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
        max |r_i| / (w_i (mu + k)), w_i the node's share of the clay.  Shown, never a gate:
        at exact minima on fine grids it is rounding noise.
    positive : bool
        Whether the Hessian is positive definite on the moves that are possible: if it
        must be, without the nodes that rest and without thinning what the floor pushes on.
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

    def __repr__(self) -> str:
        say, flag = _repr.figure, _repr.flag
        return _repr.lines(
            f"Certificate: {flag(self.accepted, 'accepted', 'refused')}",
            f"{self.gain}, step {say(self.step, '.2g')} (at most {STEP:.2g})",
            f"positive curvature: {flag(self.positive)}, admissible: {flag(self.admissible)}, "
            f"slices on the floor: {say(self.on_floor)}",
            f"E_free {say(self.energy_free)}, residual {say(self.residual, '.2g')}",
        )

    @property
    def gain(self) -> str:
        """The decrement beside what is accepted, in words."""
        most = _repr.derived(accepted_decrement, self.energy_free)
        decrement = _repr.figure(self.decrement, ".2g")
        return f"decrement {decrement} (at most {_repr.figure(most, '.2g')})"


def accepted_decrement(energy_free: Array) -> Array:
    """The largest decrement that is accepted where E_free is this."""
    return DECREMENT * namespace(energy_free).maximum(energy_free, SMALL)


def certify(problem: Problem, point: Point, forces: Forces) -> Certificate:
    """Judge a point; ``forces`` are the solver's own multipliers, zeros if it has none."""
    model = local.smooth_model(problem, point)
    energy_free = model.value + jnp.sum(problem.friction_limit * jnp.abs(point.shift))
    limit, tight = problem.friction_limit, touches_floor(problem, point)
    rests = problem.free & (point.shift == 0) & (jnp.abs(model.gradient) < limit)
    factors = factors_at(problem, point, model, rests, tight)
    gate = accepted_decrement(energy_free)
    best = _best_forces(problem, point, model.gradient, factors, forces, gate)
    positive, admissible = factors.positive, _admissible(problem, point)
    return Certificate(
        accepted=best.passes(gate) & positive & admissible,
        decrement=jnp.where(positive, best.decrement, jnp.inf),
        step=jnp.where(positive, best.step, jnp.inf),
        residual=best.residual / (problem.material.mu + problem.material.k),
        positive=positive,
        admissible=admissible,
        energy_free=energy_free,
        on_floor=best.on_floor,
    )


class _Verdict(NamedTuple):
    """What one pair of friction and floor forces says."""

    decrement: Array
    step: Array
    residual: Array
    on_floor: Array

    def passes(self, gate: Array) -> Array:
        return (self.decrement <= gate) & (self.step <= STEP)


def _best_forces(problem, point, g, factors, forces, gate) -> _Verdict:
    """The first pair of forces that passes, else the one with the least decrement.

    Tried are the solver's own; its friction with floor forces read off; and for
    each threshold h mu sign(d) beyond it and -g within, with floor forces read off.
    """
    d, limit = point.shift, problem.friction_limit
    own = jnp.clip(forces.friction, -limit, limit)
    thresholds = jnp.asarray((-1.0, -1.0, *_AT_REST))
    keeps = problem.free & ~factors.dropped
    tight = touches_floor(problem, point)
    shares = jnp.where(problem.free, problem.sums.nodes, 1.0)

    def judge(i):
        within = jnp.abs(d) <= thresholds[i]
        read = jnp.where(within, jnp.clip(-g, -limit, limit), limit * jnp.sign(d))
        friction = jnp.where(i < 2, own, read)
        floor = jax.lax.cond(
            (i > 0) & jnp.any(tight),
            lambda: _floor_forces(keeps, tight, factors, g + friction),
            lambda: jnp.where(i > 0, 0.0, jnp.maximum(forces.floor, 0.0)),
        )
        r = jnp.where(keeps, g + friction - local.to_nodes(floor), 0.0)
        newton = jnp.where(keeps, factors.relaxed(r), 0.0)
        decrement = r @ newton / 2 + jnp.sum(limit * jnp.abs(d) - friction * d)
        decrement += jnp.sum(floor * problem.slack(point))
        # Springs may stand in for the floor only where it pushes.
        honest = factors.plain.positive | jnp.all((floor > 0) | ~tight)
        decrement = jnp.where(jnp.isnan(decrement) | ~honest, jnp.inf, decrement)
        pushes = jnp.sum((floor > 0) & tight)
        residual = jnp.max(jnp.abs(r) / shares)
        return _Verdict(decrement, jnp.max(jnp.abs(newton)), residual, pushes)

    def go_on(carry):
        i, best = carry
        return (i < thresholds.shape[0]) & ~best.passes(gate)

    def body(carry):
        i, best = carry
        now = judge(i)
        better = now.passes(gate) | (now.decrement < best.decrement) | (i == 0)
        return i + 1, jax.tree.map(lambda a, b: jnp.where(better, a, b), now, best)

    worst = _Verdict(jnp.inf, jnp.inf, jnp.inf, jnp.asarray(0))
    worst = jax.tree.map(jnp.asarray, worst)
    return jax.lax.while_loop(go_on, body, (0, worst))[1]


def _floor_forces(keeps: Array, tight: Array, factors: Factors, force: Array) -> Array:
    """(n,) z >= 0 on the slices at the floor that balance a force (n+1,) best.

    Method of multipliers: the springs' forces are added up until the slices
    stay where they are.
    """

    def add(_, z):
        left = jnp.where(keeps, force - local.to_nodes(z), 0.0)
        return z + factors.springs * jnp.diff(local.relaxed(factors.sprung, left))

    z = jax.lax.fori_loop(0, _SPRING_ROUNDS, add, jnp.zeros_like(factors.springs))
    return jnp.where(tight, jnp.maximum(z, 0.0), 0.0)


def _admissible(problem: Problem, point: Point) -> Array:
    """Whether the shape keeps above the floor, in step with itself and to the tool."""
    # A slice on the floor may lie below it by rounding.
    low = -1e-12 * problem.rest.thickness
    above_floor = jnp.all(problem.slack(point) >= low) & jnp.all(point.thickness > 0)
    # Thicknesses and displacements are held apart; the energy is of both, so they must agree.
    apart = jnp.diff(problem.rest.heights + point.shift) - point.thickness
    missed = jnp.where(problem.fixed, point.shift - problem.shift, 0.0)
    consistent = jnp.max(jnp.abs(apart)) <= _CONSISTENT
    return above_floor & consistent & (jnp.max(jnp.abs(missed)) <= _CONSISTENT)


def touches_floor(problem: Problem, point: Point) -> Array:
    """(n,) loose slices on which the floor may push."""
    return problem.loose & (problem.slack(point) <= _ON_FLOOR * problem.rest.thickness)
