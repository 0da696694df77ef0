"""Meshes: knots on the free clay, and conditions at its ends.

The free clay is measured by v: [0, c] is the clay below the band, c the band's
lower edge, and [c, L] the clay above, L what the band leaves.  A side that the
band leaves no clay has spans without length and coefficients without support.
"""

from __future__ import annotations

import jax.numpy as jnp

from jaxclay.band import Band
from jaxclay.clay import Array
from jaxclay.schemes.spline import bspline


def free_length(band: Band) -> Array:
    """L."""
    return jnp.where(band.upper >= 1, band.lower, 1 - (band.upper - band.lower))


def knots(band: Band, degree: int, elements: int) -> Array:
    """Knots of as many equal spans on each side, those at c and at the ends repeated."""
    cut, length = band.lower, free_length(band)
    share = jnp.arange(1, elements) / elements
    below, above = cut * share, cut + (length - cut) * share
    ends = [jnp.full(degree + 1, end) for end in (0.0, cut, length)]
    return jnp.concatenate([ends[0], below, ends[1], above, ends[2]])


def conditions(
    knots: Array, degree: int, band: Band, count, below, above, held
) -> tuple[Array, Array]:
    """Which coefficients are prescribed, (N,) bool, and the values of those.

    ``below`` and ``above`` are (w, w_u, w_uu) at the band's edges, of which the first
    ``count`` are prescribed; Y_0 = 0, and where ``held`` the upper end stays.
    """
    cut, total = band.lower, knots.shape[0] - degree - 1
    start, stop = knots[:total], knots[degree + 1 :]
    inner = bspline.inner_knots(knots, degree)
    is_below = stop <= cut
    edge = [jnp.where(is_below, low, high) for low, high in zip(below, above, strict=True)]
    order = jnp.sum(inner != cut, axis=0)  # of the derivative that a coefficient at the edge adds
    at_edge = ((start == cut) | is_below & (stop == cut)) & (order < count)
    first = jnp.all(inner == 0, axis=0) & is_below
    last = jnp.all(inner == knots[-1], axis=0) & held
    empty = start == stop
    value = bspline.fitted(knots, degree, jnp.full(total, cut), jnp.stack(edge))
    return at_edge | first | last | empty, jnp.where(at_edge & ~empty, value, 0.0)


def material(knots: Array, degree: int, places: Array, band: Band) -> Array:
    """u of the places (S, g) in v of each span."""
    left, _ = bspline.spans(knots, degree)
    return places + jnp.where(left >= band.lower, band.upper - band.lower, 0.0)[:, None]
