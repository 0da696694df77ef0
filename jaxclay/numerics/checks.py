"""Validation on the host: each check names the value and what is allowed."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator

import numpy as np

from jaxclay.numerics.host import is_concrete


class Hindrance(RuntimeError):
    """What this package cannot do as things stand, by no fault of its own: the message says why."""


class Missing(ImportError, Hindrance):
    """A package that is needed is not installed or does not import: the message says what to do."""


@contextlib.contextmanager
def needing(extra: str, who: str) -> Iterator[None]:
    """Name the extra to install where an import in the block fails.

    Raises
    ------
    Missing
        ``who`` needs a package of ``extra`` that is not there.
    """
    try:
        yield
    except ImportError as error:
        if isinstance(error, Missing) or (error.name or "jaxclay").startswith("jaxclay"):
            raise
        raise Missing(
            f"{who} needs {error.name}: pip install '.[{extra}]' in a clone of jaxclay",
            name=error.name,
        ) from error


REFUSALS = (ValueError, Hindrance)  # how wrong input is answered; other errors are faults
_FINEST, _COARSEST = 1e-9, 0.1  # of a contour's error, over the unit l


def check_slices(slices: int) -> None:
    """Raise unless ``slices`` is a whole number of at least 3, the fewest with a bending term."""
    check_whole("slices", slices, 3)


def check_whole(name: str, value, least: int) -> None:
    """Raise unless it is a whole number, not below ``least``."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or value < least:
        raise ValueError(f"{name} must be a whole number of at least {least}, got {value!r}")


def check_positive(name: str, value) -> None:
    """Raise unless ``value`` is a finite positive number."""
    if not is_concrete(value):
        return
    value = as_number(name, value)
    if not (value > 0 and np.isfinite(value)):
        raise ValueError(f"{name} must be positive and finite, got {value:g}")


def as_number(name: str, value) -> float:
    """The value as a float, or an error that names it."""
    try:
        return float(value)
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be a number, got {value!r}") from None


def check_increasing(heights: np.ndarray, name: str) -> None:
    """Raise unless the heights are finite and increase; the error names the first that is not."""
    if not np.isfinite(heights).all():
        i = int(np.argmin(np.isfinite(heights)))
        raise ValueError(f"{name}[{i}] is {heights[i]}, but {name} must be finite")
    steps = np.diff(heights)
    if not (steps > 0).all():
        i = int(np.argmax(steps <= 0))
        raise ValueError(
            f"{name} must increase from bottom to top, but {name}[{i + 1}] = {heights[i + 1]:g} "
            f"follows {name}[{i}] = {heights[i]:g}"
        )


def check_nodes(name: str, nodes: np.ndarray, slices: int | None = None) -> None:
    """Raise unless they are material coordinates in order from 0 to 1, ``slices`` + 1 if given."""
    if nodes.ndim != 1 or len(nodes) < 4 or slices not in (None, len(nodes) - 1):
        expected = "at least 4 nodes" if slices is None else f"{slices + 1} nodes"
        raise ValueError(f"{name} must hold {expected}, got shape {nodes.shape}")
    if not np.isfinite(nodes).all() or nodes.min() < 0 or nodes.max() > 1:
        wrong = nodes[~((nodes >= 0) & (nodes <= 1))][0]
        raise ValueError(f"{name} must lie between 0 and 1, got {wrong:g}")
    check_increasing(nodes, name)
    if nodes[0] != 0 or nodes[-1] != 1:
        raise ValueError(f"{name} must run from 0 to 1, got {nodes[0]:g} to {nodes[-1]:g}")


def within(name: str, value, low: float, high: float):
    """The values, which must lie in [low, high] up to rounding; an error names one outside."""
    if not is_concrete(value, low, high):
        return value
    value = np.asarray(value, np.float64)
    margin = 1e-12 * (high - low)
    wrong = ~((value >= low - margin) & (value <= high + margin))
    if wrong.any():
        first = value.reshape(-1)[int(np.argmax(wrong))]
        raise ValueError(f"{name} must lie between {low:g} and {high:g}, got {first:g}")
    return np.clip(value, low, high)


def check_tolerance(tolerance: float) -> None:
    """Raise unless it is an error of the contour, over the unit l, that can be asked for."""
    if not is_concrete(tolerance):
        return
    if not _FINEST <= as_number("tolerance", tolerance) <= _COARSEST:
        raise ValueError(
            f"tolerance must lie between {_FINEST:g}, the least that float64 can give, and "
            f"{_COARSEST:g}, got {tolerance!r}"
        )
