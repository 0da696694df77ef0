"""Meshes: equal spans on each side of the band, and conditions at its edges and the clay's ends.

A side that the band leaves no clay has spans without length.
"""

from __future__ import annotations

import jax.numpy as jnp

from jaxclay.model.band import Band
from jaxclay.numerics.arrays import Array, Bool, Float


def spans(band: Band, elements: int) -> tuple[Float[Array, "S"], Float[Array, "S"]]:
    """(S,) lower ends in u and lengths of as many spans below the band as above it."""
    start = jnp.stack([jnp.zeros(()), band.upper])
    length = jnp.stack([band.lower, 1 - band.upper]) / elements
    left = start[:, None] + length[:, None] * jnp.arange(elements)
    return left.reshape(-1), jnp.repeat(length, elements)


def conditions(
    length: Float[Array, "S"], degree: int, count: Array, below: tuple, above: tuple, held: Array
) -> tuple[Bool[Array, "N"], Float[Array, "N"]]:
    """Which coefficients are prescribed, (N,) bool, and the values of those.

    ``below`` and ``above`` are (w, w_u, w_uu) at the band's edges, of which the first
    ``count`` are prescribed; Y_0 = 0, and where ``held`` the upper end stays.
    """
    p, elements = degree, length.shape[0] // 2
    w, w_u, w_uu = (jnp.stack(pair) for pair in zip(below, above, strict=True))
    step = jnp.stack([-length[0], length[-1]])  # away from the band
    # Of a clamped spline: p (c_1 - c_0) / h = w_u, and the same once more of its derivative.
    first = w + step / p * w_u
    second = first + min(2, elements) * step / p * (w_u + step / (p - 1) * w_uu)
    value = jnp.stack([w, first, second], axis=1)
    away = jnp.arange(elements + p)
    order = jnp.stack([away[::-1], away])
    at_edge, empty = order < count, (step == 0)[:, None]
    at_end = (order == elements + p - 1) & jnp.stack([jnp.asarray(True), held])[:, None]
    value = jnp.take_along_axis(value, jnp.minimum(order, 2), axis=1)
    fixed = at_edge | at_end | empty
    return fixed.reshape(-1), jnp.where(at_edge & ~empty, value, 0.0).reshape(-1)
