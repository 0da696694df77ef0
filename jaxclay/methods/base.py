"""What a method is: settings, how it starts, one step.  The loop is minimize's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxclay.certificate import Forces
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
    """

    settings: type
    init: Callable[[Problem, Point, Any], State]
    step: Callable[[Problem, State, Any], State]
    summary: str


def no_forces(problem: Problem) -> Forces:
    """Zero multipliers."""
    return Forces(jnp.zeros_like(problem.rest.heights), jnp.zeros_like(problem.rest.thickness))


def check_setting(name: str, value: float, low: float, high: float = float("inf")) -> None:
    """Raise unless low <= value <= high."""
    if not low <= float(value) <= high:
        allowed = f"at least {low:g}" if high == float("inf") else f"between {low:g} and {high:g}"
        raise ValueError(f"{name} must be {allowed}, got {value:g}")
