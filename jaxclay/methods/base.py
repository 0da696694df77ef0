"""What a method is: settings, how it starts, one step.  The loop is minimize's."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from jaxclay.numerics.arrays import Array, Bool, Int
from jaxclay.numerics.checks import as_number
from jaxclay.schemes.base import AnyDisplaced, Forces


class State(NamedTuple):
    """Where a method stands.

    Attributes
    ----------
    point : AnyDisplaced
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

    point: AnyDisplaced
    forces: Forces
    iterations: Int[Array, ""]
    finished: Bool[Array, ""]
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
    resume : (problem, start, forces, warm, settings) -> State, optional
        ``init`` for a method that gains from a warm start: where ``warm``, the start is a
        minimum close by, with these forces.
    splines : bool
        Whether it knows the scheme "spline" too, and not only nodes.
    folded : bool
        Whether on slices it needs no more than :attr:`jaxclay.Problem.system`.
    """

    settings: type
    init: Callable[[Any, Any, Any], State]
    step: Callable[[Any, State, Any], State]
    summary: str
    resume: Callable[[Any, Any, Forces, Array, Any], State] | None = None
    splines: bool = False
    folded: bool = False


def check_setting(name: str, value: float, low: float, high: float = float("inf")) -> None:
    """Raise unless low <= value <= high."""
    if not low <= as_number(name, value) <= high:
        allowed = f"at least {low:g}" if high == float("inf") else f"between {low:g} and {high:g}"
        raise ValueError(f"{name} must be {allowed}, got {value:g}")
