"""Contours in space: the polyline that is drawn and exported, and distances between two.

Radii belong to the middle of their slice; at Y_i, as eq. 20 writes it, a
cone's volume would be off by over a percent at 64 slices.
"""

from __future__ import annotations

import numpy as np

from jaxclay.clay import Clay

_POINTS_PER_SEGMENT = 4
_ROWS_AT_ONCE = 512


def polyline(clay: Clay) -> np.ndarray:
    """(n+4, 2) points (radius, height) of the half-contour, from axis to axis, length."""
    y, X = np.asarray(clay.heights), np.asarray(clay.radii)
    middle = np.stack([X, (y[:-1] + y[1:]) / 2], axis=1)
    bottom, top = [[0.0, y[0]], [X[0], y[0]]], [[X[-1], y[-1]], [0.0, y[-1]]]
    return np.concatenate([bottom, middle, top])


def contour_error(clay: Clay, target: Clay) -> float:
    """Symmetric largest distance between two contours (Hausdorff), over the target's l."""
    a, b = polyline(clay), polyline(target)
    return max(_farthest(a, b), _farthest(b, a)) / float(target.unit)


def area_error(clay: Clay, target: Clay) -> float:
    """Area between the half-contours over the target's half-contour area."""
    a, b = polyline(clay)[1:-1], polyline(target)[1:-1]
    heights = np.union1d(a[:, 1], b[:, 1])
    fine = np.union1d(heights, (heights[1:] + heights[:-1]) / 2)
    radius_a = np.interp(fine, a[:, 1], a[:, 0], right=0.0)
    radius_b = np.interp(fine, b[:, 1], b[:, 0], right=0.0)
    between = np.trapezoid(np.abs(radius_a - radius_b), fine)
    return float(between / np.trapezoid(b[:, 0], b[:, 1]))


def _farthest(line: np.ndarray, other: np.ndarray) -> float:
    """Largest distance from points along ``line`` to the polyline ``other``."""
    fraction = np.arange(_POINTS_PER_SEGMENT)[:, None, None] / _POINTS_PER_SEGMENT
    points = (line[:-1] + fraction * np.diff(line, axis=0)).reshape(-1, 2)
    points = np.concatenate([points, line[-1:]])
    start, along = other[:-1], np.diff(other, axis=0)
    squared = np.maximum((along**2).sum(axis=1), 1e-300)
    farthest = 0.0
    for rows in np.array_split(points, -(-len(points) // _ROWS_AT_ONCE)):
        offset = rows[:, None] - start
        place = np.clip((offset * along).sum(axis=2) / squared, 0, 1)
        distance = np.linalg.norm(offset - place[..., None] * along, axis=2)
        farthest = max(farthest, distance.min(axis=1).max())
    return float(farthest)
