"""``newton``: primal-dual Newton on E_total with friction and floor as they are.

The kinks of friction are smoothed as sqrt(d^2 + eps^2), but its force lam is an
unknown of its own (Chan, Golub and Mulet 1999), so that Newton's region of
convergence does not shrink with eps; the floor is an interior-point barrier.
Where the Hessian is not positive definite, as on every rough shape with a jump
of radius, Gauss and Newton's takes its place.  At the end the nodes that hardly
moved are put back to rest exactly.

Every step is O(n): the Hessian comes in bands, factored by :mod:`jaxclay.banded`.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxclay._host import is_concrete, pytree
from jaxclay.certificate import SMALL, Forces
from jaxclay.clay import Array
from jaxclay.methods.base import AnyPoint, AnyProblem, Method, State, check_setting, no_forces

_FIRST_EPS = 1e-3  # over the unit l
_WARM_EPS = 1e-6
_WARM_GAIN = 1e-6  # what there is to gain from a minimum close by, over E_free
_HOME = 1e-13  # displacement over the unit l within which clay is put back to rest
_SETTLED = 1e-2  # of the tolerance: where the last nodes begin to move, gains mislead
_ROUNDING = 1e-17  # first shift of a matrix that is not positive definite, over its largest entry
_TINY = 1e-300
_EAGER = 1e-3  # barrier weight over promised gain
_BACKTRACKS = 14
_TO_BOUNDARY = 0.99  # of the way to the floor that a step may go


@pytree
@dataclasses.dataclass(frozen=True)
class NewtonSettings:
    """Settings of Newton.

    Attributes
    ----------
    tolerance : float
        Energy left to gain, relative to E_free, at which the solve ends.
    smoothing : float
        The last smoothing eps of friction, over the unit l; larger ones leave clay that
        should rest moved by about as much.
    """

    max_iterations: Array = 200
    tolerance: Array = 1e-14
    smoothing: Array = 1e-15

    def __post_init__(self):
        if is_concrete(self):
            check_setting("max_iterations", self.max_iterations, 1)
            check_setting("tolerance", self.tolerance, 1e-15, 1.0)
            check_setting("smoothing", self.smoothing, 1e-15, 1e-3)


class _Memory(NamedTuple):
    eps: Array
    gain: Array  # what the last step promised
    failures: Array  # factorisations in a row that found no positive definite matrix


def init(problem: AnyProblem, start: AnyPoint, settings: NewtonSettings) -> State:
    """Start off the floor, with multipliers that fit the smoothing."""
    return resume(problem, start, no_forces(problem), jnp.asarray(False), settings)


def resume(
    problem: AnyProblem, start: AnyPoint, forces: Forces, near: Array, settings: NewtonSettings
) -> State:
    """The same; where the start is a minimum close by, with the multipliers there."""
    point, limit = _interior(problem, start), problem.friction_limit
    eps = jnp.where(near, _WARM_EPS, _FIRST_EPS)
    fitting = limit * point.shift / jnp.sqrt(point.shift**2 + eps**2)
    lam = jnp.where(near, jnp.clip(forces.friction, -limit, limit), fitting)
    energy = problem.free_smooth(point) + jnp.sum(limit * jnp.abs(point.shift))
    # A jump of radius makes the Hessian indefinite: Gauss and Newton's goes first.
    memory = _Memory(eps, jnp.where(near, _WARM_GAIN, 1.0) * energy, jnp.asarray(1))
    pushes = _barrier(problem, energy, memory) / _room(problem, point)
    pushes = jnp.where(near, jnp.maximum(forces.floor, pushes), pushes)
    forces = Forces(lam, jnp.where(problem.loose, pushes, 0.0))
    return State(point, forces, jnp.asarray(0), ~jnp.any(problem.free), memory)


def step(problem: AnyProblem, state: State, settings: NewtonSettings) -> State:
    """One factorisation, and one step on the smoothed energy if it is positive definite.

    eps shrinks whenever the smoothed energy's minimum is near.
    """
    point, (lam, z), memory = state.point, state.forces, state.memory
    eps, limit, d = memory.eps, problem.friction_limit, point.shift
    phi = jnp.sqrt(d**2 + eps**2)
    model = problem.smooth_model(point)
    energy = model.value + jnp.sum(limit * jnp.abs(d))
    weight = _barrier(problem, energy, memory)
    room = _room(problem, point)
    pushes = jnp.where(problem.loose, weight / room, 0.0)
    gradient = model.gradient + problem.from_shift(limit * d / phi)
    gradient -= problem.from_thickness(pushes)
    curvature = jnp.maximum(limit - lam * d / phi, 0.0) / phi
    stiff = _stiffness(problem, point, model.bands, z / room, curvature, memory.failures)
    positive = stiff.positive
    delta = jnp.where(positive, -problem.relaxed(stiff, gradient), 0.0)
    gain = -gradient @ delta / 2

    length = _line_search(problem, point, model.value, delta, gain, eps, weight)
    moved = problem.moved(point, length * delta)
    change = length * (limit * d / phi - lam + curvature * problem.shift_change(delta))
    lam = jnp.where(positive, jnp.clip(lam + change, -limit, limit), lam)
    z = jnp.where(positive, _floor_step(problem, point, z, delta, weight), z)

    gate = settings.tolerance * jnp.maximum(energy, SMALL)
    smoothing = eps * jnp.sum(limit)
    lost = positive & (length == 0)
    stuck = lost & (memory.failures > 0)  # with Gauss and Newton's matrix as well
    near = positive & ((gain <= 0.1 * smoothing + gate) | stuck)
    held_back = smoothing + weight * room.shape[0]  # by what is smoothed and by the barrier
    last = (eps <= settings.smoothing) | (held_back <= gate)
    finished = near & last & ((gain <= _SETTLED * gate) | lost)
    smaller = jnp.minimum(
        jnp.minimum(0.1 * eps, eps**1.5), gain / jnp.maximum(smoothing / eps, _TINY)
    )
    eps = jnp.where(near, jnp.maximum(smaller, settings.smoothing), eps)
    gain = jnp.where(positive, jnp.maximum(gain, 0.0), memory.gain)
    memory = _Memory(eps, gain, jnp.where(positive & ~lost, 0, memory.failures + 1))
    rests = finished & (jnp.abs(moved.shift) <= _HOME)
    point = problem.sent_home(moved, rests)
    return State(point, Forces(lam, z), state.iterations + 1, finished, memory)


def _stiffness(problem, point, matrix, floor, friction, failures) -> Any:
    """The Hessian's factor; after a failure Gauss and Newton's, then with a growing shift."""
    shift = jnp.where(failures > 1, _ROUNDING * 4.0**failures, 0.0)
    return problem.stiffness(point, matrix, floor, friction, shift, failures > 0)


def _line_search(problem, point, value, delta, gain, eps, weight) -> Array:
    """Longest of some halved steps that lowers the smoothed energy; 0 where none does."""
    limit = problem.friction_limit

    def merit(value: Array, shape: AnyPoint) -> Array:
        """Not a number below the floor, and so never lower."""
        barrier = weight * jnp.where(problem.loose, jnp.log(_room(problem, shape)), 0.0)
        smoothed = limit * jnp.sqrt(shape.shift**2 + eps**2)
        return value + problem.total(smoothed, -barrier)

    here = merit(value, point)
    rounding = 1e-13 * jnp.abs(here)

    def rejected(length):
        shape = problem.moved(point, length * delta)
        there = merit(problem.free_smooth(shape), shape)
        lowers = (there <= here - 2e-4 * length * gain + rounding) | (gain <= rounding)
        return ~(lowers & jnp.isfinite(there))

    def go_on(carry):
        return carry[1] & (carry[2] < _BACKTRACKS)

    def shorter(carry):
        length, _, tries = carry
        return length / 2, rejected(length / 2), tries + 1

    longest = _longest(problem, point, delta)
    length, fails, _ = jax.lax.while_loop(go_on, shorter, (longest, rejected(longest), 1))
    return jnp.where(fails, 0.0, length)


def _longest(problem: AnyProblem, point: AnyPoint, delta: Array) -> Array:
    """Largest step up to 1 that stays well above the floor."""
    change = problem.thickness_change(delta)
    shrinks = problem.loose & (change < 0)
    safe = jnp.where(shrinks, change, -1.0)
    limits = jnp.where(shrinks, -_TO_BOUNDARY * _room(problem, point) / safe, 1.0)
    return jnp.minimum(jnp.min(limits), 1.0)


def _floor_step(problem, point, z, delta, weight) -> Array:
    """The floor's forces after a Newton step, kept positive."""
    room = _room(problem, point)
    change = weight / room - z - z / room * problem.thickness_change(delta)
    change = jnp.where(problem.loose, change, 0.0)
    falls = change < 0
    length = jnp.min(jnp.where(falls, -_TO_BOUNDARY * z / jnp.where(falls, change, -1.0), 1.0))
    return z + jnp.minimum(length, 1.0) * change


def _room(problem: AnyProblem, point: AnyPoint) -> Array:
    """Thickness above the floor of loose slices, 1 for the others."""
    return jnp.where(problem.loose, problem.slack(point), 1.0)


def _barrier(problem: AnyProblem, energy: Array, memory: _Memory) -> Array:
    """Weight of the floor's logarithms: high while much is to be gained, and falling with eps.

    Its least value keeps the slack above rounding and is no matter to the certificate.
    """
    least = 1e-12 * jnp.maximum(energy, SMALL)
    smoothing = problem.material.k * memory.eps * jnp.minimum(memory.eps, 1e-3)
    return (least + smoothing + _EAGER * memory.gain) / problem.loose.shape[0]


def _interior(problem: AnyProblem, start: AnyPoint) -> AnyPoint:
    """The start, drawn off the floor if it touches."""
    touches = jnp.min(_room(problem, start) / problem.rest_thickness) < 1e-3
    return jax.lax.cond(touches, lambda: problem.evened(start, 0.1), lambda: start)


METHOD = Method(
    NewtonSettings, init, step, "primal-dual Newton on a banded Hessian, the default", resume, True
)
