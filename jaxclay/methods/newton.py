"""``newton``: primal-dual Newton on E_total with friction and floor as they are.

The kinks of friction are smoothed as sqrt(d^2 + eps^2), but its force lam is an
unknown of its own (Chan, Golub and Mulet 1999), so that Newton's region of
convergence does not shrink with eps; the floor is an interior-point barrier.
Where the Hessian is not positive definite, as on every rough shape with a jump
of radius, Gauss-Newton takes its place; with it the rough shape is never too
far away, and no coarser grid has to be solved first (measured to 1024 slices).
At the end the nodes that hardly moved are put back to rest exactly.

Dense: O(n^3) a step, the reference for everything faster.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxclay import local
from jaxclay._host import is_concrete, pytree
from jaxclay.certificate import SMALL, Forces, friction_limit, slack
from jaxclay.clay import Array
from jaxclay.methods.base import Method, State, check_setting, evened, sent_home
from jaxclay.problem import Problem
from jaxclay.schemes.paper import Point

_FIRST_EPS = 1e-2  # over the unit l
_LAST_EPS = 1e-13
_EAGER = 1e-3  # barrier weight over promised gain
_BACKTRACKS = 14
_TO_BOUNDARY = 0.99  # of the way to the floor that a step may go


@pytree
@dataclasses.dataclass(frozen=True)
class NewtonSettings:
    """tolerance: energy left to gain, relative to E_free, at which the solve ends."""

    max_iterations: Array = 200
    tolerance: Array = 1e-14

    def __post_init__(self):
        if is_concrete(self):
            check_setting("max_iterations", self.max_iterations, 1)
            check_setting("tolerance", self.tolerance, 1e-15, 1.0)


class _Memory(NamedTuple):
    eps: Array
    gain: Array  # what the last step promised


class _System(NamedTuple):
    """The Newton system at a point, floor's barrier eliminated."""

    matrix: Array
    gradient: Array
    barrier: Array


def init(problem: Problem, start: Point, settings: NewtonSettings) -> State:
    """Start off the floor, with multipliers that fit the smoothing."""
    point = _interior(problem, start)
    limit = friction_limit(problem)
    eps = jnp.asarray(_FIRST_EPS)
    lam = limit * point.shift / jnp.sqrt(point.shift**2 + eps**2)
    memory = _Memory(eps, jnp.maximum(problem.free_terms(point).total, 0.0))
    weight = _barrier(problem, point, memory)
    forces = Forces(lam, jnp.where(problem.loose, weight / _room(problem, point), 0.0))
    return State(point, forces, jnp.asarray(0), ~jnp.any(problem.free), memory)


def step(problem: Problem, state: State, settings: NewtonSettings) -> State:
    """One step on the smoothed energy; eps shrinks whenever its minimum is near."""
    point, (lam, z), memory = state.point, state.forces, state.memory
    eps, limit, d = memory.eps, friction_limit(problem), point.shift
    phi = jnp.sqrt(d**2 + eps**2)
    weight = _barrier(problem, point, memory)
    system = _system(problem, point, z, weight)
    curvature = jnp.maximum(limit - lam * d / phi, 0.0) / phi
    gradient = system.gradient + limit * d / phi
    factor = _factor(problem, point, system.matrix, jnp.diag(curvature) + system.barrier)
    delta = -jax.scipy.linalg.cho_solve((factor, True), gradient)
    gain = -gradient @ delta / 2

    length = _line_search(problem, point, delta, gain, eps, weight)
    moved = point.moved(length * delta)
    lam = jnp.clip(lam + length * (limit * d / phi - lam + curvature * delta), -limit, limit)
    forces = Forces(lam, _floor_step(problem, point, z, delta, weight))

    gate = settings.tolerance * jnp.maximum(problem.free_terms(point).total, SMALL)
    solved = (gain <= 0.1 * eps * jnp.sum(limit) + gate) | (length == 0)
    left = eps * jnp.sum(limit) + weight * problem.slices  # what smoothing and barrier hold back
    finished = solved & ((eps <= _LAST_EPS) | (left <= gate))
    smaller = jnp.maximum(jnp.minimum(0.1 * eps, eps**1.5), _LAST_EPS)
    rests = finished & (jnp.abs(moved.shift) <= 100 * _LAST_EPS)
    memory = _Memory(jnp.where(solved, smaller, eps), jnp.maximum(gain, 0.0))
    return State(sent_home(problem, moved, rests), forces, state.iterations + 1, finished, memory)


