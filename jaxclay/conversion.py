"""From slices to a function Y(u) and back, each with the distance between the two contours.

Slices hold the averages g_i = t_i / h of Y_u over their share of u.  A function
through all Y_i has those averages, so that estimating Y_u and Y_uu where slices
meet is what finite-volume schemes do: fourth-order averages of the neighbours
(P. Colella, P. Woodward, J. Comput. Phys. 54, 1984), held back at extrema that
the neighbours' second differences do not carry (P. Colella, M. Sekora, J.
Comput. Phys. 227, 2008).
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxclay._host import is_concrete
from jaxclay.bernstein import hermite
from jaxclay.checks import check_positive, check_slices
from jaxclay.clay import Array, Clay
from jaxclay.contour import contour_error
from jaxclay.merging import merged
from jaxclay.smooth_clay import SmoothClay

_TINY = 1e-30  # against 0 / 0 in ratios of slopes
_STEEP = 3.0  # how much steeper than its difference a lone jump of Y_u is crossed
_CURVATURE = 1.25  # of the neighbours' second differences, which an extremum may show
_SHARE = 2.4  # of a slice's five slope coefficients, which sum to 5, one end may take


class Converted(NamedTuple):
    """Clay in its other form.

    Attributes
    ----------
    clay : Clay or SmoothClay
    error : float
        Largest distance between the two contours over l
        (:func:`jaxclay.contour_error`), the clay in slices taken as the polyline
        through its slices' middles.
    """

    clay: Clay | SmoothClay
    error: float


def as_function(clay: Clay, tolerance: float = 1e-6) -> Converted:
    """The function through all heights of the slices, in as few pieces as ``tolerance`` allows.

    Pieces are merged as long as the contour moves by no more than ``tolerance``
    (over l).  Slices of one thickness give one straight piece.

    Raises
    ------
    ValueError
        The tolerance is not positive.
    """
    check_positive("tolerance", tolerance)
    smooth = as_smooth(clay, tolerance)
    return Converted(smooth, contour_error(smooth, clay))


def as_smooth(clay: Clay, tolerance: float = 1e-6) -> SmoothClay:
    """The clay of :func:`as_function`, its error not measured; unequal slices are not merged."""
    if not clay.equal or len(clay.edges):
        return SmoothClay(*in_pieces(clay), float(clay.r0), float(clay.unit))
    n, r0, unit = clay.slices, float(clay.r0), float(clay.unit)
    breaks, _ = merged(*interpolated(clay.thickness, clay.heights), r0, unit, tolerance)
    # Second differences of the pieces' heights are rounding noise on fine grids; these are not.
    p, e = _node_slopes(np, clay.thickness)
    kept = np.rint(breaks * n).astype(int)
    values = np.stack([clay.heights, p, 4 * n * e])[:, kept]
    control = hermite(np.diff(breaks), tuple(values[:, :-1]), tuple(values[:, 1:]))
    return SmoothClay(breaks, control, r0, unit)


def in_pieces(clay: Clay) -> tuple[Array, Array]:
    """The cubic pieces between the clay's nodes, as breaks (n+1,) and control (n, 6)."""
    _, width, height, a, b, c = clay.interpolant.table
    top = clay.heights[1:]
    curvature = 2 * b / width, (2 * b + 6 * c) / width
    control = hermite(width, (height, a, curvature[0]), (top, a + 2 * b + 3 * c, curvature[1]))
    return clay.material, control


def cut(clay: Clay | SmoothClay, slices: int) -> Clay:
    """The clay in ``slices`` slices, itself if it is; heights are those of the function."""
    check_slices(slices)
    if isinstance(clay, Clay) and clay.slices == slices and clay.equal:
        return clay
    smooth = as_smooth(clay) if isinstance(clay, Clay) else clay
    heights = np.asarray(smooth.height_at(np.arange(slices + 1) / slices))
    return Clay(heights, np.diff(heights), smooth.r0, smooth.unit)


def sliced(smooth: SmoothClay, slices: int) -> Converted:
    """Clay of ``slices`` equal volumes whose heights are those of the function."""
    clay = cut(smooth, slices)
    return Converted(clay, contour_error(clay, smooth))


