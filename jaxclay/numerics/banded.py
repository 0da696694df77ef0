"""Smooth functions with a banded Hessian: its bands, their factor, Newton's method.

A symmetric matrix H of half-bandwidth b is held as its bands, an array
(b+1, n) with bands[k, i] = H[i, i+k] and zeros beyond the end.  Nodes further
apart than b do not meet in H, so 2b + 1 Hessian-vector products, one for each
colour i mod (2b + 1), hold every entry (Curtis, Powell and Reid 1974).

The factor is L D L^T, row by row (Golub and Van Loan 2013, section 4.3): a loop that
carries what the last rows leave to the next b, O(n b^2) operations and as small a program
whatever n.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxclay.numerics.arrays import Array, Bool, Float, Int

_OUTSIDE = 1e-9  # of a row's size: what counts as an entry outside the bands


class Model(NamedTuple):
    """A function's second-order model at a point: value, gradient (n,), bands (b+1, n)."""

    value: Float[Array, ""]
    gradient: Float[Array, "n"]
    bands: Array


class Factor(NamedTuple):
    """L D L^T of a banded matrix.

    Attributes
    ----------
    below : (n, b) array
        L[i+1+k, i] of the unit lower triangular L.
    pivots : (n,) array
        D.
    """

    below: Float[Array, "n b"]
    pivots: Float[Array, "n"]

    @property
    def positive(self) -> Bool[Array, ""]:
        """Whether every pivot is positive, so that the matrix is positive definite.

        Nothing else in here means anything if not.
        """
        return jnp.all(self.pivots > 0)


def local_model(fun: Callable[[Array], Array], x: Float[Array, "n"], half_bandwidth: int) -> Model:
    """Value, gradient and Hessian of ``fun`` at x (n,), by coloured Hessian-vector products."""
    n, colours = x.shape[0], 2 * half_bandwidth + 1
    (value, gradient), push = jax.linearize(jax.value_and_grad(fun), x)
    nodes = jnp.arange(n)
    seeds = (nodes % colours == jnp.arange(colours)[:, None]).astype(x.dtype)
    products = jax.vmap(lambda seed: push(seed)[1])(seeds)
    offset = jnp.arange(half_bandwidth + 1)[:, None]
    bands = products[(nodes + offset) % colours, nodes]
    return Model(value, gradient, jnp.where(nodes + offset < n, bands, 0.0))


def masked(bands: Float[Array, "rows n"], keep: Bool[Array, "n"]) -> Float[Array, "rows n"]:
    """The bands on the rows and columns to keep, (n,) bool; the identity elsewhere."""
    widest = bands.shape[0] - 1
    other = jnp.stack([jnp.pad(keep[k:], (0, k)) for k in range(widest + 1)])
    identity = jnp.arange(widest + 1)[:, None] == 0
    return jnp.where(keep & other, bands, identity.astype(bands.dtype))


def dense(bands: Float[Array, "rows n"]) -> Float[Array, "n n"]:
    """The symmetric matrix (n, n) itself."""
    upper = sum(jnp.diag(band[: bands.shape[1] - k], k) for k, band in enumerate(bands))
    return upper + jnp.triu(upper, 1).T


def factorize(bands: Float[Array, "rows n"]) -> Factor:
    """Factor a symmetric matrix from its bands (b+1, n), b >= 1."""
    return reduced(bands, jnp.zeros_like(bands[0]))[0]


def solve(factor: Factor, rhs: Float[Array, "n"]) -> Float[Array, "n"]:
    """H^-1 rhs for rhs (n,)."""

    def row(left, entry):
        below, force = entry
        value = force + left[0]
        return _shifted(left) - below * value, value

    none = jnp.zeros_like(factor.below[0])
    forward = jax.lax.scan(row, none, (factor.below, rhs))[1]
    return substituted(factor, forward / factor.pivots)


def reduced(
    bands: Float[Array, "rows n"], rhs: Float[Array, "n"]
) -> tuple[Factor, Float[Array, "n"]]:
    """The factor and L^-1 rhs, (n,), in one loop."""
    b = bands.shape[0] - 1

    def row(carry, entries):
        schur, left = carry
        band, force = entries
        band = band + jnp.pad(schur[0], (0, 1))
        below, value = band[1:] / band[0], force + left[0]
        # Row j of the Schur complement is told from its diagonal on.
        outer = jnp.pad((band[1:, None] * below).reshape(-1), (0, b))
        upper = jnp.where(inside, outer.reshape(b, b + 1)[:, :b], 0.0)
        schur = jnp.pad(schur[1:], ((0, 1), (0, 0))) - upper
        return (schur, _shifted(left) - below * value), (below, band[0], value)

    inside = jnp.arange(b)[:, None] + jnp.arange(b) < b
    none = jnp.zeros((b, b), bands.dtype), jnp.zeros(b, bands.dtype)
    below, pivots, forward = jax.lax.scan(row, none, (bands.T, rhs))[1]
    return Factor(below, pivots), forward


def substituted(factor: Factor, values: Float[Array, "n"]) -> Float[Array, "n"]:
    """L^-T values for values (n,)."""

    def row(above, entry):
        below, value = entry
        value = value - below @ above
        return jnp.concatenate([value[None], above[:-1]]), value

    none = jnp.zeros_like(factor.below[0])
    return jax.lax.scan(row, none, (factor.below, values), reverse=True)[1]


def _shifted(left: Array) -> Array:
    return jnp.concatenate([left[1:], 0 * left[:1]])


def solve_exactly(bands: Float[Array, "rows n"], rhs: Float[Array, "n"]) -> Float[Array, "n"]:
    """H^-1 rhs with derivatives by H and rhs of any order, which need no factor's derivative."""

    def by_factor(_, rhs: Array) -> Array:
        return solve(factorize(jax.lax.stop_gradient(bands)), rhs)

    return jax.lax.custom_linear_solve(lambda x: product(bands, x), rhs, by_factor, symmetric=True)


def product(bands: Float[Array, "rows n"], x: Float[Array, "n"]) -> Float[Array, "n"]:
    """H x for x (n,)."""
    total = bands[0] * x
    for k in range(1, bands.shape[0]):
        band = bands[k, :-k]
        total += jnp.pad(band * x[k:], (0, k)) + jnp.pad(band * x[:-k], (k, 0))
    return total


def reaches_beyond(
    fun: Callable[[Array], Array], x: Float[Array, "n"], bands: Float[Array, "rows n"]
) -> Bool[Array, ""]:
    """Whether the Hessian of ``fun`` has entries outside its bands, by one product with it."""
    vector = 1.5 + jnp.cos(jnp.arange(x.shape[0], dtype=x.dtype) ** 2) / 2  # as good as random
    true = jax.jvp(jax.grad(fun), (x,), (vector,))[1]
    error = jnp.abs(true - product(bands, vector))
    return jnp.any(error > _OUTSIDE * product(jnp.abs(bands), vector))


def widest(fun: Callable[[Array], Array], x: Float[Array, "n"]) -> Int[Array, ""]:
    """The half-bandwidth of the Hessian of ``fun``, row by row: O(n^2) operations."""
    nodes = jnp.arange(x.shape[0])

    def reach(i):
        row = jnp.abs(jax.jvp(jax.grad(fun), (x,), ((nodes == i).astype(x.dtype),))[1])
        return jnp.max(jnp.where(row > _OUTSIDE * jnp.max(row), jnp.abs(nodes - i), 0))

    return jnp.max(jax.lax.map(reach, nodes))
