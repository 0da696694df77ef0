"""Slicing of an outline: stacked cone frusta, cut where their volume or their shape says."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from jaxclay.numerics.arrays import Array, Float
from jaxclay.numerics.distance import nearest

_FEWEST, _MOST = 64, 16_384  # slices
_STEP = 1e-12  # of the height: radii that are no farther apart are those of a step
_SAMPLES = 4  # points of the outline in a slice, where its distance is taken
_THINNEST = 1e-9  # of the height: slices below it are not halved


def volume_below(y: Float[Array, "m"], radii: Float[Array, "m"]) -> Float[Array, "m"]:
    """(m,) volume over pi below each of the points of a stack of frusta."""
    ra, dr = radii[:-1], np.diff(radii)
    return np.append(0.0, np.cumsum(np.diff(y) * (ra * ra + ra * dr + dr * dr / 3)))


def equal_volume_heights(
    y: Float[Array, "m"], radii: Float[Array, "m"], slices: int
) -> Float[Array, "{slices}+1"]:
    """Heights (slices+1,) that cut the frusta through (y, radii) into equal volumes."""
    ra, dr, dy = radii[:-1], np.diff(radii), np.diff(y)
    below = volume_below(y, radii)
    wanted = below[-1] * np.arange(1, slices) / slices
    j = np.clip(np.searchsorted(below, wanted, side="right") - 1, 0, len(dy) - 1)
    rest, a, d = (wanted - below[j]) / dy[j], ra[j], dr[j]
    low, high = np.zeros(slices - 1), np.ones(slices - 1)
    for _ in range(60):  # bisection of a monotone cubic: exact to rounding for any frustum
        s = (low + high) / 2
        under = s * (a * a + s * d * (a + s * d / 3)) < rest
        low, high = np.where(under, s, low), np.where(under, high, s)
    return np.concatenate([[0.0], y[j] + (low + high) / 2 * dy[j], [y[-1]]])


def cut_near(
    y: Float[Array, "m"], radii: Float[Array, "m"], near: float, contour: Callable
) -> tuple[Array, Array, Array]:
    """Slices whose contour is within a distance of the outline, halved only where they must be.

    Parameters
    ----------
    y, radii : (m,) arrays, length
        The outline, from height 0; a height that is there twice is a step.
    near : float
        Length.
    contour : (heights, nodes, edges) -> (k, 2) points (radius, height)
        The contour of slices.

    Returns
    -------
    heights, nodes : (n+1,) arrays
        64 slices of equal volume, cut at steps, and halved until the contour is near, or there
        are 16,384.
    edges : (2 s, 2) array
        (u, radius) below and above each step.
    """
    below = volume_below(y, radii)
    steps = np.flatnonzero(np.diff(y) <= _STEP * y[-1])
    at = below[steps] / below[-1]
    edges = np.stack([np.repeat(at, 2), radii[np.stack([steps, steps + 1], axis=1)].ravel()], 1)
    heights = equal_volume_heights(y, radii, _FEWEST)
    nodes = np.arange(_FEWEST + 1) / _FEWEST
    # A node next to a step gives way to it.
    away = (np.abs(nodes[:, None] - at) > 0.25 / _FEWEST).all(axis=1) | np.isin(nodes, (0.0, 1.0))
    nodes, first = np.unique(np.append(nodes[away], at), return_index=True)
    heights = np.append(heights[away], y[steps])[first]
    outline = np.stack([radii, y], axis=1)
    while True:
        far = _farthest_of_slices(outline, contour(heights, nodes, edges), heights)
        halved = (far > near) & (np.diff(heights) > _THINNEST * y[-1])
        if not halved.any() or len(nodes) + halved.sum() > _MOST:
            return heights, nodes, edges
        middle = (heights[:-1] + heights[1:])[halved] / 2
        heights, order = np.unique(np.append(heights, middle), return_index=True)
        nodes = np.append(nodes, _shares(y, radii, below, middle))[order]


def _shares(y: np.ndarray, radii: np.ndarray, below: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The share of the volume below heights that are inside frusta."""
    j = np.searchsorted(y, at, side="right") - 1
    part = at - y[j]
    a, d = radii[j], (radii[j + 1] - radii[j]) * (part / (y[j + 1] - y[j]))
    return (below[j] + part * (a * a + a * d + d * d / 3)) / below[-1]


def _farthest_of_slices(outline: np.ndarray, contour: np.ndarray, heights: np.ndarray):
    """(n,) how far the outline and the contour are from each other beside each slice."""
    r, y = outline.T
    share = np.arange(1, _SAMPLES + 1) / (_SAMPLES + 1)
    inner = (heights[:-1, None] + np.diff(heights)[:, None] * share).ravel()
    points = np.concatenate([outline, np.stack([np.interp(inner, y, r), inner], axis=1)])
    far = np.zeros(len(heights) - 1)
    for line, other in ((points, contour), (contour, outline)):
        distance = nearest(line, other)
        for side in ("left", "right"):  # at a node both slices are meant
            i = np.clip(np.searchsorted(heights, line[:, 1], side=side) - 1, 0, len(far) - 1)
            np.maximum.at(far, i, distance)
    return far