def interpolated(thickness: Array, heights: Array) -> tuple[Array, Array]:
    """One piece a slice, C^2 from piece to piece, through all heights: (breaks, control).

    Of order 4 in Y_u and 5 in Y where the slices are those of a smooth contour.
    Y_u is positive whatever the thicknesses.  Where Y_u jumps, a continuous Y_u
    with the slices' averages must overshoot: it does by about a tenth of the
    jump, in the two slices beside it.

    Parameters
    ----------
    thickness, heights : (n,), (n+1,) arrays
        t_i = Y_{i+1} - Y_i and Y_i, of any length unit; may be traced.

    Returns
    -------
    breaks, control : (n+1,), (n, 6) arrays
        As in :class:`jaxclay.SmoothClay`, unmerged.
    """
    xp = np if is_concrete(thickness, heights) else jnp
    n = thickness.shape[0]
    p, e = _node_slopes(xp, thickness)
    # Bernstein coefficients of Y_u on a slice; the middle one follows from its average.
    first, second, fourth, fifth = p[:-1], (p + e)[:-1], (p - e)[1:], p[1:]
    third = 5 * n * thickness - (first + second + fourth + fifth)
    y0, y1, step = heights[:-1], heights[1:], 1 / (5 * n)
    c1, c4 = y0 + step * first, y1 - step * fifth
    c2 = c1 + step * second
    control = xp.stack([y0, c1, c2, c2 + step * third, c4, y1], axis=1)
    return xp.arange(n + 1) / n, control


def _node_slopes(xp, thickness: Array) -> tuple[Array, Array]:
    """Y_u and h/4 Y_uu at the n+1 nodes."""
    n = thickness.shape[0]
    g = n * thickness
    below, above = _beyond(xp, g[:4]), _beyond(xp, g[: -5 if n > 4 else None : -1])
    g = xp.concatenate([xp.stack(below[::-1]), g, xp.stack(above)])
    return _kept_positive(xp, g, *_estimates(xp, g))


def _estimates(xp, g: Array) -> tuple[Array, Array]:
    """Y_u and h/4 Y_uu at n+1 nodes from the averages (n+4,) around them."""
    d = xp.diff(g)
    a, b, before, d, after = g[1:-2], g[2:-1], d[:-2], d[1:-1], d[2:]
    bend_a, bend_b = d - before, after - d
    bend = (bend_a + bend_b) / 2
    most = _CURVATURE * xp.minimum(xp.abs(bend_a), xp.abs(bend_b))
    held = xp.where(bend_a * bend_b > 0, xp.clip(bend, -most, most), 0.0)
    p = (a + b) / 2 - bend / 6
    p = xp.where((p - a) * (b - p) < 0, (a + b) / 2 - held / 6, p)
    # Order 4 takes a sixth of the excess of d over its neighbours; beside a jump none of it
    # may be taken, and at a lone jump several times as much keeps the overshoot smallest.
    excess, around = d - (before + after) / 2, xp.abs(before) + xp.abs(after)
    total = 2 * xp.abs(d) + around + _TINY
    rough = (2 * excess / total) ** 2
    lone = xp.maximum(2 * xp.abs(d) - around, 0.0) / total
    return p, (d + ((1 - rough) / 6 + rough * _STEEP * lone) * excess) / 4


def _kept_positive(xp, g: Array, p: Array, e: Array) -> tuple[Array, Array]:
    """(p, e), or as near to them as leaves every Bernstein coefficient of Y_u positive.

    A harmonic mean of the neighbours a, b satisfies all that must be asked of p, p + e and p - e
    for any a and b; a step from it towards the given values stops where one is broken.
    """
    a, b = g[1:-2], g[2:-1]
    low = 2 * a * b / (a + b)
    tilt = low * (b - a) / (a + b)
    step = xp.ones_like(low)
    for safe, wanted, least in (
        (low, p, 0.1 * low),
        (low + tilt, p + e, 0.1 * (low + tilt)),
        (low - tilt, p - e, 0.1 * (low - tilt)),
        (-2 * low - tilt, -2 * p - e, -_SHARE * b),
        (-2 * low + tilt, -2 * p + e, -_SHARE * a),
    ):
        fall = xp.where(wanted < least, safe - wanted, 1.0)
        step = xp.where(wanted < least, xp.minimum(step, (safe - least) / fall), step)
    return low + step * (p - low), tilt + step * (e - tilt)


def _beyond(xp, g: Array) -> tuple[Array, Array]:
    """The averages that go on before g[0] by a cubic, or flatter where g is not smooth; (2,)."""
    d1, d2 = g[1] - g[0], g[2] - g[1]
    d3 = g[3] - g[2] if g.shape[0] > 3 else 2 * d2 - d1
    total = xp.abs(d1) + 2 * xp.abs(d2) + xp.abs(d3) + _TINY
    rough = ((d1 - 2 * d2 + d3) / total) ** 2
    flat = xp.where(d1 * d2 > 0, xp.sign(d1) * xp.minimum(xp.abs(d1), xp.abs(d2)), 0.0)
    ghosts = []
    last, steps = g[0], (3 * d1 - 3 * d2 + d3, 6 * d1 - 8 * d2 + 3 * d3)
    for cubic in steps:
        last = xp.clip(last - (cubic + rough * (flat - cubic)), g[0] / 4, 4 * g[0])
        ghosts.append(last)
    return ghosts[0], ghosts[1]
