"""B-splines on any knots, repeated ones included: extraction, samples, quasi-interpolation.

Knots T_0 <= ... <= T_{S+2p} of degree p cut [T_p, T_{S+p}] into S spans; span e
is [T_{e+p}, T_{e+p+1}] and sees the p+1 coefficients e .. e+p of the S + p in
all.  Spans may be empty: a knot repeated p+1 times parts the spline in two, and
arrays of a few lengths serve every mesh.
"""

from __future__ import annotations

import functools
from math import comb

import jax.numpy as jnp
import numpy as np

from jaxclay.clay import Array


def spans(knots: Array, degree: int) -> tuple[Array, Array]:
    """(S,) left ends and lengths of the spans."""
    left = knots[degree : knots.shape[0] - degree - 1]
    return left, knots[degree + 1 : knots.shape[0] - degree] - left


def extraction(knots: Array, degree: int) -> Array:
    """(S, p+1, p+1) matrices from a span's coefficients to its Bernstein coefficients.

    De Boor and Cox's recurrence on polynomials in Bernstein form: from degree r-1 to r, basis
    function i passes the share L_i on to its upper neighbour, L_i the linear function that
    rises from 0 to 1 over its support.
    """
    p, (left, length) = degree, spans(knots, degree)
    count = left.shape[0]
    unit = jnp.where(length > 0, length, 1.0)
    scaled = jnp.stack([knots[i : i + count] - left for i in range(2 * p + 1)], 1) / unit[:, None]
    function = jnp.ones((count, 1, 1))  # (S, basis function, Bernstein coefficient)
    for r in range(1, p + 1):
        start, stop = scaled[:, p + 1 - r : p + 1, None], scaled[:, p + 1 : p + 1 + r, None]
        width = jnp.where(stop > start, stop - start, 1.0)
        share = np.arange(r, -1, -1) / r
        low = jnp.pad(function, ((0, 0), (0, 0), (0, 1))) * share
        high = jnp.pad(function, ((0, 0), (0, 0), (1, 0))) * (1 - share)
        passed = (low * -start + high * (1 - start)) / width
        function = jnp.pad(passed, ((0, 0), (1, 0), (0, 0)))
        function += jnp.pad(low + high - passed, ((0, 0), (0, 1), (0, 0)))
    return jnp.swapaxes(function, 1, 2)


def bernstein(degree: int, s: Array, order: int) -> Array:
    """(..., p+1) derivatives of the given order of the Bernstein polynomials at s (...)."""
    low = degree - order
    if low < 0:
        return jnp.zeros((*jnp.shape(s), degree + 1))
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


def basis(extracted: Array, length: Array, degree: int, s: Array, orders: tuple[int, ...]) -> Array:
    """(S, g, len(orders), p+1) derivatives of each span's basis at s, (g,) or (S, g), in [0, 1].

    Zero in spans without length.
    """
    extracted = jnp.where(length[:, None, None] > 0, extracted, 0.0)
    unit = jnp.where(length > 0, length, 1.0)[:, None, None]
    s = jnp.broadcast_to(s, (length.shape[0], jnp.shape(s)[-1]))
    sampled = [
        jnp.einsum("sgj,sja->sga", bernstein(degree, s, order), extracted) / unit**order
        for order in orders
    ]
    return jnp.stack(sampled, axis=2)


def local(coefficients: Array, degree: int) -> Array:
    """(S, p+1) the coefficients that each span sees."""
    count = coefficients.shape[0] - degree
    return jnp.stack([coefficients[a : a + count] for a in range(degree + 1)], axis=1)


def gathered(entries: Array, degree: int) -> Array:
    """(S + p,) sums over the spans of entries (S, p+1): the transpose of :func:`local`."""
    return sum(jnp.pad(entries[:, a], (a, degree - a)) for a in range(degree + 1))


def gathered_bands(matrices: Array, degree: int) -> Array:
    """(p+1, S + p) bands of the sum of the spans' symmetric matrices (S, p+1, p+1)."""
    p = degree
    return jnp.stack(
        [
            sum(jnp.pad(matrices[:, a, a + k], (a, p - a)) for a in range(p + 1 - k))
            for k in range(p + 1)
        ]
    )


def inner_knots(knots: Array, degree: int) -> Array:
    """(p, S + p) the knots within each coefficient's support, its ends left out."""
    count = knots.shape[0] - degree - 1
    return jnp.stack([knots[r : r + count] for r in range(1, degree + 1)])


def fitted(knots: Array, degree: int, at: Array, derivatives: Array) -> Array:
    """Coefficients (S + p,) from the derivatives (m+1, S + p) of order 0..m <= p at points.

    Each coefficient is the blossom of the Taylor polynomial at its own point, which
    has to lie in its support (de Boor and Fix 1973): exact for splines on these knots.
    """
    symmetric = [jnp.ones_like(at)] + [jnp.zeros_like(at)] * degree
    for knot in inner_knots(knots, degree):
        for k in range(degree, 0, -1):
            symmetric[k] = symmetric[k] + symmetric[k - 1] * (knot - at)
    factorial, total = 1, 0.0
    for k, derivative in enumerate(derivatives):
        factorial *= max(k, 1)
        total = total + derivative * symmetric[k] / (factorial * comb(degree, k))
    return total
