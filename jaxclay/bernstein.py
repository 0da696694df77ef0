"""Piecewise polynomials of degree 5 in Bernstein form, for NumPy on the host and JAX when traced.

Y(u) is given by ``breaks`` (m+1,), which rise from 0 to 1, and ``control``
(m, 6): on [a, b] = [breaks[i], breaks[i+1]], with s = (u - a) / (b - a),

    Y(u) = sum_k control[i, k] binom(5, k) s^k (1 - s)^(5 - k).

Control values lie about where the curve runs, so they carry lengths, and the
polynomial stays between the least and the largest of them (G. Farin, Curves and
Surfaces for CAGD, ch. 5).  Pieces of no width may stand anywhere: they are never
evaluated.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay._host import is_concrete

Array = Any

DEGREE = 5
_BISECTIONS, _NEWTON_STEPS = 20, 5  # down to 1e-6 of a piece, then quadratically to rounding


def evaluate(breaks: Array, control: Array, u: Array, orders: int = 4) -> tuple[Array, ...]:
    """Y, Y_u, Y_uu and Y_uuu at u, the first ``orders`` of them, each of u's shape.

    At a break the values are those of the piece above it, at u = 1 of the last.
    """
    xp = np if is_concrete(breaks, control, u) else jnp
    u = xp.asarray(u)
    i = _piece_of(xp, breaks, u)
    width = breaks[i + 1] - breaks[i]
    return in_piece(control[i], width, (u - breaks[i]) / width, orders)


def in_piece(control: Array, width: Array, s: Array, orders: int = 4) -> tuple[Array, ...]:
    """The same for control (..., 6) and width (...) of one piece at its s (...) in [0, 1]."""
    c = [control[..., k] for k in range(DEGREE + 1)]
    values = [_casteljau(c, s)]
    scale = 1.0
    for order in range(1, orders):
        # Differences first: neighbours are alike, so that they are exact.
        c = [after - before for before, after in pairwise(c)]
        scale = scale * (DEGREE + 1 - order) / width
        values.append(_casteljau(c, s) * scale)
    return tuple(values)


def hermite(width: Array, start: tuple[Array, ...], end: tuple[Array, ...]) -> Array:
    """Control (..., 6) of the pieces with the given (Y, Y_u, Y_uu) at either end."""
    xp = np if is_concrete(width, start, end) else jnp
    (y0, d0, dd0), (y1, d1, dd1) = start, end
    below, above = y0 + width * d0 / 5, y1 - width * d1 / 5
    bend0, bend1 = width * width * dd0 / 20, width * width * dd1 / 20
    inner = below + width * d0 / 5 + bend0, above - width * d1 / 5 + bend1
    return xp.stack([y0, below, *inner, above, y1], axis=-1)


def heights_at_breaks(control: Array) -> Array:
    """Y at the breaks, (m+1,)."""
    xp = np if is_concrete(control) else jnp
    return xp.concatenate([control[:, 0], control[-1:, DEGREE]])


def solve(breaks: Array, control: Array, heights: Array) -> Array:
    """U of ``heights``' shape with Y(U) = heights, for an increasing Y and heights in its range.

    The last steps are Newton's, so that derivatives by JAX are those of the inverse.
    """
    xp = np if is_concrete(breaks, control, heights) else jnp
    heights = xp.asarray(heights)
    i = _piece_of(xp, heights_at_breaks(control), heights)
    width, c = breaks[i + 1] - breaks[i], control[i]

    def halve(_, bounds):
        low, high = bounds
        s = (low + high) / 2
        under = in_piece(c, width, s, 1)[0] < heights
        return xp.where(under, s, low), xp.where(under, high, s)

    def newton(_, s):
        y, slope = in_piece(c, width, s, 2)
        return xp.clip(s - (y - heights) / (slope * width), 0.0, 1.0)

    repeated = _repeated if xp is np else jax.lax.fori_loop
    bounds = repeated(0, _BISECTIONS, halve, (xp.zeros(heights.shape), xp.ones(heights.shape)))
    s = repeated(0, _NEWTON_STEPS, newton, (bounds[0] + bounds[1]) / 2)
    return xp.clip(breaks[i] + s * width, 0.0, 1.0)


def _repeated(start: int, stop: int, body, carry):
    """What ``jax.lax.fori_loop`` does, on the host."""
    for i in range(start, stop):
        carry = body(i, carry)
    return carry


def least_slope(breaks: np.ndarray, control: np.ndarray) -> tuple[float, float]:
    """A number that is positive only if Y_u is everywhere, and the u where it was met.

    It is the least Bernstein coefficient of Y_u, once pieces where one is not
    positive have been cut in halves until their coefficients or an end decide.
    """
    width = np.diff(breaks)
    filled = width > 0
    a, w = breaks[:-1][filled], width[filled]
    slope = DEGREE * np.diff(control[filled], axis=1) / w[:, None]
    least, place = np.inf, 0.0
    for _ in range(24):
        lowest = slope.min(axis=1)
        decided = (lowest > 0) | (slope[:, [0, -1]].min(axis=1) <= 0)
        if decided.any() and lowest[decided].min() < least:
            j = int(np.argmin(np.where(decided, lowest, np.inf)))
            least, place = float(lowest[j]), float(a[j] + w[j] * slope[j].argmin() / (DEGREE - 1))
        if decided.all() or least <= 0:
            return least, place
        a, w, slope = a[~decided], w[~decided] / 2, slope[~decided]
        slope = np.concatenate(_halves(slope))
        a, w = np.concatenate([a, a + w]), np.concatenate([w, w])
    return 0.0, float(a[0])


def _piece_of(xp, ends: Array, value: Array) -> Array:
    """Index of the piece of positive width whose ends hold ``value``."""
    below = {"method": "compare_all"} if xp is jnp else {}  # quick for a few dozen pieces
    i = xp.searchsorted(ends, value, side="right", **below) - 1
    last = xp.searchsorted(ends, ends[-1], side="left", **below) - 1
    return xp.clip(i, 0, last)


def _casteljau(c: list[Array], s: Array) -> Array:
    """The polynomial with Bernstein coefficients c at s."""
    while len(c) > 1:
        c = [(1 - s) * before + s * after for before, after in pairwise(c)]
    return c[0]


def _halves(c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bernstein coefficients (m, k) of the polynomials' lower and upper halves."""
    lower, upper = [c[:, 0]], [c[:, -1]]
    while c.shape[1] > 1:
        c = (c[:, :-1] + c[:, 1:]) / 2
        lower.append(c[:, 0])
        upper.append(c[:, -1])
    return np.stack(lower, axis=1), np.stack(upper[::-1], axis=1)
