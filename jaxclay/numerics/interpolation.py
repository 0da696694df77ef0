"""Y(u) between the nodes: cubic pieces through all heights, rising everywhere.

The nodes u_i are where they are, so every rising function through the heights keeps the volume
of every slice.  Slopes Y_u at the nodes are those of the quartic through the five nodes nearest,
of order 4, taken from one side only where a band's edge is a node: there the contour's third
derivative jumps, or its radius, which an edge knows.  Each slope is kept between fixed multiples
of the slices' own, beside which a cubic piece rises (F. Fritsch, R. Carlson, SIAM J. Numer.
Anal. 17, 1980).  All of it is local: where nodes and heights stay, so does the function, bit
for bit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxclay.numerics.arrays import Array, Bool, Float, Int, Scalar, fixed, namespace, pick

_NEIGHBOURS = 5  # nodes that a slope is taken from
_LEAST, _MOST = 0.05, 2.5  # of a slice's own slope: what a cubic piece may have at its ends
_CUTS = 64  # of a piece, and of one of those, for the inverse before Newton's steps


class Interpolant(NamedTuple):
    """Y(u) in cubic pieces, Y_i + width (a s + b s^2 + c s^3) with s from 0 to 1 in each.

    Attributes
    ----------
    nodes, heights : (n+1,) arrays
    thickness : (n,) array
        Differences of the heights, held apart from them.
    table : (6, n) array
        Of each piece its lower node, width, Y_i, a, b and c.
    """

    nodes: Float[Array, "n+1"]
    heights: Float[Array, "n+1"]
    thickness: Float[Array, "n"]
    table: Float[Array, "6 n"]

    def over(self, unit: Scalar) -> Interpolant:
        """Y(u) / unit."""
        xp = namespace(self, unit)
        one = xp.ones(2)
        scale = xp.concatenate([one, xp.ones(4) / unit])
        return Interpolant(
            self.nodes, self.heights / unit, self.thickness / unit, self.table * scale[:, None]
        )

    @property
    def steepest(self) -> Float[Array, ""]:
        """The largest Y_u at the ends of pieces."""
        _, _, _, a, b, c = self.table
        return namespace(self).maximum(a.max(), (a + 2 * b + 3 * c).max())

    def piece(self, u: Float[Array, "*at"] | Scalar) -> Int[Array, "*at"]:
        """The piece that holds each u, the upper one at a node."""
        return last_before(namespace(self, u), self.nodes[1:-1], u)

    def height(self, u: Float[Array, "*at"] | Scalar) -> Float[Array, "*at"]:
        """Y(u); at a node its height bit for bit."""
        xp = namespace(self, u)
        i = self.piece(u)
        piece = pick(self.table, i)
        s = (u - piece[0]) / piece[1]
        return xp.where(s < 1, piece[2] + _above(piece, s), pick(self.heights, i + 1))

    def slope(self, u: Float[Array, "*at"] | Scalar, side: str = "above") -> Float[Array, "*at"]:
        """Y_u(u), where it jumps the value on that side."""
        return _slope(*self._seen(u, side))

    def derivatives(
        self, u: Float[Array, "*at"] | Scalar, side: str = "above"
    ) -> tuple[Float[Array, "*at"], Float[Array, "*at"], Float[Array, "*at"]]:
        """Y_u, Y_uu and Y_uuu at u, where they jump the values on that side."""
        piece, s = self._seen(u, side)
        _, width, _, _, b, c = piece
        return _slope(piece, s), (2 * b + 6 * c * s) / width, 6 * c / width**2

    def _seen(self, u: Array, side: str) -> tuple[Array, Array]:
        """The piece on that side of u, and the place in it from 0 to 1."""
        xp = namespace(self, u)
        i = self.piece(u)
        if side == "below":
            i = xp.where((i > 0) & (u == pick(self.nodes, i)), i - 1, i)
        piece = pick(self.table, i)
        return piece, (u - piece[0]) / piece[1]

    def inverse(self, height: Float[Array, "*at"] | Scalar) -> Float[Array, "*at"]:
        """U(y), the u with Y(u) = y, for heights from Y(0) to Y(1)."""
        xp = namespace(self, height)
        piece = pick(self.table, last_before(xp, self.heights[1:-1], height))
        wanted = height - piece[2]

        def newton(s):
            return s - (_above(piece, s) - wanted) / (piece[1] * _slope(piece, s))

        # Monotone: all places below the root, in a piece cut twice, are counted at once.
        low = 0.0 * wanted
        for cut in (_CUTS, _CUTS**2):
            places = fixed(low)[..., None] + xp.arange(_CUTS) / cut
            under = _above(fixed(piece)[..., None], places) < fixed(wanted)[..., None]
            low = low + xp.maximum(under.sum(axis=-1) - 1, 0) / cut
        # One step makes it exact, two carry the derivatives of the inverse, up to the third.
        s = fixed(newton(fixed(xp.where(wanted > 0, low + 0.5 / _CUTS**2, 0.0))))
        s = newton(newton(s))
        s = xp.where(wanted > 0, xp.clip(s, 0.0, 1.0), 0.0)
        return piece[0] + s * piece[1]

    def on(self, u: Float[Array, "m"]) -> tuple[Float[Array, "m"], Float[Array, "m-1"]]:
        """Y at rising u (m,), and how far it rises between them (m-1,).

        At nodes both are the heights and thicknesses there bit for bit, and nothing is cancelled
        where two places lie in one piece.
        """
        xp = namespace(self, u)
        i = self.piece(u)
        piece = pick(self.table, i)
        s = (u - piece[0]) / piece[1]
        above = _above(piece, s)
        heights = xp.where(s < 1, piece[2] + above, pick(self.heights, i + 1))
        i, s, (start, width, _, a, b, c) = i[:-1], s[:-1], piece[:, :-1]
        low, high = u[:-1], u[1:]
        t = (high - start) / width
        one = (high - low) * (a + b * (s + t) + c * (s * s + s * t + t * t))
        rise = xp.where(t < 1, one, heights[1:] - heights[:-1])
        to_end = pick(self.thickness, i) - above[:-1]
        return heights, xp.where(high == pick(self.nodes, i + 1), to_end, rise)


def _above(piece: Array, s: Array) -> Array:
    """Y less the height of the piece's lower end."""
    _, width, _, a, b, c = piece
    return width * (s * (a + s * (b + s * c)))


