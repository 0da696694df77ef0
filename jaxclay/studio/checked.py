"""Parts of a message from a page, which may be anything."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from jaxclay.files.profiles import Profile, read_profile

MOST_TEXT = 8 * 2**20
_MOST_POINTS = 4096  # of one message
Message = dict[str, Any]


def who(message: Any) -> tuple[str, int]:
    """The view and the number of a message, whatever it is."""
    found = message if isinstance(message, dict) else {}
    view: Any = found.get("view")
    number: Any = found.get("id")
    known = isinstance(number, int) and 0 <= number < 2**53
    return view[:64] if isinstance(view, str) else "", int(number) if known else 0


def text(message: Any, name: str, most: int) -> str:
    """A text that a message must have; raises ValueError."""
    value = message.get(name) if isinstance(message, dict) else None
    if not isinstance(value, str) or len(value) > most:
        raise ValueError(f"a message must have a {name} of at most {most} characters")
    return value


def number(message: Message, name: str, low: float, high: float) -> float:
    """A number within bounds that it must have; raises ValueError."""
    value: Any = message.get(name)
    if type(value) not in (int, float) or not low <= value <= high:
        raise ValueError(f"{name} must be a number from {low:g} to {high:g}")
    return float(value)


def pairs(buffers: list) -> list[tuple[float, float]]:
    """The places, (height, radius) over l, in its one buffer; raises ValueError."""
    data = bytes(buffers[0]) if buffers else b""
    if len(buffers) > 1 or len(data) % 8 or len(data) > 8 * _MOST_POINTS:
        raise ValueError(f"places of the tool are at most {_MOST_POINTS} pairs of float32")
    points = np.frombuffer(data, "<f4").reshape(-1, 2).astype(float)
    if not np.isfinite(points).all():
        raise ValueError("the tool goes along finite heights and radii")
    return [(float(height), float(radius)) for height, radius in points]


def profile_of(message: Message, buffers: list) -> Profile:
    """What is in a file of the user's, whose bytes are the one buffer."""
    data = bytes(buffers[0]) if len(buffers) == 1 else b""
    if not 0 < len(data) <= MOST_TEXT:
        raise ValueError(f"a profile is one file of 1 to {MOST_TEXT} bytes")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "profile.csv"
        path.write_bytes(data)
        try:
            return read_profile(path)
        except ValueError as error:
            raise ValueError(str(error).replace(str(path), "the file")) from None
