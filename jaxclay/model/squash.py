"""Squash: what the tool demands of the contour (eqs. 10, 11)."""

from __future__ import annotations

import dataclasses

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.checks import as_number, check_positive
from jaxclay.numerics.host import is_concrete, pytree


@pytree
@dataclasses.dataclass(frozen=True)
class Squash:
    """After it the contour has ``radius`` between the heights ``bottom`` and ``top``.

    Attributes
    ----------
    bottom, top : float, length (the clay's)
        0 <= bottom < top.  bottom = 0 is the paper's case; above 0 the clay is
        pushed both ways (or drawn in from both).
    radius : float > 0, length
        x0 of eq. 10.
    top_fixed : bool
        Whether the clay's upper end is held at its height (Case III).

    Raises
    ------
    ValueError
        An empty band, a negative bottom, a radius that is not positive.
    """

    bottom: Array
    top: Array
    radius: Array
    top_fixed: Array = False

    def __post_init__(self):
        if not is_concrete(self):
            return
        check_positive("radius", self.radius)
        if np.asarray(self.top_fixed).dtype != bool:
            raise ValueError(f"top_fixed must be True or False, got {self.top_fixed!r}")
        bottom, top = as_number("bottom", self.bottom), as_number("top", self.top)
        if not (bottom >= 0 and np.isfinite(bottom)):
            raise ValueError(f"bottom must be finite and at least 0, got {bottom:g}")
        if not (top > bottom and np.isfinite(top)):
            raise ValueError(
                f"the band is empty: top must be finite and above bottom = {bottom:g}, got {top:g}"
            )


def check_fits(squash: Squash, clay: Clay) -> None:
    """Raise where the squash asks of this clay what no shape can give."""
    bottom, top, radius = float(squash.bottom), float(squash.top), float(squash.radius)
    height = float(clay.height)
    if bottom >= height:
        raise ValueError(
            f"the band starts at bottom = {bottom:g}, above the clay: bottom must be below its "
            f"height {height:g}"
        )
    share = radius**2 * (top - bottom) / float(clay.r0) ** 2  # w of model, eq. 11
    if squash.top_fixed and top >= height:
        raise ValueError(
            f"the upper end is held at {height:g}, which leaves no room above top = {top:g}: "
            f"top must be below {height:g}, or top_fixed False"
        )
    if squash.top_fixed and share >= 1:
        widest = float(clay.r0) / (top - bottom) ** 0.5
        raise ValueError(
            f"the upper end is held, but a band of radius {radius:g} takes all the clay and leaves "
            f"no room: radius must be below {widest:g} for this band, or top_fixed False"
        )