def _system(problem: Problem, point: Point, z: Array, weight: Array) -> _System:
    room = _room(problem, point)
    pushes = jnp.where(problem.loose, weight / room, 0.0)
    gradient = local.gradient(problem, point) - local.to_nodes(pushes)
    barrier = local.between_nodes(jnp.where(problem.loose, z / room, 0.0))
    free = problem.free
    return _System(
        matrix=local.hessian(problem, point),
        gradient=jnp.where(free, gradient, 0.0),
        barrier=jnp.where(free[:, None] & free[None, :], barrier, 0.0),
    )


def _factor(problem, point, matrix, added):
    """Cholesky factor of the Hessian plus ``added``, or of Gauss-Newton's if that has none."""
    factor = jnp.linalg.cholesky(matrix + added)
    return jax.lax.cond(
        jnp.all(jnp.isfinite(factor)),
        lambda: factor,
        lambda: jnp.linalg.cholesky(local.gauss_newton(problem, point) + added),
    )


def _line_search(problem, point, delta, gain, eps, weight) -> Array:
    """Longest of some halved steps that lowers the smoothed energy; 0 where none does."""
    limit = friction_limit(problem)

    def merit(shape: Point) -> Array:
        room = _room(problem, shape)
        safe = jnp.where(room > 0, room, 1.0)
        barrier = weight * jnp.sum(jnp.where(problem.loose, jnp.log(safe), 0.0))
        smoothed = jnp.sum(limit * jnp.sqrt(shape.shift**2 + eps**2))
        energy = problem.free_terms(shape).smooth + smoothed - barrier
        return jnp.where(jnp.all(room > 0), energy, jnp.inf)

    lengths = _longest(problem, point, delta) * 0.5 ** jnp.arange(_BACKTRACKS)
    here = merit(point)
    there = jax.vmap(lambda a: merit(point.moved(a * delta)))(lengths)
    rounding = 1e-13 * jnp.abs(here)
    lowers = (there <= here - 2e-4 * lengths * gain + rounding) | (gain <= rounding)
    lowers = lowers & jnp.isfinite(there)
    return jnp.where(jnp.any(lowers), lengths[jnp.argmax(lowers)], 0.0)


def _longest(problem: Problem, point: Point, delta: Array) -> Array:
    """Largest step up to 1 that stays well above the floor."""
    change = jnp.diff(delta)
    shrinks = problem.loose & (change < 0)
    safe = jnp.where(shrinks, change, -1.0)
    limits = jnp.where(shrinks, -_TO_BOUNDARY * _room(problem, point) / safe, 1.0)
    return jnp.minimum(jnp.min(limits), 1.0)


def _floor_step(problem, point, z, delta, weight) -> Array:
    """The floor's forces after a Newton step, kept positive."""
    room = _room(problem, point)
    change = weight / room - z - z / room * jnp.diff(delta)
    change = jnp.where(problem.loose, change, 0.0)
    falls = change < 0
    length = jnp.min(jnp.where(falls, -_TO_BOUNDARY * z / jnp.where(falls, change, -1.0), 1.0))
    return z + jnp.minimum(length, 1.0) * change


def _room(problem: Problem, point: Point) -> Array:
    """Thickness above the floor of loose slices, 1 for the others."""
    return jnp.where(problem.loose, slack(problem, point), 1.0)


def _barrier(problem: Problem, point: Point, memory: _Memory) -> Array:
    """Weight of the floor's logarithms: high while much is to be gained, and falling with eps.

    Its least value keeps the slack above rounding and is no matter to the certificate.
    """
    least = 1e-12 * jnp.maximum(problem.free_terms(point).total, SMALL)
    smoothing = problem.material.k * memory.eps * jnp.minimum(memory.eps, 1e-3)
    return (least + smoothing + _EAGER * memory.gain) / problem.slices


def _interior(problem: Problem, start: Point) -> Point:
    """The start, drawn off the floor if it touches."""
    touches = jnp.min(_room(problem, start) / problem.rest.thickness) < 1e-3
    return evened(problem, start, jnp.where(touches, 0.1, 0.0))


METHOD = Method(
    NewtonSettings, init, step, "primal-dual Newton with an active-set polish, the reference"
)
