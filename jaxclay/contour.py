"""Contours in space: the polyline that is drawn and exported, and distances between two.

Radii of slices belong to the middle of their slice; at Y_i, as eq. 20 writes
it, a cone's volume would be off by over a percent at 64 slices.  Beside them the
edges of tools are points, and both ends, extrapolated.  The contour of a
function Y(u) is (X, Y) itself, by chords as near to it as asked.
"""

from __future__ import annotations

import numpy as np

from jaxclay.bernstein import in_piece
from jaxclay.clay import Clay
from jaxclay.distance import distances, farthest
from jaxclay.smooth_clay import SmoothClay

_CHORD = 1e-8  # of l
_MOST_POINTS = 20_000
_PROBES = 49  # places in a piece where its curvature is looked at
_EVENNESS = 0.1  # least density of points, of the piece's greatest
_SAFETY = 1.1
_SAME_RADIUS = 1e-10  # of l
_STEEPEST = 0.25  # of the last slice's radius: least radius of an end


def polyline(clay: Clay | SmoothClay, chord: float = _CHORD) -> np.ndarray:
    """(m, 2) points (radius, height) of the half-contour, from axis to axis, length.

    Of clay in slices one point a slice and an edge, and two at each end.  Of a function
    as many, up to 20,000, as put its chords within ``chord`` times l of the contour; where
    the radius jumps, both radii are there.
    """
    points = _curve(clay, chord) if isinstance(clay, SmoothClay) else slice_points(clay)
    (_, bottom), (_, top) = points[0], points[-1]
    return np.concatenate([[[0.0, bottom]], points, [[0.0, top]]])


def slice_points(clay: Clay) -> np.ndarray:
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


def contour_error(clay: Clay | SmoothClay, target: Clay | SmoothClay) -> float:
    """Symmetric largest distance between two contours of eq. 1 (Hausdorff), over the target's l.

    Not a number where either has no contour: an answer that failed may have slices of no or of
    negative thickness.
    """
    if not (_rises(clay) and _rises(target)):
        return float("nan")
    a, b = polyline(clay), polyline(target)
    return max(farthest(a, b), farthest(b, a)) / float(target.unit)


def area_error(clay: Clay | SmoothClay, target: Clay | SmoothClay) -> float:
    """Area between the half-contours over the target's half-contour area.

    Not a number where either has no contour, as in :func:`contour_error`.
    """
    if not (_rises(clay) and _rises(target)):
        return float("nan")
    a, b = polyline(clay)[1:-1], polyline(target)[1:-1]
    heights = np.union1d(a[:, 1], b[:, 1])
    fine = np.union1d(heights, (heights[1:] + heights[:-1]) / 2)
    radius_a = np.interp(fine, a[:, 1], a[:, 0], right=0.0)
    radius_b = np.interp(fine, b[:, 1], b[:, 0], right=0.0)
    between = np.trapezoid(np.abs(radius_a - radius_b), fine)
    return float(between / np.trapezoid(b[:, 0], b[:, 1]))


def _rises(clay: Clay | SmoothClay) -> bool:
    """Whether heights rise from bottom to top, for a function at all probes."""
    if not isinstance(clay, SmoothClay):
        return bool((np.asarray(clay.thickness) > 0).all())
    width = np.diff(clay.breaks)
    filled = width > 0
    slope = in_piece(clay.control[filled][:, None], width[filled][:, None], _probes())[1]
    return bool((np.asarray(slope) > 0).all())


def _probes() -> np.ndarray:
    """Places in a piece, from 0 to 1, closer at its ends, where tips are sharpest."""
    return (1 - np.cos(np.linspace(0, np.pi, _PROBES))) / 2


def contour_derivatives(clay: SmoothClay, control, width, s) -> tuple[np.ndarray, ...]:
    """(X, Y), (X, Y)_u and (X, Y)_uu on pieces of the clay at their s, each (2, ...)."""
    Y, Y_u, Y_uu, Y_uuu = in_piece(control, width, s)
    X = float(clay.r0) / np.sqrt(Y_u)
    bend = Y_uu / Y_u
    X_u, X_uu = -X * bend / 2, X * (0.75 * bend**2 - Y_uuu / (2 * Y_u))
    return np.stack([X, Y]), np.stack([X_u, Y_u]), np.stack([X_uu, Y_uu])


def _curve(clay: SmoothClay, chord: float) -> np.ndarray:
    """(m, 2) points from (X, Y)(0) to (X, Y)(1) with chords within ``chord`` l of the curve."""
    width = np.diff(clay.breaks)
    control, width = clay.control[width > 0], width[width > 0]
    chord = chord * float(clay.unit)
    owner, s = _places(clay, control, width, chord)
    while True:
        points = contour_derivatives(clay, control[owner], width[owner], s)[0].T
        # A tip may hide between probes: look at the middle of each chord.
        first = np.flatnonzero(owner[1:] == owner[:-1])
        i, middle = owner[first], (s[first] + s[first + 1]) / 2
        between = contour_derivatives(clay, control[i], width[i], middle)[0].T
        far = distances(between, points, first) > chord
        split = np.flatnonzero(far)[: max(_MOST_POINTS - len(s), 0)]
        if not len(split):
            break
        s = np.insert(s, first[split] + 1, middle[split])
        owner = np.insert(owner, first[split] + 1, i[split])
    same = np.abs(np.diff(points[:, 0])) <= _SAME_RADIUS * clay.unit
    return points[np.append(True, ~(same & (np.diff(owner) > 0)))]


def _places(clay: SmoothClay, control, width, chord: float) -> tuple[np.ndarray, np.ndarray]:
    """Piece and s in it of each point: a chord over ds is |normal part of P_ss| ds^2 / 8 away."""
    probes = _probes()
    _, P_u, P_uu = contour_derivatives(clay, control[:, None], width[:, None], probes)
    normal = np.abs(P_u[0] * P_uu[1] - P_u[1] * P_uu[0]) / np.hypot(*P_u)
    density = width[:, None] * np.sqrt(normal / (8 * chord))
    density = np.maximum(density, _EVENNESS * density.max(axis=1, keepdims=True))
    steps = np.maximum(density[:, 1:], density[:, :-1]) * np.diff(probes)
    below = np.concatenate([np.zeros((len(width), 1)), np.cumsum(steps, axis=1)], axis=1)
    share = min(1.0, (_MOST_POINTS - 2 * len(width)) / (_SAFETY * below[:, -1].sum() + 1e-300))
    chords = np.maximum(np.ceil(share * _SAFETY * below[:, -1]).astype(int), 1)
    place = [
        np.interp(np.linspace(0, b[-1], n + 1), b, probes) if n > 1 else np.array([0.0, 1.0])
        for n, b in zip(chords, below, strict=True)
    ]
    return np.repeat(np.arange(len(width)), chords + 1), np.concatenate(place)
