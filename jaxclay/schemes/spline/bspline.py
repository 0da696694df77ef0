"""B-splines on equal spans with clamped ends, on two sides next to each other.

Below and above the band lie m spans each, S = 2 m in all.  Span i of a side sees the
coefficients i .. i+p of the m + p that the side has; a vector has those of both, N = 2 (m + p).
"""

from __future__ import annotations

import functools
from math import comb

import jax.numpy as jnp
import numpy as np

from jaxclay.numerics.arrays import Array, Float, Scalar


def _knots(degree: int, elements: int) -> np.ndarray:
    """(m + 2p + 1,) of one side, over the length of a span."""
    return np.clip(np.arange(-degree, elements + degree + 1.0), 0, elements)


@functools.cache
def extraction(degree: int, elements: int) -> Float[Array, "S {degree}+1 {degree}+1"]:
    """(S, p+1, p+1) matrices from a span's coefficients to its Bernstein coefficients.

    De Boor and Cox's recurrence on polynomials in Bernstein form: from degree r-1 to r, basis
    function i passes the share L_i on to its upper neighbour, L_i the linear function that
    rises from 0 to 1 over its support.
    """
    p, knots = degree, _knots(degree, elements)
    scaled = np.stack([knots[i : i + elements] - np.arange(elements) for i in range(2 * p + 1)], 1)
    function = np.ones((elements, 1, 1))  # (m, basis function, Bernstein coefficient)
    for r in range(1, p + 1):
        start, stop = scaled[:, p + 1 - r : p + 1, None], scaled[:, p + 1 : p + 1 + r, None]
        share = np.arange(r, -1, -1) / r
        low = np.pad(function, ((0, 0), (0, 0), (0, 1))) * share
        high = np.pad(function, ((0, 0), (0, 0), (1, 0))) * (1 - share)
        passed = (low * -start + high * (1 - start)) / (stop - start)
        function = np.pad(passed, ((0, 0), (1, 0), (0, 0)))
        function += np.pad(low + high - passed, ((0, 0), (0, 1), (0, 0)))
    return np.tile(np.swapaxes(function, 1, 2), (2, 1, 1))


def greville(degree: int, elements: int) -> Float[Array, "{elements}+{degree}"]:
    """(m + p,) where on a side, from 0 to 1, its coefficients lie: means of their inner knots."""
    knots, count = _knots(degree, elements), elements + degree
    return np.mean([knots[r : r + count] for r in range(1, degree + 1)], axis=0) / elements


def bernstein(
    degree: int, s: Float[Array, "*at"] | Scalar, order: int
) -> Float[Array, "*at {degree}+1"]:
    """(..., p+1) derivatives of the given order of the Bernstein polynomials at s (...)."""
    low = degree - order
    s = jnp.asarray(s)[..., None]
    k = np.arange(low + 1)
    values = np.array([comb(low, i) for i in k]) * s**k * (1 - s) ** (low - k)
    for r in range(order):
        zero = jnp.zeros_like(values[..., :1])
        before, after = jnp.concatenate([zero, values], -1), jnp.concatenate([values, zero], -1)
        values = (low + r + 1) * (before - after)
    return values


@functools.cache
def gauss_points(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and weights of the Gauss-Legendre rule on [0, 1]."""
    points, weights = np.polynomial.legendre.leggauss(count)
    return (points + 1) / 2, weights / 2


def basis(
    length: Float[Array, "S"], degree: int, s: Float[Array, "... g"], orders: tuple[int, ...]
) -> Float[Array, "S g orders {degree}+1"]:
    """(S, g, len(orders), p+1) derivatives of the spans' basis at s, (g,) or (S, g), in [0, 1].

    ``length`` (S,) is that of the spans.
    """
    extracted = extraction(degree, length.shape[0] // 2)
    unit = jnp.where(length > 0, length, 1.0)[:, None, None]
    s = jnp.broadcast_to(s, (length.shape[0], jnp.shape(s)[-1]))
    sampled = [
        jnp.einsum("sgj,sja->sga", bernstein(degree, s, order), extracted) / unit**order
        for order in orders
    ]
    return jnp.stack(sampled, axis=2)


def local(coefficients: Float[Array, "N"], degree: int) -> Float[Array, "S {degree}+1"]:
    """(S, p+1) the coefficients that each span sees."""
    c = coefficients.reshape(2, -1)
    count = c.shape[1] - degree
    seen = jnp.stack([c[:, a : a + count] for a in range(degree + 1)], axis=2)
    return seen.reshape(-1, degree + 1)


def gathered(entries: Float[Array, "S {degree}+1"], degree: int) -> Float[Array, "N"]:
    """(N,) sums over the spans of entries (S, p+1): the transpose of :func:`local`."""
    e = entries.reshape(2, -1, degree + 1)
    summed = sum(jnp.pad(e[..., a], ((0, 0), (a, degree - a))) for a in range(degree + 1))
    return jnp.reshape(summed, -1)


def gathered_bands(
    matrices: Float[Array, "S {degree}+1 {degree}+1"], degree: int
) -> Float[Array, "{degree}+1 N"]:
    """(p+1, N) bands of the sum of the spans' symmetric matrices (S, p+1, p+1)."""
    p, wide = degree, jnp.pad(matrices, ((0, 0), (0, 0), (0, degree)))
    # Row a of what follows holds the entries (a, a + k) of the spans' matrices.
    index = np.arange(p + 1)
    return jnp.stack([gathered(wide[:, index, index + k], p) for k in range(p + 1)])
