"""Numbers of an experiment file: one, a list, a range, or a random draw.

    0.3
    [0.2, 0.3]
    { from = 0.1, to = 0.4, count = 4 }
    { from = 1e-2, to = 1e2, count = 5, spacing = "log" }
    { uniform = [0.1, 0.4] }
    { log_uniform = [1e-2, 10.0] }

A list may hold any of the others.  Where a table of scenes has ``draws``, each scene takes one
entry of every list at random, else all combinations are taken, and nothing can be drawn.
"""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator

_FORMS = (
    "a number, a list, { from = A, to = B, count = N }, with spacing = \"log\" if wanted, "
    "{ uniform = [A, B] } or { log_uniform = [A, B] }"
)  # fmt: skip
_DRAWS = ("uniform", "log_uniform")


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
        found = Values(tuple(_entries(raw)))
        if found.random:
            raise ValueError("cannot be drawn at random: give a number, a list or a range")
        for value in found.fixed():
            if value != int(value) or not low <= value <= high:
                raise ValueError(f"{value:g} is not a whole number between {low} and {high}")
        return Values(tuple(sorted({int(value) for value in found.fixed()})))

    return Annotated[Values, BeforeValidator(check)]


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
    if isinstance(raw, bool) or not isinstance(raw, int | float) or not np.isfinite(raw):
        raise ValueError(f"{raw!r} is not a finite number: give {_FORMS}")
    return [raw]


def _from_table(raw: dict[str, Any]) -> list[float | Draw]:
    if len(raw) == 1 and next(iter(raw)) in _DRAWS:
        ((kind, ends),) = raw.items()
        if not _pair(ends) or ends[0] >= ends[1] or (kind == "log_uniform" and ends[0] <= 0):
            positive = ", both positive" if kind == "log_uniform" else ""
            raise ValueError(f"{kind} takes two numbers that rise{positive}, not {ends!r}")
        return [Draw(float(ends[0]), float(ends[1]), kind == "log_uniform")]
    if not {"from", "to", "count"} <= set(raw) <= {"from", "to", "count", "spacing"}:
        raise ValueError(f"a table with the keys {', '.join(raw) or 'none'}: give {_FORMS}")
    low, high, count = raw["from"], raw["to"], raw["count"]
    spacing = raw.get("spacing", "linear")
    if spacing not in ("linear", "log"):
        raise ValueError(f'spacing must be "linear" or "log", not {spacing!r}')
    if not isinstance(count, int) or isinstance(count, bool) or count < 1:
        raise ValueError(f"count must be a whole number of at least 1, not {count!r}")
    if not _pair([low, high]) or low > high or (spacing == "log" and low <= 0):
        positive = ", both positive" if spacing == "log" else ""
        raise ValueError(f"from and to must be numbers that rise{positive}: {low!r} and {high!r}")
    between = np.geomspace if spacing == "log" else np.linspace
    return [float(value) for value in between(low, high, count)]


def _pair(ends: Any) -> bool:
    """Whether these are two finite numbers."""
    numeric = isinstance(ends, list) and all(
        isinstance(end, int | float) and not isinstance(end, bool) for end in ends
    )
    return numeric and len(ends) == 2 and bool(np.isfinite(ends).all())
