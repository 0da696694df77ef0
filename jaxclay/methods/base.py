"""What a method is: settings, how it starts, one step.  The loop is minimize's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxclay.certificate import Forces
from jaxclay.checks import as_number
from jaxclay.clay import Array
from jaxclay.problem import Problem
from jaxclay.schemes.paper import Point


class State(NamedTuple):
    """Where a method stands.

    Attributes
    ----------
    point : Point
        The shape.
    forces : Forces
        Its multipliers; zeros where the method knows none.
    iterations : int
        Steps done: Newton or L-BFGS iterations, greedy's sweeps.
    finished : bool
        Whether the method stopped by its own rule.
    memory : pytree
        What the next step needs besides.
    """

    point: Point
    forces: Forces
    iterations: Array
    finished: Array
    memory: Any


class Method(NamedTuple):
    """A minimiser as data.

    Attributes
    ----------
    settings : type
        Frozen dataclass of numbers, all with defaults, among them
        ``max_iterations``; validates itself.
    init : (problem, start, settings) -> State
    step : (problem, state, settings) -> State
    summary : str
        What it is, in a line.
    resume : (problem, start, forces, near, settings) -> State, optional
        ``init`` for a method that gains from starting near: where ``near``, the start is a
        minimum close by, with these forces.
    """

    settings: type
    init: Callable[[Problem, Point, Any], State]
    step: Callable[[Problem, State, Any], State]
    summary: str
    resume: Callable[[Problem, Point, Forces, Array, Any], State] | None = None


def no_forces(problem: Problem) -> Forces:
    """Zero multipliers."""
    return Forces(jnp.zeros_like(problem.rest.heights), jnp.zeros_like(problem.rest.thickness))


def evened(problem: Problem, point: Point, fraction: Array) -> Point:
    """The point moved by ``fraction`` towards each side of the band spread evenly.

    Spread evenly between its ends a side is above the floor if it can be at all.
    """
    held = problem.band.holds(problem.slices)
    upper = jnp.arange(problem.slices) >= jnp.argmax(held)
    change = jnp.zeros_like(point.thickness)
    for side in (problem.loose & ~upper, problem.loose & upper):
        rest = jnp.where(side, problem.rest.thickness, 0.0)
        now = jnp.where(side, point.thickness, 0.0)
        even = rest * jnp.sum(now) / jnp.maximum(jnp.sum(rest), 1e-300)
        change += jnp.where(side, fraction * (even - now), 0.0)
    moved = jnp.concatenate([jnp.zeros(1), jnp.cumsum(change)])
    return Point(point.thickness + change, point.shift + jnp.where(problem.free, moved, 0.0))


def lifted(problem: Problem, point: Point) -> Point:
    """The point moved no further than needed for every slice to reach the floor."""
    even = evened(problem, point, 1.0).thickness
    low = problem.loose & (point.thickness < problem.floor)
    gained = jnp.where(low, even - point.thickness, 1.0)
    fraction = jnp.where(low, (problem.floor - point.thickness) / gained, 0.0)
    return evened(problem, point, jnp.clip(jnp.max(fraction), 0.0, 1.0))


def sent_home(problem: Problem, point: Point, rests: Array) -> Point:
    """The point with the nodes that rest, a bool array, exactly where they were."""
    rests = rests & problem.free
    moved = point.moved(jnp.where(rests, -point.shift, 0.0))
    shift = jnp.where(rests, 0.0, moved.shift)
    home = (shift[1:] == 0) & (shift[:-1] == 0) & problem.loose
    return Point(jnp.where(home, problem.rest.thickness, moved.thickness), shift)


def check_setting(name: str, value: float, low: float, high: float = float("inf")) -> None:
    """Raise unless low <= value <= high."""
    if not low <= as_number(name, value) <= high:
        allowed = f"at least {low:g}" if high == float("inf") else f"between {low:g} and {high:g}"
        raise ValueError(f"{name} must be {allowed}, got {value:g}")
