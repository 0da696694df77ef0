"""Units of length that files name."""

from __future__ import annotations

UNITS: dict[str, float | None] = {
    "mm": 1.0,
    "cm": 10.0,
    "dm": 100.0,
    "m": 1000.0,
    "um": 1e-3,
    "in": 25.4,
    "ft": 304.8,
    "px": None,
}
"""Millimetres in one unit, by the unit's name; None where an image alone knows."""

_OTHER_NAMES = {
    "millimeter": "mm", "millimetre": "mm", "centimeter": "cm", "centimetre": "cm",
    "meter": "m", "metre": "m", "decimeter": "dm", "decimetre": "dm",
    "micron": "um", "µm": "um", "μm": "um", "inch": "in", "inche": "in", "zoll": "in", '"': "in",
    "foot": "ft", "feet": "ft", "pixel": "px", "pix": "px",
}  # fmt: skip


def unit_named(text: str) -> str | None:
    """The unit of :data:`UNITS` that a word names, in any case, singular or plural; or None."""
    word = text.strip().strip(".").lower()
    for name in (word, word.removesuffix("s")):
        if name in UNITS:
            return name
        if name in _OTHER_NAMES:
            return _OTHER_NAMES[name]
    return None
