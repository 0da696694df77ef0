"""The outline as an SVG of cubic Bezier curves in millimetres, for drawing programs and cutters.

Each curve keeps the contour's end points and tangents; how far along the
tangents its inner control points lie follows from least squares across the
contour (P. J. Schneider, An Algorithm for Automatically Fitting Digitized
Curves, Graphics Gems, 1990).
"""

from __future__ import annotations

import os
from itertools import pairwise

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.clay.contour import check_rises
from jaxclay.files.replacing import replacing
from jaxclay.numerics.checks import check_positive

_FILL = "#E8D5C0"
_SAMPLES = 33  # places at which a curve is compared with the contour
_ROUNDS = 4  # of fitting the control points and then the places
_STIFFNESS = 1e-8  # keeps control points in place where the contour is straight, to 1e-4 radians
_FINEST = 1e-9  # tolerance over the height: rounding is not far below
_STRAIGHT_ON = 0.02  # radians that the tangent may turn at a node which is no corner
_SAME_RADIUS = 1e-9  # of the height


def save_svg(
    clay: Clay,
    path: str | os.PathLike,
    millimetres: float = 100.0,
    tolerance: float = 0.01,
) -> None:
    """Write a clay's closed outline, both halves, as one SVG path in millimetres.

    The file states how many curves it has and how far they are off.  What is drawn is the
    function through the clay's heights (:meth:`jaxclay.Clay.height_at`).  The file appears
    whole or not at all.

    Parameters
    ----------
    clay : Clay
        What is drawn.
    path : path
        The file to write.
    millimetres : float
        How many millimetres one unit of the clay's lengths is.
    tolerance : float, mm
        Largest distance between path and contour; at least 1e-9 of the height.

    Raises
    ------
    ValueError
        Millimetres or a tolerance that are not positive, a tolerance too fine, or a contour that
        does not rise.
    OSError
        The file cannot be written.
    """
    check_positive("millimetres", millimetres)
    check_positive("tolerance", tolerance)
    check_rises(clay)
    height = float(clay.height) * millimetres
    if tolerance < _FINEST * height:
        raise ValueError(
            f"tolerance is {tolerance:g} mm, but float64 resolves a piece {height:g} mm tall to "
            f"about {_FINEST * height:.1g} mm: ask for no less"
        )
    decimals = max(0, 2 - int(np.floor(np.log10(tolerance))))
    curves, error = [], 0.0
    for low, high in _between_corners(clay):
        for curve, off in _fitted(clay, low, high, millimetres, tolerance, decimals):
            curves.append(curve)
            error = max(error, off)
    nodes, places = clay.material, np.arange(_SAMPLES) / (_SAMPLES - 1)
    u = nodes[:-1, None] + np.diff(nodes)[:, None] * places
    half_width = _contour(clay, u)[0][0].max() * millimetres
    text = _document(np.array(curves), half_width, height, error, tolerance, decimals)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _between_corners(clay: Clay) -> list[tuple[float, float]]:
    """The stretches of u over which the contour and its tangent are continuous."""
    inner = clay.material[1:-1]
    (below, slope_below), (above, slope_above) = (
        _contour(clay, u) for u in (np.nextafter(inner, 0), inner)
    )
    cross = slope_below[0] * slope_above[1] - slope_below[1] * slope_above[0]
    turn = np.abs(cross) / (np.hypot(*slope_below) * np.hypot(*slope_above))
    jump = np.abs(above[0] - below[0]) > _SAME_RADIUS * clay.height
    ends = np.concatenate([[0.0], inner[jump | (turn > _STRAIGHT_ON)], [1.0]])
    return list(pairwise(ends))


