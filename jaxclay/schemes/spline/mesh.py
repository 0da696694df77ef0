"""Meshes: knots on the free clay, where they lie dense, and conditions at its ends.

The free clay is measured by v: [0, c] is the clay below the band, c the band's
lower edge, and [c, L] the clay above, L what the band leaves.  Knots that a mesh
does not need repeat c or L, which makes spans without length and coefficients
without support.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp

from jaxclay.band import Band
from jaxclay.clay import Array
from jaxclay.schemes.spline import bspline

_SHORTEST = 1e-9  # share of the clay
_FEWEST = 3  # spans on a side
_GROWTH = 0.5  # of a span's length over its distance from where the mesh is dense


def free_length(band: Band) -> Array:
    """L."""
    return jnp.where(band.upper >= 1, band.lower, 1 - (band.upper - band.lower))


def knots(inner: Array, band: Band, degree: int, sides: int) -> Array:
    """Sorted knots from inner ones (K,), with those that part the sides and end them.

    ``sides`` is 1 where no clay can be below the band, which saves the knots for it.
    """
    cut, length = band.lower, free_length(band)
    for end in (0.0, cut, length):  # a span as short as rounding would drown all others
        inner = jnp.where(jnp.abs(inner - end) < _SHORTEST, end, inner)
    ends = [cut, length] if sides == 1 else [jnp.zeros(()), cut, length]
    return jnp.sort(jnp.concatenate([jnp.repeat(jnp.stack(ends), degree + 1), inner]))


def uniform(band: Band, elements: int, sides: int) -> Array:
    """(sides (elements - 1),) inner knots of as many equal spans on each side."""
    cut, length = band.lower, free_length(band)
    share = jnp.arange(1, elements) / elements
    above = cut + (length - cut) * share
    return above if sides == 1 else jnp.concatenate([cut * share, above])


class Density(NamedTuple):
    """How long spans are at places of one side; (2,) arrays, the side below and the one above.

    Attributes
    ----------
    edge : length of the first span at the band
    reach : distance from the band where a kink is expected; beyond the side if nowhere
    at_reach : length of the spans there
    end : length of the last span at the far end, inf if nothing happens there
    """

    edge: Array
    reach: Array
    at_reach: Array
    end: Array


def graded(band: Band, density: Density, count: int, sides: int) -> Array:
    """(sides count,) inner knots of which spans grow with distance from where they are short.

    Knots beyond ``count`` are left out; those not needed repeat L.
    """
    cut, length = band.lower, free_length(band)
    spans = [cut, length - cut]
    placed = []
    for side in range(2 - sides, 2):
        edge, reach, at_reach, end = (leaf[side] for leaf in density)
        span = jnp.maximum(spans[side], 1e-30)
        x, used = _side(edge, reach, at_reach, end, span, count)
        at = cut - x if side == 0 else cut + x
        placed.append(jnp.where(used & (spans[side] > 0), at, length))
    inner = jnp.sort(jnp.concatenate(placed))
    return inner[: sides * count]


def _side(edge, reach, at_reach, end, span, count) -> tuple[Array, Array]:
    """Distances from the band and whether they are used, (2 count + 1,)."""
    edge = jnp.minimum(edge, span / _FEWEST)
    whole = reach >= 0.999 * span
    first, used = _stretch(
        edge, jnp.where(whole, end, at_reach), jnp.where(whole, span, reach), count
    )
    second, also = _stretch(at_reach, end, jnp.maximum(span - reach, 1e-30), count)
    places = jnp.concatenate([first, reach[None], reach + second])
    return places, jnp.concatenate([used, ~whole[None], also & ~whole])


def _stretch(low, high, span, count) -> tuple[Array, Array]:
    """Inner knots of [0, span] whose gaps grow linearly from ``low`` and ``high`` at its ends."""
    low, high = jnp.minimum(low, span), jnp.minimum(high, span)
    turn = jnp.clip((span + (high - low) / _GROWTH) / 2, 0.0, span)
    rising = jnp.log1p(_GROWTH * turn / low) / _GROWTH
    total = rising + jnp.log1p(_GROWTH * (span - turn) / high) / _GROWTH
    number = jnp.ceil(total - 0.01)
    j = jnp.arange(1, count + 1)
    t = j * total / number
    up = low * jnp.expm1(_GROWTH * t) / _GROWTH
    down = span - high * jnp.expm1(_GROWTH * (total - t)) / _GROWTH
    return jnp.where(t < rising, up, down), j < number


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
