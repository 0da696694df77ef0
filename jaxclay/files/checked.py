"""JSON from anybody: parsed without harm, and each value of the type that it must have.

Errors are ValueErrors of one line that name the place, what must be there and what is.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np

Raw = dict[str, Any]
_DIGITS = 20  # of whole numbers that stay whole


def parsed(text: str) -> Any:
    """The values of a text; a key that is there twice, NaN and deep nesting are refused."""
    try:
        return json.loads(text, object_pairs_hook=_once, parse_int=_whole, parse_constant=_no)
    except json.JSONDecodeError as error:
        line = f"line {error.lineno}, column {error.colno}"
        raise ValueError(f"no JSON, damaged or cut off: {error.msg}, {line}") from None
    except RecursionError:
        raise ValueError("brackets within brackets, too deep") from None


def _once(pairs: list[tuple[str, Any]]) -> Raw:
    found: Raw = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"the key {short(key)} is there twice")
        found[key] = value
    return found


def _whole(digits: str) -> int | float:
    return int(digits) if len(digits) < _DIGITS else float(digits)  # of any length, in no time


def _no(name: str) -> None:
    raise ValueError(f"{name} is no number that may stand there: all must be finite")


def as_object(value: Any, where: str, keys: tuple[str, ...], optional: tuple[str, ...] = ()) -> Raw:
    """The object, which has these keys and no others."""
    if not isinstance(value, dict):
        raise ValueError(f"{where} must be an object with the keys {', '.join(keys)}")
    for key in keys:
        if key not in value and key not in optional:
            raise ValueError(f"{where} has no key {key!r}: it needs {', '.join(keys)}")
    for key in value:
        if key not in keys:
            raise ValueError(f"{where} has an unknown key {short(key)}: {', '.join(keys)} are all")
    return value


def as_list(value: Any, where: str, most: int) -> list[Any]:
    """The list, of at most so many."""
    if not isinstance(value, list) or len(value) > most:
        raise ValueError(f"{where} must be a list of at most {most}, got {short(value)}")
    return value


def as_number(value: Any, where: str) -> float:
    """The finite number."""
    number = float(value) if type(value) in (int, float) else math.nan
    if not math.isfinite(number):
        raise ValueError(f"{where} must be a finite number, got {short(value)}")
    return number


def as_numbers(value: Any, where: str, most: int) -> np.ndarray:
    """(n,) finite numbers, at most so many."""
    values = enumerate(as_list(value, where, most))
    return np.array([as_number(one, f"{where}[{i}]") for i, one in values])


def as_pairs(value: Any, where: str, most: int) -> list[tuple[float, float]]:
    """Rows of two finite numbers, at most so many."""
    rows = []
    for i, row in enumerate(as_list(value, where, most)):
        if not isinstance(row, list) or len(row) != 2:
            raise ValueError(f"{where}[{i}] must be two numbers, got {short(row)}")
        rows.append((as_number(row[0], f"{where}[{i}][0]"), as_number(row[1], f"{where}[{i}][1]")))
    return rows


def short(value: Any) -> str:
    """Some of the value, whatever its size."""
    if isinstance(value, list | dict):
        return f"{'a list' if isinstance(value, list) else 'an object'} of {len(value)}"
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
