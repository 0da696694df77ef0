"""Largest distance from one polyline to another, for lines of many thousand points.

Contours rise from bottom to top, so that only segments at nearby heights can
be close to a point, and a bound on its distance says which those are.
"""

from __future__ import annotations

import numpy as np

from jaxclay.numerics.arrays import Array, Float, Int

_POINTS_PER_SEGMENT = 4
_STRIDES = (64, 8, 1)  # every so many points the distance is taken, where it may be largest
_ACROSS = _POINTS_PER_SEGMENT + 1
_PAIRS_AT_ONCE = 200_000


def farthest(line: Float[Array, "m 2"], other: Float[Array, "k 2"], limit: float = np.inf) -> float:
    """Largest distance from points along ``line`` (m, 2) to the polyline ``other`` (k, 2).

    Four points a segment are tried.  ``other`` must run from bottom to top: its
    second coordinate never falls.  Beyond the limit some distance of a point will do.
    """
    fraction = np.arange(_POINTS_PER_SEGMENT)[:, None, None] / _POINTS_PER_SEGMENT
    points = line[:-1] + fraction * np.diff(line, axis=0)
    points = np.concatenate([points.transpose(1, 0, 2).reshape(-1, 2), line[-1:]])
    # No point is farther away than the segment beside it or either end ...
    bound = _bound(points, other)
    # ... nor than a point before or after it and the way there: few points need a closer look.
    way = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    best = 0.0
    for stride in _STRIDES:
        if stride > 1 and stride**2 > len(points):
            continue
        some = np.append(np.arange(0, len(points) - 1, stride), len(points) - 1)
        some = some[bound[some] > best]
        if not len(some):
            continue
        exact = _nearest(points[some], other, bound[some])
        best = max(best, exact.max())
        if best > limit:
            break
        after = np.searchsorted(some, np.arange(len(points)))
        for j in (np.maximum(after - 1, 0), np.minimum(after, len(some) - 1)):
            bound = np.minimum(bound, exact[j] + np.abs(way - way[some[j]]))
    return float(best)


def nearest(points: Float[Array, "p 2"], other: Float[Array, "k 2"]) -> Float[Array, "p"]:
    """(p,) distance of each point (p, 2) to the polyline ``other`` (k, 2), which must not fall."""
    return _nearest(points, other, _bound(points, other))


def _bound(points: np.ndarray, other: np.ndarray) -> np.ndarray:
    last = len(other) - 2
    beside = np.clip(np.searchsorted(other[:, 1], points[:, 1]) - 1, 0, last)
    bound = distances(points, other, beside)
    # What lies across either end, as a foot and a lip do, is near the segment there.
    for part, segment in ((slice(_ACROSS), 0), (slice(-_ACROSS, None), last)):
        bound[part] = np.minimum(bound[part], distances(points[part], other, segment))
    return bound


def _nearest(points: np.ndarray, other: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Distance (p,) of points (p, 2) to a rising polyline no farther away than ``bound`` (p,)."""
    heights = other[:, 1]
    reach = bound * (1 + 1e-9) + 4 * np.spacing(heights[-1])
    low = np.searchsorted(heights[1:], points[:, 1] - reach, side="left")
    high = np.searchsorted(heights[:-1], points[:, 1] + reach, side="right")
    count = np.maximum(high - low, 1)
    low = np.minimum(low, len(other) - 2)
    nearest = np.empty(len(points))
    parts = np.cumsum(count) // _PAIRS_AT_ONCE
    for rows in np.split(np.arange(len(points)), np.flatnonzero(np.diff(parts)) + 1):
        begins = np.cumsum(count[rows]) - count[rows]
        owner = np.repeat(rows, count[rows])
        segment = np.arange(len(owner)) + np.repeat(low[rows] - begins, count[rows])
        nearest[rows] = np.minimum.reduceat(distances(points[owner], other, segment), begins)
    return nearest


def distances(
    points: Float[Array, "p 2"], line: Float[Array, "k 2"], segment: Int[Array, "p"] | int
) -> Float[Array, "p"]:
    """(p,) distance of each point (p, 2) to its segment of the polyline."""
    start = line[segment]
    (x, y), (along, up) = (points - start).T, (line[np.asarray(segment) + 1] - start).T
    share = np.clip((x * along + y * up) / np.maximum(along**2 + up**2, 1e-300), 0.0, 1.0)
    return np.sqrt((x - share * along) ** 2 + (y - share * up) ** 2)
