"""Equal-volume slicing of a measured profile: stacked cone frusta cut where their volume says."""

from __future__ import annotations

import numpy as np

from jaxclay.numerics.arrays import Array, Float
from jaxclay.numerics.checks import check_positive


def clip_radii(radii: Float[Array, "m"], minimum: float | None) -> Float[Array, "m"]:
    """The radii, raised to ``minimum`` if given; an error names the first that is no radius."""
    if minimum is not None:
        check_positive("minimum_radius", minimum)
        lowest = 0.0
        good = np.isfinite(radii) & (radii >= 0)
    else:
        good = np.isfinite(radii) & (radii > 0)
        lowest = None
    if not good.all():
        i = int(np.argmin(good))
        hint = "" if lowest is not None or radii[i] != 0 else "; minimum_radius clips a pointed tip"
        raise ValueError(f"radii[{i}] is {radii[i]:g}, but radii must be positive and finite{hint}")
    return radii if minimum is None else np.maximum(radii, minimum)


def equal_volume_heights(
    y: Float[Array, "m"], radii: Float[Array, "m"], slices: int
) -> Float[Array, "{slices}+1"]:
    """Heights (slices+1,) that cut the frusta through (y, radii) into equal volumes."""
    ra, dr, dy = radii[:-1], np.diff(radii), np.diff(y)
    volume = dy * (ra * ra + ra * dr + dr * dr / 3)
    below = np.concatenate([[0.0], np.cumsum(volume)])
    wanted = below[-1] * np.arange(1, slices) / slices
    j = np.clip(np.searchsorted(below, wanted, side="right") - 1, 0, len(dy) - 1)
    rest, a, d = (wanted - below[j]) / dy[j], ra[j], dr[j]
    low, high = np.zeros(slices - 1), np.ones(slices - 1)
    for _ in range(60):  # bisection of a monotone cubic: exact to rounding for any frustum
        s = (low + high) / 2
        under = s * (a * a + s * d * (a + s * d / 3)) < rest
        low, high = np.where(under, s, low), np.where(under, high, s)
    return np.concatenate([[0.0], y[j] + (low + high) / 2 * dy[j], [y[-1]]])
