"""The one loop of all methods: stopping, finiteness and counts in one compiled call."""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxclay.certificate import Forces
from jaxclay.clay import Array
from jaxclay.methods import METHODS
from jaxclay.problem import Problem
from jaxclay.schemes.paper import Point


class Outcome(NamedTuple):
    """Where a method ended: its last finite point, and how it came to end."""

    point: Point
    forces: Forces
    iterations: Array
    finished: Array
    finite: Array


@partial(jax.jit, static_argnames="method")
def solve(
    problem: Problem, start: Point, settings: Any, feasible: Array, *, method: str
) -> Outcome:
    """The method's loop, without the judge: one compiled call.

    Stops by the method's own rule, at the limit, or before the first step that
    is not finite.
    """
    chosen = METHODS[method]

    def body(carry):
        state, _ = carry
        new = chosen.step(problem, state, settings)
        finite = _finite(new.point)
        return jax.tree.map(lambda a, b: jnp.where(finite, a, b), new, state), finite

    def go_on(carry):
        state, finite = carry
        return finite & ~state.finished & (state.iterations < settings.max_iterations)

    state = chosen.init(problem, start, settings)
    first = (state, feasible & _finite(state.point))
    state, finite = jax.lax.while_loop(go_on, body, first)
    return Outcome(state.point, state.forces, state.iterations, state.finished, finite)


def _finite(point: Point) -> Array:
    return jnp.all(jnp.isfinite(point.thickness)) & jnp.all(jnp.isfinite(point.shift))