def _slope(piece: Array, s: Array) -> Array:
    *_, a, b, c = piece
    return a + s * (2 * b + 3 * c * s)


def are_nodes(nodes: Float[Array, "nodes"], u: Float[Array, "m"]) -> Bool[Array, "m"]:
    """(m,) whether each u is one of the rising nodes, on the host."""
    return nodes[np.minimum(np.searchsorted(nodes, u), len(nodes) - 1)] == u


def last_before(xp, inner: Array, value: Array) -> Array:
    """How many of the inner nodes lie at or below each value: the piece that holds it."""
    if xp is np:
        return np.searchsorted(inner, value, side="right")
    return xp.sum(inner <= xp.asarray(value)[..., None], axis=-1)


def interpolant(
    nodes: Float[Array, "nodes"],
    heights: Float[Array, "nodes"],
    thickness: Float[Array, "nodes-1"],
    edges: Float[Array, "m 2"],
    r0: Scalar,
) -> Interpolant:
    """Y(u) through the heights of the nodes.

    Parameters
    ----------
    nodes, heights : (n+1,) arrays
        u_i and Y_i.
    thickness : (n,) array
        Y_{i+1} - Y_i.
    edges : (m, 2) array
        (u, radius) of band edges; those that are nodes break the function.  Two rows of one u
        are the radii below and above it.
    r0 : scalar
        sqrt(volume / pi).
    """
    xp = namespace(nodes, heights, thickness, edges, r0)
    mean = thickness / xp.diff(nodes)
    if edges.shape[0] == 0:
        start, stop = _ends(nodes, heights, None)
    else:
        at = nodes[:, None] == edges[:, 0]
        broken = at.any(axis=1)
        first, last = xp.argmax(at, axis=1), edges.shape[0] - 1 - xp.argmax(at[:, ::-1], axis=1)
        start, stop = _ends(nodes, heights, broken)
        start = xp.where(broken[:-1], ((r0 / edges[last, 1]) ** 2)[:-1], start)
        stop = xp.where(broken[1:], ((r0 / edges[first, 1]) ** 2)[1:], stop)
    least, most = _LEAST * mean, _MOST * mean
    start, stop = xp.clip(start, least, most), xp.clip(stop, least, most)
    return _cubics(nodes, heights, thickness, start, stop)


