"""Integrals of u^j Y0_u^2 over the smooth rest shape, j = 0, 1, 2, exact for its cubic pieces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxclay.numerics.arrays import Array, Float, Scalar, namespace, pick
from jaxclay.numerics.interpolation import Interpolant

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(4)
_PLACES, _WEIGHTS = (_POINTS + 1) / 2, _WEIGHTS / 2


class Moments(NamedTuple):
    """Integrals of Y0_u^2, u Y0_u^2 and u^2 Y0_u^2 from 0 to the nodes, (3, n+1)."""

    rest: Interpolant
    sums: Float[Array, "3 n+1"]

    def upto(self, u: Float[Array, "*at"] | Scalar) -> Float[Array, "3 *at"]:
        """(3, ...) the integrals from 0 to u."""
        i = self.rest.piece(u)
        return pick(self.sums, i) + _in_piece(pick(self.rest.table, i), u)


def moments(rest: Interpolant) -> Moments:
    """The integrals up to all nodes."""
    xp = namespace(rest)
    parts = _in_piece(rest.table, rest.nodes[1:])
    return Moments(rest, xp.concatenate([xp.zeros((3, 1)), xp.cumsum(parts, axis=1)], axis=1))


def _in_piece(piece: Array, u: Array) -> Array:
    """(3, ...) the integrals from the lower end of a piece (6, ...) to u in it.

    They are polynomials of degree 6 at most: four Gauss points are exact.
    """
    xp = namespace(piece, u)
    low, width, _, a, b, c = piece[..., None]
    length = (u - piece[0])[..., None]
    at = length * _PLACES
    s, u = at / width, low + at
    value = (a + s * (2 * b + 3 * c * s)) ** 2 * length
    first = u * value
    return xp.stack([value, first, u * first]) @ _WEIGHTS
