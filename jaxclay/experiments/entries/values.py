"""Numbers of an experiment file: one, a list, a range, or a random draw.

    0.3
    [0.2, 0.3]
    { from = 0.1, to = 0.4, count = 4 }
    { from = 1e-2, to = 1e2, count = 5, spacing = "log" }
    { uniform = [0.1, 0.4] }
    { log_uniform = [1e-2, 10.0] }

A list may hold any of the others.  Where a table of scenes has ``draws``, each scene takes one
entry of every list at random, else all combinations are taken, and nothing can be drawn.  Numbers
are floats, so that 1 and 1.0 are the same, but for those that have to be whole.  The settings of a
method are such numbers: every combination must be one that it takes.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import math
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator

from jaxclay.experiments.peers import PEERS
from jaxclay.methods import METHODS
from jaxclay.methods.choice import method_settings, spline_settings

_FORMS = (
    "a number, a list, { from = A, to = B, count = N }, with spacing = \"log\" if wanted, "
    "{ uniform = [A, B] } or { log_uniform = [A, B] }"
)  # fmt: skip
_MOST = 10_000  # numbers of a range, combinations of settings
_LIMITS = ("max_iterations", "tolerance")  # what peers take
Place = tuple[str | int, ...]


class MistakeAt(ValueError):
    """A mistake in a table, at a ``place`` below the table's own."""

    def __init__(self, message: str, *place: str | int):
        super().__init__(message)
        self.place = place


@dataclasses.dataclass(frozen=True)
class Draw:
    """A number to be drawn between two others, on a linear or a logarithmic scale."""

    low: float
    high: float
    logarithmic: bool

    def value(self, rng: np.random.Generator) -> float:
        """One draw."""
        if self.logarithmic:
            return float(np.exp(rng.uniform(np.log(self.low), np.log(self.high))))
        return float(rng.uniform(self.low, self.high))


@dataclasses.dataclass(frozen=True)
class Values:
    """The numbers that one key of an experiment file stands for."""

    entries: tuple[float | Draw, ...]

    @property
    def ends(self) -> list[float]:
        """The numbers, and the ends of what is drawn."""
        pairs = ((e.low, e.high) if isinstance(e, Draw) else (e,) for e in self.entries)
        return [value for pair in pairs for value in pair]

    def fixed(self) -> list[float]:
        """The numbers, but for those that have to be drawn."""
        return [entry for entry in self.entries if not isinstance(entry, Draw)]

    @property
    def random(self) -> bool:
        """Whether some of them have to be drawn."""
        return len(self.fixed()) < len(self.entries)

    def drawn(self, rng: np.random.Generator) -> float:
        """One of them, picked or drawn at random."""
        entry = self.entries[int(rng.integers(len(self.entries)))]
        return entry.value(rng) if isinstance(entry, Draw) else entry


def numbers(low: float, high: float = math.inf, *, above: bool = False) -> Any:
    """The type of a key whose numbers lie between ``low`` and ``high``, or ``above`` low."""
    allowed = f"above {low:g}" if above else f"at least {low:g}"
    allowed += f", at most {high:g}" if high < math.inf else ""

    def check(raw: Any) -> Values:
        found = Values(tuple(_entries(raw)))
        for value in found.ends:
            if not (low < value if above else low <= value) or not value <= high:
                raise ValueError(f"{value:g} is out of range: it must be {allowed}")
        return found

    return Annotated[Values, BeforeValidator(check)]


def whole_numbers(low: int, high: int) -> Any:
    """The same for numbers that must be whole, as those of slices; nothing can be drawn."""

    def check(raw: Any) -> Values:
        allowed = f" between {low} and {high}"
        found = as_whole(Values(tuple(_entries(raw))), allowed).fixed()
        for value in found:
            if not low <= value <= high:
                raise ValueError(f"{value:g} is not a whole number{allowed}")
        return Values(tuple(sorted(set(found))))

    return Annotated[Values, BeforeValidator(check)]


def as_whole(values: Values, allowed: str = "") -> Values:
    """The same numbers as ints; nothing can be drawn."""
    if values.random:
        raise ValueError("cannot be drawn at random: give a number, a list or a range")
    for value in values.fixed():
        if value != int(value):
            raise ValueError(f"{value!r} is not a whole number{allowed}")
    return Values(tuple(int(value) for value in values.fixed()))


def combinations(values: dict[str, Values]) -> list[dict[str, float]]:
    """Every choice of one number for each name; nothing can be drawn."""
    choices = itertools.product(*(each.fixed() for each in values.values()))
    return [dict(zip(values, choice, strict=True)) for choice in choices]


