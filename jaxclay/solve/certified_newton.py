"""Newton on slices and the certificate of its answer in one loop: the program behind most answers.

Each pass takes the local model at a point and solves one banded system, for a step of Newton's
or, once those have ended, for the certificate.  So model and factor are compiled once, and the
program is as small whatever the number of slices.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.methods import newton
from jaxclay.methods.base import State
from jaxclay.methods.loop import Outcome, Start
from jaxclay.methods.newton import NewtonSettings
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.host import compiled, in_float64
from jaxclay.schemes.base import Forces
from jaxclay.schemes.sums import Displaced
from jaxclay.schemes.system import System
from jaxclay.solve import certificate
from jaxclay.solve.certificate import Certificate, Search

_AGAIN = 3  # times that Newton goes on where the certificate refuses the step alone


class _Carry(NamedTuple):
    state: State
    finite: Array  # whether the last step was
    certifying: Array
    search: Search
    again: Array  # how often Newton has gone on, since only the step was too long


def certified_newton(
    system: System, first: State, settings: NewtonSettings, feasible: Array
) -> tuple[State, Array, Search]:
    """Where Newton ends, whether all was finite, and what the certificate finds there.

    Without a step where the squash is not ``feasible``.
    """

    def body(carry: _Carry) -> _Carry:
        state, finite, certifying, search, again = carry
        model = system.smooth_model(state.point)
        pull = newton.asked(system, state, model)
        search = search._replace(energy_free=pull.energy)
        certified, tried = certificate.asked(system, state.point, model, state.forces, search)
        linear = _either(certifying, certified, pull)
        answer, positive = system.newton_step(state.point, model.bands, linear)
        after = certificate.taken(system, state.point, search, linear, tried, answer, positive)
        new = newton.taken(system, state, model, pull, answer, positive & ~certifying, settings)
        finite = finite & (certifying | jnp.isfinite(pull.energy + new.memory.gain))
        finished = state.finished | (new.finished & finite)
        iterations = state.iterations + jnp.where(certifying | ~finite, 0, 1)
        ends = finished | ~finite | (iterations >= settings.max_iterations)
        # Gains of a side whose bending dwarfs the other's end before that one is at its minimum.
        more = state.finished & certifying & after.nearly & (again < _AGAIN)
        new = new._replace(finished=finished & ~more, iterations=iterations)
        fresh = certificate.first_search(system, pull.energy)
        search = _either(more, fresh, _either(certifying, after, search))
        return _Carry(new, finite, (certifying | ends) & ~more, search, again + more)

    def go_on(carry: _Carry) -> Array:
        return ~(carry.certifying & carry.search.over)

    over = first.finished | ~feasible
    search = certificate.first_search(system, jnp.zeros(()))
    start = _Carry(first, feasible, over, search, jnp.asarray(0))
    last = jax.lax.while_loop(go_on, body, start)
    return last.state, last.finite | ~feasible, last.search


def _either(condition: Array, one: Any, other: Any) -> Any:
    return jax.tree.map(lambda a, b: jax.lax.select(condition, a, b), one, other)


class Packed(NamedTuple):
    """All that goes in, in few arrays: what a call costs depends on their number."""

    nodes: Array
    slices: Array
    middles: Array
    turn: Array
    scalars: Array


def solve_on_host(
    system: System, start: Start, settings: NewtonSettings, feasible: Array
) -> tuple[Outcome, Certificate]:
    """The compiled program, called in float64; NumPy in and out."""
    values = packed(system, start, settings, feasible)
    return unpacked(system, in_float64("minimize", program, values))


def unpacked(system: System, answer: Answer) -> tuple[Outcome, Certificate]:
    """What the program has found."""
    shift, friction = answer.nodes
    thickness, floor = answer.slices
    iterations, finished, finite, positive, *found = answer.scalars
    point, forces = Displaced(thickness, shift), Forces(friction, floor)
    search = certificate.searched(positive > 0, *found)
    outcome = Outcome(point, forces, int(iterations), finished > 0, finite > 0)
    return outcome, certificate.concluded(system, point, search)


def packed(system: System, start: Start, settings: NewtonSettings, feasible: Array) -> Packed:
    """The arguments of :data:`program`; the clay at rest if not feasible."""
    s = system
    point = start.point
    if not feasible:
        point = Displaced(s.rest_thickness, 0.0 * s.target)
    state = newton.resume(system, point, start.forces, start.warm, settings)
    (thickness, shift), (friction, floor), _, finished, memory = state
    return Packed(
        np.stack([s.free, s.target, s.friction_limit, shift, friction]),
        np.stack(
            [
                s.upper, s.width, s.rest_thickness, s.floor, s.strain, s.slope, *s.radii,
                thickness, floor,
            ]
        ),
        np.stack([s.apart, s.tension, s.change]),
        s.turn,
        np.array(
            [
                s.r0, s.k, s.mu, s.friction_total, feasible, finished, *memory,
                settings.max_iterations, settings.tolerance, settings.smoothing,
            ],
            np.float64,
        ),
    )  # fmt: skip


class Answer(NamedTuple):
    """What comes out, packed likewise."""

    nodes: Array
    slices: Array
    scalars: Array


@compiled()
def program(values: Packed) -> Answer:
    """:func:`certified_newton` with its arguments and results packed."""
    free, target, limit, shift, friction = values.nodes
    upper, width, rest, least, strain, slope, *radii, thickness, floor = values.slices
    r0, k, mu, total, feasible, finished, *rest_of = values.scalars
    apart, tension, change = values.middles
    system = System(
        free=free, target=target, friction_limit=limit, upper=upper, width=width,
        rest_thickness=rest, floor=least, strain=strain, slope=slope, radii=tuple(radii),
        apart=apart, tension=tension, change=change, turn=values.turn, r0=r0, k=k, mu=mu,
        friction_total=total,
    )  # fmt: skip
    memory, settings = newton.Memory(*rest_of[:3]), NewtonSettings(*rest_of[3:])
    point, forces = Displaced(thickness, shift), Forces(friction, floor)
    first = State(point, forces, jnp.asarray(0), finished > 0, memory)
    return _answer(*certified_newton(system, first, settings, feasible > 0))


def solved(
    system: System, start: Start, settings: NewtonSettings, feasible: Array
) -> tuple[Outcome, Certificate]:
    """The same inside a larger program."""
    rest = Displaced(system.rest_thickness, 0 * system.target)
    point = jax.tree.map(lambda a, b: jnp.where(feasible, a, b), start.point, rest)
    state = newton.resume(system, point, start.forces, start.warm, settings)
    state = state._replace(iterations=jnp.asarray(0))
    last, finite, found = certified_newton(system, state, settings, feasible)
    outcome = Outcome(last.point, last.forces, last.iterations, last.finished, finite)
    return outcome, certificate.concluded(system, last.point, found)


def _answer(state: State, finite: Array, found: Search) -> Answer:
    ends = state.iterations, state.finished, finite, found.positive, found.energy_free, *found.best
    return Answer(
        jnp.stack([state.point.shift, state.forces.friction]),
        jnp.stack([state.point.thickness, state.forces.floor]),
        jnp.stack([value.astype(float) for value in ends]),
    )
