"""The problem with friction smoothed, in the stretches: for solvers without constraints.

Unknowns are the stretches t_i / t0_i of the loose slices, in which strain's curvature is in
proportion to a slice's share of the clay, one on equal slices; where a side of the band is
held at both ends, the slice farthest from the band takes up what the others leave.  Friction
is smoothed as sqrt(d^2 + eps^2) - eps and eps stepped from 1e-2 to 1e-13, over the unit l:
the last stage is 1e-13 mu off at most, which the certificate lets pass.  Below the floor the
energy goes on with a steep penalty and is never infinite; what lies below it in the end is
lifted onto it.

Energies are n times their share of E_total, as in the slack form.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxclay.numerics.arrays import Array
from jaxclay.schemes.base import lifted
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.sums import Displaced

LADDER = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-13)
_PENALTY = 1e2  # over k, at eps = 1; grows as eps falls


def _sides(problem: Problem) -> tuple[Array, Array]:
    """(2, n) loose slices below and above the band; (n,) those that take up the rest."""
    n = problem.slices
    upper = jnp.arange(n) >= jnp.argmax(problem.rest.held(problem.band))
    sides = jnp.stack([problem.loose & ~upper, problem.loose & upper])
    takers = jnp.zeros(n, bool).at[0].set(sides[0, 0]).at[-1].set(sides[1, -1] & problem.fixed[-1])
    return sides, takers


def unknown(problem: Problem) -> Array:
    """(n,) whether each stretch is an unknown."""
    return problem.loose & ~_sides(problem)[1]


def stretches(problem: Problem, point: Displaced) -> Array:
    """(n,) t_i / t0_i."""
    return point.thickness / problem.rest.thickness


def _at(problem: Problem, start: Displaced, x: Array) -> Displaced:
    """The point whose unknown stretches are x, (n,); the other entries are not looked at."""
    sides, takers = _sides(problem)
    wanted = x * problem.rest.thickness - start.thickness
    change = jnp.where(problem.loose & ~takers, wanted, 0.0)
    for side in sides:
        change -= jnp.where(takers & side, jnp.sum(jnp.where(side, change, 0.0)), 0.0)
    moved = jnp.concatenate([jnp.zeros(1), jnp.cumsum(change)])
    return Displaced(start.thickness + change, start.shift + jnp.where(problem.free, moved, 0.0))


def objective(problem: Problem, start: Displaced, x: Array, eps: Array) -> Array:
    """n E_free at the stretches x, with friction smoothed and a penalty below the floor."""
    point = _at(problem, start, x)
    floor, rest = problem.floor, problem.rest.thickness
    below = jnp.maximum(floor - point.thickness, 0.0) / rest
    # Half the floor is far outside, but the radius is still finite there.
    kept = Displaced(jnp.maximum(point.thickness, floor / 2), point.shift)
    smoothed = jnp.sqrt(point.shift**2 + eps**2) - eps
    steep = _PENALTY / jnp.sqrt(eps) * problem.material.k
    penalty = steep / 2 * jnp.sum(problem.sums.width * below**2)
    friction = jnp.sum(problem.friction_limit * smoothed)
    return problem.slices * (problem.free_smooth(kept) + friction + penalty)


@jax.jit
def point_of(problem: Problem, start: Displaced, x: Array) -> Displaced:
    """The point at the stretches x, on or above the floor."""
    return lifted(problem, _at(problem, start, x))
