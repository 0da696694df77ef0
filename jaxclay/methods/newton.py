"""``newton``: primal-dual Newton on E_total with friction and lower bound as they are.

The kinks of friction are smoothed as sqrt(d^2 + eps^2), but its force lam is an
unknown of its own (Chan, Golub and Mulet 1999), so that Newton's region of
convergence does not shrink with eps; the lower bound is an interior-point barrier.
Where the Hessian is not positive definite, as on every rough shape with a jump
of radius, Gauss and Newton's takes its place.  At the end the nodes that hardly
moved are put back to rest exactly.

Every step is O(n): the Hessian comes in bands, factored by :mod:`jaxclay.numerics.banded`.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.methods.base import Method, State, check_setting
from jaxclay.numerics.arrays import Array, namespace
from jaxclay.numerics.host import is_concrete, pytree
from jaxclay.schemes.base import SMALL, AnyDisplaced, Forces, Newtonian, Pull, no_forces

_FIRST_EPS = 1e-3  # over the unit l
_WARM_EPS = 1e-6
_WARM_GAIN = 1e-6  # what there is to gain from a minimum close by, over E_free
_RESTS = 1e-13  # displacement over the unit l within which clay is put back to rest
_SETTLED = 1e-2  # of the tolerance: where the last nodes begin to move, gains mislead
_ROUNDING = 1e-17  # first shift of a matrix that is not positive definite, over its largest entry
_HELD = 5e-13  # of the energy: what the barrier's last weights cost where the floor pushes
_EAGER = 1e-3  # barrier weight over promised gain
_BACKTRACKS = 14
_TO_BOUNDARY = 0.99  # of the way to the lower bound that a step may go


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


class Memory(NamedTuple):
    """What the next step needs besides the shape and its multipliers.

    Attributes
    ----------
    eps : float
        Friction's smoothing, over l.
    gain : float
        What the last step promised.
    failures : float
        Factorisations in a row that found no positive definite matrix.
    """

    eps: Array
    gain: Array
    failures: Array


def init(problem: Newtonian, start: AnyDisplaced, settings: NewtonSettings) -> State:
    """Start off the lower bound, with multipliers that fit the smoothing."""
    return resume(problem, start, no_forces(problem), np.asarray(False), settings)


def resume(
    problem: Newtonian, start: AnyDisplaced, forces: Forces, warm: Array, settings: NewtonSettings
) -> State:
    """The same; where the start is a minimum close by, with the multipliers there."""
    xp = namespace(problem.friction_limit, start.shift, forces.friction, warm)
    point, limit = _interior(problem, start), problem.friction_limit
    eps = xp.where(warm, _WARM_EPS, _FIRST_EPS)
    fitting = limit * point.shift / xp.sqrt(point.shift**2 + eps**2)
    lam = xp.where(warm, xp.clip(forces.friction, -limit, limit), fitting)
    energy = problem.free_smooth(point) + limit @ abs(point.shift)
    # A jump of radius makes the Hessian indefinite: Gauss and Newton's goes first.
    memory = Memory(eps, xp.where(warm, _WARM_GAIN, 1.0) * energy, 1.0 + 0.0 * energy)
    pushes = _barrier(problem, energy, memory) / problem.slack(point)
    pushes = xp.where(warm, xp.maximum(forces.floor, pushes), pushes)
    nothing = 0 * xp.argmax(limit)
    return State(point, Forces(lam, pushes), nothing, xp.max(problem.free) == 0, memory)


def step(problem: Newtonian, state: State, settings: NewtonSettings) -> State:
    """One factorisation, and one step on the smoothed energy if it is positive definite.

    eps shrinks whenever the smoothed energy's minimum is near.
    """
    model = problem.smooth_model(state.point)
    pull = asked(problem, state, model)
    answer, positive = problem.newton_step(state.point, model.bands, pull)
    return taken(problem, state, model, pull, answer, positive, settings)


def asked(problem: Newtonian, state: State, model: Any) -> Pull:
    """The smoothed energy's model at the state, its Hessian's own part left out."""
    point, (lam, z), memory = state.point, state.forces, state.memory
    limit, d = problem.friction_limit, point.shift
    energy = model.value + limit @ jnp.abs(d)
    phi, slack = jnp.sqrt(d * d + memory.eps * memory.eps), problem.slack(point)
    # Where the lower bound pushes hard its last weight leaves a slack well above rounding.
    pushes = z * problem.rest_thickness
    hard = pushes / jnp.maximum(pushes.sum(), energy)
    weight = _barrier(problem, energy, memory) + _HELD * energy * hard
    force = model.gradient + problem.from_shift(limit * d / phi)
    force -= problem.from_thickness(weight / slack)
    curvature = jnp.maximum(limit - lam * d / phi, 0.0) / phi
    # After a failure Gauss and Newton's matrix, then with a growing shift.
    fails = jnp.minimum(memory.failures, 1.0)
    shift = _ROUNDING * jnp.maximum(4.0**memory.failures - 4.0, 0.0)
    return Pull(z / slack, curvature, shift, fails, force, energy, weight)


def taken(
    problem: Newtonian, state: State, model: Any, pull: Pull, answer: Array, positive: Array,
    settings: NewtonSettings,
) -> State:  # fmt: skip
    """The state after the step H^-1 force, ``answer``."""
    point, (lam, z), memory = state.point, state.forces, state.memory
    eps, limit, d = memory.eps, problem.friction_limit, point.shift
    delta = jnp.where(positive, -answer, 0.0)
    gain = -0.5 * (pull.force @ delta)

    length = _line_search(problem, point, model.value, delta, gain, eps, pull.weight, positive)
    moved = problem.moved(point, length * delta)
    fitting = limit * d / jnp.sqrt(d * d + eps * eps)
    change = fitting - lam + pull.friction * problem.shift_change(delta)
    lam = jnp.maximum(jnp.minimum(lam + length * change, limit), -limit)
    z = jnp.where(positive, _bound_step(problem, point, z, delta, pull.weight), z)

    gate = settings.tolerance * jnp.maximum(pull.energy, SMALL)
    total = problem.friction_total
    smoothing = eps * total
    lost = positive & (length == 0)
    stuck = lost & (memory.failures > 0)  # with Gauss and Newton's matrix as well
    near = positive & ((gain <= 0.1 * smoothing + gate) | stuck)
    held_back = smoothing + pull.weight.sum()  # by smoothing and barrier
    last = (eps <= settings.smoothing) | (held_back <= gate)
    finished = near & last & ((gain <= _SETTLED * gate) | lost)
    smaller = jnp.minimum(jnp.minimum(0.1 * eps, eps * jnp.sqrt(eps)), gain / total)
    eps = jnp.where(near, jnp.maximum(smaller, settings.smoothing), eps)
    gain = jnp.where(positive, jnp.maximum(gain, 0.0), memory.gain)
    memory = Memory(eps, gain, jnp.where(positive & ~lost, 0.0, memory.failures + 1))
    point = problem.put_to_rest(moved, finished & (jnp.abs(moved.shift) <= _RESTS))
    return State(point, Forces(lam, z), state.iterations + 1, finished, memory)


def _line_search(problem, point, value, delta, gain, eps, weight, wanted) -> Array:
    """Longest of some halved steps that lowers the smoothed energy; 0 where none does."""
    here = value + problem.kinks(point, eps, weight)
    # Differences of radii cancel: on fine slices the energy is known to this.
    rounding = 1e-12 * jnp.abs(here)

    def go_on(carry):
        _, fails, tries = carry
        return fails & (tries < _BACKTRACKS)

    def shorter(carry):
        length, _, tries = carry
        length = length / 2
        there = problem.moved(point, length * delta)
        # Not a number below the lower bound, and so never lower.
        merit = problem.free_smooth(there) + problem.kinks(there, eps, weight)
        lowers = (merit <= here - 2e-4 * length * gain + rounding) | (gain <= rounding)
        return length, ~(lowers & jnp.isfinite(merit)), tries + 1

    first = 2 * _longest(problem, point, delta), wanted, 0
    length, fails, tries = jax.lax.while_loop(go_on, shorter, first)
    return jnp.where(fails | (tries == 0), 0.0, length)


def _longest(problem: Newtonian, point: AnyDisplaced, delta: Array) -> Array:
    """Largest step up to 1 that stays well above the lower bound."""
    shrinks = jnp.max(-problem.thickness_change(delta) / problem.slack(point))
    return _TO_BOUNDARY / jnp.maximum(shrinks, _TO_BOUNDARY)


def _bound_step(problem, point, z, delta, weight) -> Array:
    """The lower bound's forces after a Newton step, kept positive."""
    slack = problem.slack(point)
    change = (weight - z * problem.thickness_change(delta)) / slack - z
    return z + change * (_TO_BOUNDARY / jnp.maximum(jnp.max(-change / z), _TO_BOUNDARY))


def _barrier(problem: Newtonian, energy: Array, memory: Memory) -> Array:
    """Weight of the lower bound's logarithms: high while there is much to gain, falling with eps.

    Its least value is no matter to the certificate.
    """
    xp = namespace(energy)
    least = 1e-12 * xp.maximum(energy, SMALL)
    smoothing = problem.k * memory.eps * xp.minimum(memory.eps, 1e-3)
    return (least + smoothing + _EAGER * memory.gain) / problem.floor.shape[0]


def _interior(problem: Newtonian, start: AnyDisplaced) -> AnyDisplaced:
    """The start, drawn off the lower bound if it touches."""
    xp = namespace(problem.friction_limit, start.shift)
    touches = xp.min(problem.slack(start) / problem.rest_thickness) < 1e-3
    if xp is np and not touches:
        return start
    inside = problem.evened(start, 0.1)
    return jax.tree.map(lambda a, b: xp.where(touches, a, b), inside, start)


METHOD = Method(
    NewtonSettings,
    init,
    step,
    "primal-dual Newton on a banded Hessian, the default",
    resume,
    splines=True,
    folded=True,
)
