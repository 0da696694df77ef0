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
_EVEN = 17  # even places at which spans are counted, and
_AWAY = (0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0)  # distances from each feature over its fade


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


class Features(NamedTuple):
    """Where spans are short; (2, F) arrays, the side below and the one above.

    Attributes
    ----------
    distance : of a feature from the band
    first : length of the spans there, inf for no feature
    fade : distance in which spans grow by a factor e
    """

    distance: Array
    first: Array
    fade: Array


def graded(band: Band, features: Features, count: int, sides: int) -> Array:
    """(sides count,) inner knots, dense where features are; those not needed repeat L."""
    cut, length = band.lower, free_length(band)
    placed = []
    for side, span in ((0, cut), (1, length - cut))[2 - sides :]:
        own = Features(*(leaf[side] for leaf in features))
        x, used = _dense(own, jnp.maximum(span, 1e-30), count)
        at = cut - x if side == 0 else cut + x
        placed.append(jnp.where(used & (span > 0), at, length))
    return jnp.sort(jnp.concatenate(placed))


def _dense(features: Features, span: Array, count: int) -> tuple[Array, Array]:
    """Distances from the band of knots at equal steps of the number of spans, and which are used.

    A feature's density of spans, exp(-|x - distance| / fade) / first, adds to an even one.
    """
    distance, first, fade = (leaf[:, None] for leaf in features)

    def risen(z):
        """The integral of exp(-|z| / fade) / fade from 0, (F, m)."""
        return jnp.sign(z) * -jnp.expm1(-jnp.abs(z) / fade)

    away = jnp.asarray((0.0, *_AWAY))
    near = jnp.concatenate([distance + fade * away, distance - fade * away]).reshape(-1)
    x = jnp.concatenate([near, span * jnp.linspace(0.0, 1.0, _EVEN)])
    x = jnp.sort(jnp.clip(x, 0.0, span))
    added = fade / first * (risen(x - distance) - risen(-distance))
    spans = _FEWEST * x / span + jnp.sum(added, axis=0)
    total = jnp.minimum(jnp.ceil(spans[-1] - 0.1), count + 1)
    j = jnp.arange(1, count + 1)
    return jnp.interp(j * spans[-1] / total, spans, x), j < total


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