def _entries(raw: Any) -> list[float | Draw]:
    match raw:
        case Values():
            return [*raw.entries]
        case []:
            raise ValueError("an empty list: nothing would be run")
        case list():
            return [entry for one in raw for entry in _entries(one)]
        case {"uniform": ends} if len(raw) == 1:
            return [Draw(*_rising("uniform takes", ends), False)]
        case {"log_uniform": ends} if len(raw) == 1:
            return [Draw(*_rising("log_uniform takes", ends, above=0.0), True)]
        case {"from": low, "to": high, "count": count, **more} if more.keys() <= {"spacing"}:
            return _range([low, high], count, **more)
        case dict():
            raise ValueError(f"a table with the keys {', '.join(raw) or 'none'}: give {_FORMS}")
    if not _is_finite(raw):
        raise ValueError(f"{raw!r} is not a finite number: give {_FORMS}")
    return [float(raw)]


def _range(ends: list[Any], count: Any, spacing: Any = "linear") -> list[float | Draw]:
    if spacing not in ("linear", "log"):
        raise ValueError(f'spacing must be "linear" or "log", not {spacing!r}')
    if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= _MOST:
        raise ValueError(
            f"count must be a whole number of at least 1, at most {_MOST}, not {count!r}"
        )
    low, high = _rising("from and to are", ends, 0.0 if spacing == "log" else -math.inf, True)
    between = np.geomspace if spacing == "log" else np.linspace
    return [float(value) for value in between(low, high, count)]


def _rising(name: str, ends: Any, above: float = -math.inf, equal: bool = False):
    """Two finite numbers, the first below the second, or ``equal`` to it."""
    if isinstance(ends, list) and len(ends) == 2 and all(map(_is_finite, ends)):
        low, high = map(float, ends)
        if above < low and (low < high or (equal and low == high)):
            return low, high
    positive = ", both positive" if above == 0 else ""
    raise ValueError(f"{name} two finite numbers that rise{positive}, not {ends!r}")


def _is_finite(raw: Any) -> bool:
    """Whether it is a number that a float can hold."""
    with contextlib.suppress(OverflowError, TypeError):
        return not isinstance(raw, bool) and math.isfinite(raw)
    return False


def checked_settings(method: str, settings: dict[str, Values]) -> dict[str, Values]:
    """The settings, ints where the method counts with them.

    Raises MistakeAt: The setting that is wrong, or none where they are only together.
    """
    found, defaults = dict(settings), all_settings(method, {})
    for name, values in settings.items():
        if values.random or isinstance(defaults.get(name), int):
            try:
                found[name] = as_whole(values)  # which refuses what is drawn
            except ValueError as error:
                raise MistakeAt(str(error), name) from None
    count = math.prod(len(values.entries) for values in found.values())
    if count > _MOST:
        raise ValueError(f"{count} combinations of settings: at most {_MOST} can be run")
    for combination in combinations(found):
        try:
            all_settings(method, combination)
        except ValueError as error:
            raise MistakeAt(str(error), *_wrong(method, combination)) from None
    return found


def all_settings(method: str, chosen: dict[str, Any], scheme: str = "paper") -> dict[str, Any]:
    """The settings of a method or a peer by name, its defaults filled in.

    Raises ValueError: A setting that it does not have, or a value that it does not take.
    """
    if method in PEERS:
        for name in chosen:
            if name not in _LIMITS:
                message = f"{method} has no setting {name!r}: it takes {', '.join(_LIMITS)}"
                raise ValueError(message)
        return {name: getattr(PEERS[method].limits, name) for name in _LIMITS} | chosen
    settings = (spline_settings if scheme == "spline" else method_settings)(method, chosen)
    return {f.name: getattr(settings, f.name) for f in dataclasses.fields(METHODS[method].settings)}


def static_settings(method: str, chosen: dict[str, Any]) -> tuple[Any, ...]:
    """The values of those settings that a program is compiled for."""
    if method in PEERS:
        return ()
    fields = dataclasses.fields(METHODS[method].settings)
    whole = all_settings(method, chosen)
    return tuple(whole[field.name] for field in fields if field.metadata.get("static"))


def _wrong(method: str, combination: dict[str, Any]) -> Place:
    """The first setting that is wrong alone, if one is."""
    for name, value in combination.items():
        try:
            all_settings(method, {name: value})
        except ValueError:
            return (name,)
    return ()
