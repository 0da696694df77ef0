"""Pieces to begin from, by name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.files.piece import Piece
from jaxclay.files.profiles import Profile, load_profile
from jaxclay.model.material import Material

_POINTS = 129


def _cone() -> Clay:
    """A cone without its tip, that stands on its wide end."""
    return Clay.from_profile([0.0, 1.0], [0.5, 0.18], slices=128)


def _ball() -> Clay:
    """A ball with a flat foot and top."""
    angle = np.linspace(0.86 * np.pi, 0.14 * np.pi, _POINTS)
    y = -np.cos(np.pi - angle)
    y, x = -y[::-1], np.sin(angle)[::-1]
    return Clay.from_profile(np.sort(y) * 0.55, x * 0.55, slices=256)


STARTS: dict[str, Callable[[], Clay]] = {
    "cylinder": lambda: Clay.cylinder(0.36, 1.0, slices=64),
    "cone": _cone,
    "ball": _ball,
    "teapot": lambda: load_profile("teapot"),
    "amphora": lambda: load_profile("amphora"),
}
"""Clay of its own length unit, by the start's name."""

MATERIAL = Material.from_snake_units(k=1.0, mu=0.1, alpha=1.0, beta=500.0)
"""Clay that gives way far, rounds what the tool leaves and stands by itself."""


def piece_of(profile: Profile) -> Piece:
    """The piece that a file is, or clay of its contour, standing at the file's own height."""
    if isinstance(profile.drawn, Piece):
        return profile.drawn
    clay = profile.cut().clay
    return Piece(clay, MATERIAL, base=profile.base, length_unit=profile.length_unit)
