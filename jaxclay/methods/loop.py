"""The one loop of all methods: stopping, finiteness and counts in one compiled call."""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.methods import METHODS
from jaxclay.numerics.arrays import Array, Bool, Int
from jaxclay.numerics.host import compiled
from jaxclay.schemes.base import AnyDisplaced, AnyProblem, Forces, no_forces


class Start(NamedTuple):
    """Where a method starts.

    Attributes
    ----------
    point : AnyDisplaced
    forces : Forces
        Multipliers; they count where ``warm``.
    warm : bool
        Whether this is a minimum of a problem close by, rather than any shape.
    """

    point: Any
    forces: Forces
    warm: Bool[Array, ""]


class Outcome(NamedTuple):
    """Where a method ended: its last finite point, and how it came to end."""

    point: Any
    forces: Forces
    iterations: Int[Array, ""]
    finished: Bool[Array, ""]
    finite: Bool[Array, ""]


def initial_guess(problem: AnyProblem, point: AnyDisplaced) -> Start:
    """A start of which only the shape is known, unlike a warm start."""
    return Start(point, no_forces(problem), np.asarray(False))


@compiled("method")
def solve(
    problem: AnyProblem, start: Start, settings: Any, feasible: Bool[Array, ""], *, method: str
) -> Outcome:
    """:func:`run`, without the certificate: one compiled call."""
    return run(problem, start, settings, feasible, method)


def run(
    problem: AnyProblem, start: Start, settings: Any, feasible: Bool[Array, ""], method: str
) -> Outcome:
    """The method's loop.

    Stops by the method's own rule, at the limit, or before the first step that
    is not finite.
    """
    chosen = METHODS[method]
    # Splines have no such system: they answer for themselves.
    posed: Any = getattr(problem, "system", problem) if chosen.folded else problem

    def body(carry):
        state, _ = carry
        new = chosen.step(posed, state, settings)
        finite = _finite(new.point)
        return jax.tree.map(lambda a, b: jnp.where(finite, a, b), new, state), finite

    def go_on(carry):
        state, finite = carry
        return finite & ~state.finished & (state.iterations < settings.max_iterations)

    if chosen.resume is None:
        state = chosen.init(posed, start.point, settings)
    else:
        state = chosen.resume(posed, *start, settings)
    first = (state, feasible & _finite(state.point))
    state, finite = jax.lax.while_loop(go_on, body, first)
    return Outcome(state.point, state.forces, state.iterations, state.finished, finite)


def _finite(point: AnyDisplaced) -> Array:
    return jnp.all(jnp.isfinite(point.thickness)) & jnp.all(jnp.isfinite(point.shift))