def displacement(
    nodes: Float[Array, "nodes"],
    shift: Float[Array, "nodes"],
    change: Float[Array, "nodes-1"],
    broken: Bool[Array, "nodes"],
) -> Interpolant:
    """The same through displacements (n+1,), ``change`` (n,) their differences, rising or not.

    Broken at nodes where the (n+1,) bool array says so.
    """
    return _cubics(nodes, shift, change, *_ends(nodes, shift, broken))


def _cubics(nodes: Array, heights: Array, thickness: Array, start, stop) -> Interpolant:
    """Pieces of given slopes at both their ends."""
    xp = namespace(nodes, heights, thickness, start, stop)
    width = nodes[1:] - nodes[:-1]
    mean = thickness / width
    b, c = 3 * mean - 2 * start - stop, start + stop - 2 * mean
    table = xp.stack([nodes[:-1], width, heights[:-1], start, b, c])
    return Interpolant(nodes, heights, thickness, table)


def _ends(nodes: Array, heights: Array, broken: Array | None) -> tuple[Array, Array]:
    """Slopes (n,) at the lower and upper ends of pieces, from one side of broken nodes."""
    xp = namespace(nodes, heights, broken)
    n = nodes.shape[0] - 1
    index = xp.arange(n + 1)
    if broken is None:
        slope = _slopes(xp, nodes, heights, index, 0 * index, 0 * index + n)
        return slope[:-1], slope[1:]
    low = xp.maximum.accumulate(xp.where(broken, index, 0))[:-1]
    high = xp.minimum.accumulate(xp.where(broken, index, n)[::-1])[::-1][1:]
    # Both ends at a node have one slope where it is not broken: on the host the others are known.
    other = np.append(np.flatnonzero(broken[1:-1]), n - 1) if xp is np else index[:-1]
    at = xp.concatenate([index[:-1], other + 1])
    both = (xp.concatenate([each, each[other]]) for each in (low, high))
    slope = _slopes(xp, nodes, heights, at, *both)
    start, stop = slope[:n], slope[n:]
    if xp is np:
        stop = np.append(start[1:], 0.0)
        stop[other] = slope[n:]
    return start, stop


def _slopes(xp, nodes: Array, heights: Array, at: Array, low: Array, high: Array) -> Array:
    """Y_u at the nodes ``at`` from the nearest of the nodes low .. high, all (m,) indices."""
    first = xp.clip(at - _NEIGHBOURS // 2, low, xp.maximum(high - _NEIGHBOURS + 1, low))
    places = first[:, None] + xp.arange(_NEIGHBOURS)
    used = places <= high[:, None]
    places = xp.minimum(places, high[:, None])
    own = places == at[:, None]
    own = own & used
    x = nodes[places]
    apart = x[:, :, None] - x[:, None, :]
    both = used[:, :, None] & used[:, None, :] & ~xp.eye(_NEIGHBOURS, dtype=bool)
    # Barycentric weights of the polynomial through the nodes used.
    weight = used / xp.prod(xp.where(both, apart, 1.0), axis=2)
    away = xp.where(used & ~own, nodes[at][:, None] - x, 1.0)
    share = xp.where(own, 0.0, weight / away) / xp.sum(xp.where(own, weight, 0.0), axis=1)[:, None]
    return xp.sum(share * (heights[places] - heights[at][:, None]), axis=1)
