"""Contours in space: the polyline that is drawn and exported, and distances between two.

Radii of slices belong to the middle of their slice; at Y_i, as eq. 20 writes
it, a cone's volume would be off by over a percent at 64 slices.  Beside them the
edges of tools are points, and both ends, extrapolated.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from jaxclay.numerics.arrays import Array, Bool, Float
from jaxclay.numerics.distance import farthest

_STEEPEST = 0.25  # of the last slice's radius: least radius of an end


class Piece(Protocol):
    """What has a contour: a Clay, whose attributes these are."""

    @property
    def heights(self) -> Float[Array, "n+1"]:
        """(n+1,) Y_i, length."""
        ...

    @property
    def thickness(self) -> Float[Array, "n"]:
        """(n,) t_i, length."""
        ...

    @property
    def unit(self) -> Float[Array, ""]:
        """l, length."""
        ...

    @property
    def material(self) -> Float[Array, "n+1"]:
        """(n+1,) u_i."""
        ...

    @property
    def edges(self) -> Float[Array, "m 2"]:
        """(m, 2) material and radius of edges."""
        ...

    @property
    def radii(self) -> Float[Array, "n"]:
        """(n,) X_i, length."""
        ...

    @property
    def slices(self) -> int:
        """n."""
        ...


def polyline(clay: Piece) -> Float[Array, "m 2"]:
    """(m, 2) points (radius, height) of the half-contour, from axis to axis, length.

    One point a slice and an edge, and two at each end.
    """
    points = slice_points(clay)
    (_, bottom), (_, top) = points[0], points[-1]
    return np.concatenate([[[0.0, bottom]], points, [[0.0, top]]])


def slice_points(clay: Piece) -> Float[Array, "m 2"]:
    """(m, 2) points (radius, height): slices' middles, edges and both ends, from bottom to top."""
    y, X, nodes = (np.asarray(v) for v in (clay.heights, clay.radii, clay.material))
    u, radius = np.asarray(clay.edges).T
    node = np.searchsorted(nodes, u)
    inner = (node > 0) & (node < clay.slices)
    middle = np.stack([X, (y[:-1] + y[1:]) / 2], axis=1)
    ends = []
    for end, (near, far) in ((0, middle[:2]), (clay.slices, middle[-1:-3:-1])):
        beyond = near[0] + (near[0] - far[0]) * (y[end] - near[1]) / (near[1] - far[1])
        # Not to the axis or beyond, where the slices' radii fall steeply.
        beyond = max(beyond, _STEEPEST * near[0])
        ends.append([*radius[node == end][:1], beyond][0])
    place = np.concatenate([[-1.0], np.arange(clay.slices) + 0.5, node[inner], [np.inf]])
    points = np.concatenate(
        [[[ends[0], y[0]]], middle, np.stack([radius, y[node]], axis=1)[inner], [[ends[1], y[-1]]]]
    )
    return points[np.argsort(place, kind="stable")]


def contour_error(clay: Piece, target: Piece) -> float:
    """Symmetric largest distance between two contours of eq. 1 (Hausdorff), over the target's l.

    Not a number where either has no contour: an answer that failed may have slices of no or of
    negative thickness.
    """
    return contour_error_upto(np.inf, clay, target)


def contour_error_upto(limit: float, clay: Piece, target: Piece) -> float:
    """The contour error where it is at most the limit, else some number between the two."""
    if not (rises(clay).all() and rises(target).all()):
        return float("nan")
    a, b, unit = polyline(clay), polyline(target), float(target.unit)
    error = farthest(a, b, limit * unit)
    if error <= limit * unit:
        error = max(error, farthest(b, a, limit * unit))
    return error / unit


def area_error(clay: Piece, target: Piece) -> float:
    """Area between the half-contours over the target's half-contour area.

    Not a number where either has no contour, as in :func:`contour_error`.
    """
    if not (rises(clay).all() and rises(target).all()):
        return float("nan")
    a, b = polyline(clay)[1:-1], polyline(target)[1:-1]
    heights = np.union1d(a[:, 1], b[:, 1])
    lower, upper = _within(a, heights) - _within(b, heights)
    # Twice the mean of a line's absolute value, less where it changes its sign on the way.
    twice = np.abs(lower) + np.abs(upper)
    crossing = 2 * np.minimum(lower * upper, 0.0) / np.where(twice > 0, twice, 1.0)
    between = np.sum(np.diff(heights) * (twice + crossing)) / 2
    return float(between / np.trapezoid(b[:, 0], b[:, 1]))


def _within(points: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """(2, m-1) radii at the lower and at the upper end of each interval between heights (m,).

    As seen from inside: where the radius jumps, intervals that meet have two.  0 above the top.
    """
    radius, y = points.T
    after = np.searchsorted(y, heights[:-1], side="right")
    there = after < len(y)
    j = np.where(there, after, len(y) - 1)
    slope = (radius[j] - radius[j - 1]) / np.where(there, y[j] - y[j - 1], 1.0)
    ends = np.stack([heights[:-1], heights[1:]])
    return np.where(there, radius[j - 1] + slope * (ends - y[j - 1]), 0.0)


def rises(clay: Piece) -> Bool[Array, "{clay.slices}"]:
    """(n,) whether heights rise over each slice."""
    thickness = np.asarray(clay.thickness)
    return (thickness > 0) & np.isfinite(thickness) & (np.diff(clay.heights) >= 0)


def check_rises(clay: Piece) -> None:
    """Raise unless the clay has a contour, as the answer of a solve that failed may not have."""
    rising = rises(clay)
    if not rising.all():
        i = int(np.argmin(rising))
        low, high = (float(y) for y in clay.heights[i : i + 2])
        raise ValueError(
            f"slice {i} does not rise: it lies between the heights {low:g} and {high:g}, of "
            f"thickness {float(clay.thickness[i]):g}, and an outline has to rise from slice to "
            "slice. Save only what a solve that converged has left (solution.raise_for_status())"
        )
