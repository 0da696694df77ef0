"""Numbers of an experiment file: one, a list, a range, or a random draw.

    0.3
    [0.2, 0.3]
    { from = 0.1, to = 0.4, count = 4 }
    { from = 1e-2, to = 1e2, count = 5, spacing = "log" }
    { uniform = [0.1, 0.4] }
    { log_uniform = [1e-2, 10.0] }

A list may hold any of the others.  Where a table of scenes has ``draws``, each scene takes one
entry of every list at random, else all combinations are taken, and nothing can be drawn.  Numbers
are floats, so that 1 and 1.0 are the same, but for those that have to be whole.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator

_FORMS = (
    "a number, a list, { from = A, to = B, count = N }, with spacing = \"log\" if wanted, "
    "{ uniform = [A, B] } or { log_uniform = [A, B] }"
)  # fmt: skip
_DRAWS = ("uniform", "log_uniform")
_MOST = 10_000  # numbers of a range


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
    def random(self) -> bool:
        """Whether some of them have to be drawn."""
        return any(isinstance(entry, Draw) for entry in self.entries)

    @property
    def highest(self) -> float:
        """The largest that there is, or may be drawn."""
        return max(entry.high if isinstance(entry, Draw) else entry for entry in self.entries)

    def fixed(self) -> list[float]:
        """The numbers, where none has to be drawn."""
        return [entry for entry in self.entries if not isinstance(entry, Draw)]

    def drawn(self, rng: np.random.Generator) -> float:
        """One of them, picked or drawn at random."""
        entry = self.entries[int(rng.integers(len(self.entries)))]
        return entry.value(rng) if isinstance(entry, Draw) else entry


def numbers(low: float, high: float = float("inf"), *, above: bool = False) -> Any:
    """The type of a key whose numbers lie between ``low`` and ``high``, or ``above`` low."""

    def check(raw: Any) -> Values:
        found = raw if isinstance(raw, Values) else Values(tuple(_entries(raw)))
        for entry in found.entries:
            ends = (entry.low, entry.high) if isinstance(entry, Draw) else (entry,)
            for value in ends:
                if not (low < value if above else low <= value) or not value <= high:
                    raise ValueError(f"{value:g} is out of range: {_allowed(low, high, above)}")
        return found

    return Annotated[Values, BeforeValidator(check)]


def whole_numbers(low: int, high: int) -> Any:
    """The same for numbers that must be whole, as those of slices; nothing can be drawn."""

    def check(raw: Any) -> Values:
        found = as_whole(Values(tuple(_entries(raw))), f" between {low} and {high}")
        for value in found.fixed():
            if not low <= value <= high:
                raise ValueError(f"{value:g} is not a whole number between {low} and {high}")
        return Values(tuple(sorted({*found.fixed()})))

    return Annotated[Values, BeforeValidator(check)]


def as_whole(values: Values, allowed: str = "") -> Values:
    """The same numbers as ints; nothing can be drawn."""
    if values.random:
        raise ValueError("cannot be drawn at random: give a number, a list or a range")
    for value in values.fixed():
        if value != int(value):
            raise ValueError(f"{value!r} is not a whole number{allowed}")
    return Values(tuple(int(value) for value in values.fixed()))


def _allowed(low: float, high: float, above: bool) -> str:
    least = f"above {low:g}" if above else f"at least {low:g}"
    return (
        f"it must be {least}" if high == float("inf") else f"it must be {least}, at most {high:g}"
    )


def _entries(raw: Any) -> list[float | Draw]:
    if isinstance(raw, list):
        if not raw:
            raise ValueError("an empty list: nothing would be run")
        return [entry for one in raw for entry in _entries(one)]
    if isinstance(raw, dict):
        return _from_table(raw)
    value = _finite(raw)
    if value is None:
        raise ValueError(f"{raw!r} is not a finite number: give {_FORMS}")
    return [value]


def _finite(raw: Any) -> float | None:
    """The number as a float; None of what is none, or too large for a float."""
    if isinstance(raw, bool) or not isinstance(raw, int | float):
        return None
    try:
        value = float(raw)
    except OverflowError:
        return None
    return value if math.isfinite(value) else None


def _from_table(raw: dict[str, Any]) -> list[float | Draw]:
    if len(raw) == 1 and next(iter(raw)) in _DRAWS:
        ((kind, ends),) = raw.items()
        pair = _pair(ends) if isinstance(ends, list) else None
        if pair is None or pair[0] >= pair[1] or (kind == "log_uniform" and pair[0] <= 0):
            positive = ", both positive" if kind == "log_uniform" else ""
            raise ValueError(f"{kind} takes two numbers that rise{positive}, not {ends!r}")
        return [Draw(*pair, kind == "log_uniform")]
    if not {"from", "to", "count"} <= set(raw) <= {"from", "to", "count", "spacing"}:
        raise ValueError(f"a table with the keys {', '.join(raw) or 'none'}: give {_FORMS}")
    ends, count = [raw["from"], raw["to"]], raw["count"]
    spacing = raw.get("spacing", "linear")
    if spacing not in ("linear", "log"):
        raise ValueError(f'spacing must be "linear" or "log", not {spacing!r}')
    if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= _MOST:
        raise ValueError(
            f"count must be a whole number of at least 1, at most {_MOST}, not {count!r}"
        )
    pair = _pair(ends)
    if pair is None or pair[0] > pair[1] or (spacing == "log" and pair[0] <= 0):
        positive = ", both positive" if spacing == "log" else ""
        raise ValueError(f"from and to must be numbers that rise{positive}, not {ends!r}")
    between = np.geomspace if spacing == "log" else np.linspace
    return [float(value) for value in between(*pair, count)]


def _pair(ends: list[Any]) -> tuple[float, float] | None:
    """The ends of a range, None where they are not two finite numbers."""
    found = [value for end in ends if (value := _finite(end)) is not None]
    return (found[0], found[1]) if len(found) == len(ends) == 2 else None
