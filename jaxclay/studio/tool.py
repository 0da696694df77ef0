"""The pentagon: which clay its face reaches, and its way in equal steps of travel.

What a stroke does depends on the way alone and not on how often the pointer was sampled: squashes
are made wherever another step of the way is done, between two samples on the straight line.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.clay.contour import slice_points
from jaxclay.model.squash import Squash

STEP = 0.02  # of travel from squash to squash, over the unit l
_REACHED = 1e-4  # over l: clay less deep in the tool is not reached
_TOUCHES = 2e-3  # over l: clay so near to the face is held by it, where other clay is reached
_SLIVER = 0.01  # over l: clay lower than that below or above the tool goes with it
_ROUNDING = 1e-9  # of a step


class Place(NamedTuple):
    """Where the middle of the face is: its height, and its distance from the axis, length."""

    height: float
    radius: float


def contact(clay: Clay, place: Place, face: float) -> Squash | None:
    """The squash that a tool standing there makes; None where it reaches no clay.

    It holds the stretch of its face, ``face`` high, around where it is deepest in the clay; what
    stands off the face elsewhere is left alone.
    """
    unit, tall = float(clay.unit), float(clay.height)
    low, high = max(place.height - face / 2, 0.0), place.height + face / 2
    if high <= 0 or low >= tall:
        return None
    radii, heights = slice_points(clay).T
    inside = (heights > low) & (heights < high)
    y = np.concatenate([[low], heights[inside], [min(high, tall)]])
    ends = np.interp(y[[0, -1]], heights, radii)
    depth = np.concatenate([ends[:1], radii[inside], ends[1:]]) - place.radius
    deepest = int(np.argmax(depth))
    if depth[deepest] < _REACHED * unit:
        return None
    bottom, top = _around(y, depth + _TOUCHES * unit, deepest)
    sliver = _SLIVER * unit
    bottom = 0.0 if bottom < sliver else bottom
    if top > tall - sliver:  # all clay above the lower edge goes along the face
        rising = (1 - clay.material_at(bottom)) * float(clay.r0 / place.radius) ** 2
        top = max(high, bottom + float(rising) * (1 + _ROUNDING))
    return Squash(bottom, top, place.radius) if top > bottom else None


def is_near(clay: Clay, place: Place, face: float, within: float) -> bool:
    """Whether the face comes as near to clay as ``within``, over l, or reaches it."""
    near = max(place.radius - within * float(clay.unit), _REACHED * float(clay.unit))
    return contact(clay, place._replace(radius=near), face) is not None


def _around(y: np.ndarray, depth: np.ndarray, at: int) -> tuple[float, float]:
    """The heights between which the depth, positive ``at`` one of them, stays positive."""
    outside = np.flatnonzero(depth <= 0)
    below, above = outside[outside < at], outside[outside > at]
    low = _zero(y, depth, below[-1], below[-1] + 1) if len(below) else y[0]
    high = _zero(y, depth, above[0], above[0] - 1) if len(above) else y[-1]
    return float(low), float(high)


def _zero(y: np.ndarray, depth: np.ndarray, i: int, j: int) -> float:
    return float(y[i] + (y[j] - y[i]) * depth[i] / (depth[i] - depth[j]))


class Way:
    """The tool's way so far; lengths over l are measured along it.

    Attributes
    ----------
    place : Place
        Where it has come to.
    rest : float
        What it has gone since the last whole step, over l.
    """

    def __init__(self, place: Place, unit: float):
        self.place, self.rest, self._unit = place, 0.0, unit

    def to(self, place: Place) -> Iterator[Place]:
        """Go there straight; where whole steps end on the way."""
        start, self.place = self.place, place
        length = math.dist(start, place) / self._unit
        if length == 0:
            return
        gone = STEP - self.rest
        while gone <= length + _ROUNDING * STEP:
            share = gone / length
            yield Place(*(a + (b - a) * share for a, b in zip(start, place, strict=True)))
            gone += STEP
        self.rest = max(length - (gone - STEP), 0.0)

    @property
    def has_moved(self) -> bool:
        """Whether it has gone on since the last whole step."""
        return self.rest > 1e-6