def _fitted(clay, low, high, millimetres, tolerance, decimals):
    """Curves (4, 2) from u = low to high and how far each is off; halved until it is near."""
    u = np.linspace(low, high, _SAMPLES)
    u[-1] = np.nextafter(high, 0)  # the contour below, where it has a corner
    points, slopes = (v.T * millimetres for v in _contour(clay, u))
    curve, s = _fit(points, slopes * (high - low))
    curve = np.round(curve, decimals)
    error = float(np.hypot(*(_bezier(curve, s) - points).T).max())
    if error <= tolerance:
        return [(curve, error)]
    middle = (low + high) / 2
    rest = millimetres, tolerance, decimals
    return [*_fitted(clay, low, middle, *rest), *_fitted(clay, middle, high, *rest)]


def _fit(points: np.ndarray, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The curve (4, 2) along points (k, 2), and the s of its point beside each of them.

    ``slopes`` (k, 2) are the derivatives along the contour, over the whole of it.
    """
    start, end = points[0], points[-1]
    unit = slopes / np.hypot(*slopes.T)[:, None]
    normal = unit[:, ::-1] * [1, -1]
    reach = np.hypot(*slopes[[0, -1]].T) / 3
    s = np.linspace(0, 1, len(points))
    for _ in range(_ROUNDS):
        tangents = np.stack([3 * s * (1 - s) ** 2, -3 * s**2 * (1 - s)], axis=1)
        effect = tangents * (normal @ unit[[0, -1]].T)
        curve = np.stack([start, start + reach[0] * unit[0], end - reach[1] * unit[-1], end])
        off = np.sum(normal * (_bezier(curve, s) - points), axis=1)
        normal_equations = effect.T @ effect / len(s) + _STIFFNESS * np.eye(2)
        wanted = reach - np.linalg.solve(normal_equations, effect.T @ off / len(s))
        reach = np.clip(wanted, reach / 2, reach * 2)
        curve = np.stack([start, start + reach[0] * unit[0], end - reach[1] * unit[-1], end])
        for _ in range(2):
            along = 3 * _bezier(np.diff(curve, axis=0), s)
            behind = np.sum((points - _bezier(curve, s)) * along, axis=1)
            s = np.clip(s + behind / np.sum(along**2, axis=1), 0, 1)
    return curve, s


def _contour(clay: Clay, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(X, Y) and its derivative by u, each (2, k)."""
    Y, (Y_u, Y_uu, _) = clay.interpolant.height(u), clay.interpolant.derivatives(u)
    X = float(clay.r0) / np.sqrt(Y_u)
    return np.stack([X, Y]), np.stack([-X * Y_uu / (2 * Y_u), Y_u])


def _bezier(control: np.ndarray, s: np.ndarray) -> np.ndarray:
    """Points (k, 2) of a Bezier curve of any degree, control (d+1, 2)."""
    points = control[:, None]
    while len(points) > 1:
        points = (1 - s[:, None]) * points[:-1] + s[:, None] * points[1:]
    return points[0]


def _document(curves, half_width, height, error, tolerance, decimals) -> str:
    """The file: right half upwards, left half downwards, heights turned to point down."""
    right = curves * [1, -1] + [0, height]
    left = right[::-1, ::-1] * [-1, 1]

    def number(value: float) -> str:
        text = f"{value:.{decimals}f}"
        return text.rstrip("0").rstrip(".") if decimals else text

    def place(point: np.ndarray) -> str:
        return f"{number(point[0])},{number(point[1])}"

    path, at = f"M{place(right[0, 0])}", right[0, 0]
    for curve in [*right, *left]:
        if np.abs(curve[0] - at).max() > 1.5 * 10.0**-decimals:  # more than rounding apart
            path += f" L{place(curve[0])}"
        path += f" C{place(curve[1])} {place(curve[2])} {place(curve[3])}"
        at = curve[3]
    width, height = f"{2 * half_width:.9g}", f"{height:.9g}"
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}mm" height="{height}mm" '
        f'viewBox="{-half_width:.9g} 0 {width} {height}">\n'
        f"<desc>Outline of clay in millimetres, axis at x = 0: {len(curves)} cubic curves a side, "
        f"at most {error:.2g} mm from the contour ({tolerance:g} mm allowed).</desc>\n"
        f'<path fill="{_FILL}" d="{path} Z"/>\n</svg>\n'
    )
