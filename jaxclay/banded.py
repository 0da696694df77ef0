"""Smooth functions with a banded Hessian: its bands, their factor, Newton's method.

A symmetric matrix H of half-bandwidth b is held as its bands, an array
(b+1, n) with bands[k, i] = H[i, i+k] and zeros beyond the end.  Nodes further
apart than b do not meet in H, so 2b + 1 Hessian-vector products, one for each
colour i mod (2b + 1), hold every entry (Curtis, Powell and Reid 1974).

The factor is L D L^T in the order of cyclic reduction (Hockney 1965; Heller
1976): blocks of b rows, every other one eliminated at each level, all at once;
what is left in the end is small and factored as a dense matrix.  It takes
O(n b^2) operations in O(log n) steps, each of them vectorised.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxclay.clay import Array

_DENSE = 36  # rows below which LAPACK's dense factor is faster than another level
_OUTSIDE = 1e-9  # of a row's size: what counts as an entry outside the bands


class Model(NamedTuple):
    """A function's second-order model at a point: value, gradient (n,), bands (b+1, n)."""

    value: Array
    gradient: Array
    bands: Array


class Factor(NamedTuple):
    """L D L^T of a banded matrix, level by level.

    Attributes
    ----------
    rows : tuple of (b, 3b, m) arrays
        Per level the unit rows of the eliminated blocks: themselves, the block
        before, the block after.
    pivots : tuple of (b, m) arrays
        Their D.
    dense : (r, r) array
        Cholesky factor of what is left.
    positive : bool
        Whether every pivot is positive, so that the matrix is positive definite;
        nothing else in here means anything if not.
    """

    rows: tuple[Array, ...]
    pivots: tuple[Array, ...]
    dense: Array
    positive: Array


def local_model(fun: Callable[[Array], Array], x: Array, half_bandwidth: int) -> Model:
    """Value, gradient and Hessian of ``fun`` at x (n,), by coloured Hessian-vector products."""
    n, colours = x.shape[0], 2 * half_bandwidth + 1
    (value, gradient), push = jax.linearize(jax.value_and_grad(fun), x)
    nodes = jnp.arange(n)
    seeds = (nodes % colours == jnp.arange(colours)[:, None]).astype(x.dtype)
    products = jax.vmap(lambda seed: push(seed)[1])(seeds)
    offset = jnp.arange(half_bandwidth + 1)[:, None]
    bands = products[(nodes + offset) % colours, nodes]
    return Model(value, gradient, jnp.where(nodes + offset < n, bands, 0.0))


def masked(bands: Array, keep: Array) -> Array:
    """The bands on the rows and columns to keep, (n,) bool; the identity elsewhere."""
    widest = bands.shape[0] - 1
    other = jnp.stack([jnp.pad(keep[k:], (0, k)) for k in range(widest + 1)])
    identity = jnp.arange(widest + 1)[:, None] == 0
    return jnp.where(keep & other, bands, identity.astype(bands.dtype))


def dense(bands: Array) -> Array:
    """The symmetric matrix (n, n) itself."""
    upper = sum(jnp.diag(band[: bands.shape[1] - k], k) for k, band in enumerate(bands))
    return upper + jnp.triu(upper, 1).T


def factorize(bands: Array) -> Factor:
    """Factor a symmetric matrix from its bands (b+1, n), b >= 1."""
    diagonal, coupling, levels = _blocks(bands)
    b, positive = diagonal.shape[0], jnp.asarray(True)
    rows, pivots = [], []
    for _ in range(levels):
        own, kept = diagonal[:, :, 1::2], diagonal[:, :, 0::2]
        before, after = jnp.swapaxes(coupling[:, :, 0::2], 0, 1), coupling[:, :, 1::2]
        # Fused with what follows, XLA would eliminate anew for every entry that uses a row.
        rows_of = jax.lax.optimization_barrier(jnp.concatenate([own, before, after], axis=1))
        unit, pivot = jax.lax.optimization_barrier(_eliminate(rows_of))
        weighted = unit * pivot[:, None]
        positive &= jnp.all(pivot > 0)
        b_, a_ = slice(b, 2 * b), slice(2 * b, None)
        diagonal = kept - _outer(weighted[:, b_], unit[:, b_])
        diagonal -= _next(_outer(weighted[:, a_], unit[:, a_]))
        coupling = -_outer(weighted[:, b_], unit[:, a_])
        rows.append(unit)
        pivots.append(pivot)
    dense = jnp.linalg.cholesky(_assembled(diagonal, coupling), symmetrize_input=False)
    positive &= jnp.isfinite(dense[-1, -1])
    return Factor(tuple(rows), tuple(pivots), dense, positive)


def solve(factor: Factor, rhs: Array) -> Array:
    """H^-1 rhs for rhs (n,)."""
    n, levels = rhs.shape[0], len(factor.rows)
    b = factor.rows[0].shape[0] if levels else 1
    x = jnp.pad(rhs, (0, factor.dense.shape[0] * 2**levels - n)).reshape(-1, b).T
    eliminated = []
    for unit, pivot in zip(factor.rows, factor.pivots, strict=True):
        own, kept = [], x[:, 0::2]
        for k in range(b):
            own.append(x[k, 1::2] - sum(unit[j, k] * own[j] for j in range(k)))
        to_before = jnp.stack([sum(unit[k, b + j] * own[k] for k in range(b)) for j in range(b)])
        to_after = jnp.stack([sum(unit[k, 2 * b + j] * own[k] for k in range(b)) for j in range(b)])
        x = kept - to_before - _next(to_after)
        eliminated.append(jnp.stack(own) / pivot)
    x = jax.scipy.linalg.cho_solve((factor.dense, True), x.T.reshape(-1)).reshape(-1, b).T
    for unit, scaled in zip(factor.rows[::-1], eliminated[::-1], strict=True):
        after = jnp.pad(x[:, 1:], ((0, 0), (0, 1)))
        own = list(scaled)
        for k in reversed(range(b)):
            own[k] -= sum(unit[k, b + j] * x[j] + unit[k, 2 * b + j] * after[j] for j in range(b))
            own[k] -= sum(unit[k, j] * own[j] for j in range(k + 1, b))
        x = jnp.stack([x, jnp.stack(own)], axis=2).reshape(b, -1)
    return x.T.reshape(-1)[:n]


def _blocks(bands: Array) -> tuple[Array, Array, int]:
    """Diagonal blocks and those that couple each to the next, (b, b, m), and the levels needed.

    Rows of the identity are added until the blocks can be halved that often.
    """
    b, n = bands.shape[0] - 1, bands.shape[1]
    blocks, levels = -(-n // b), 0
    while blocks * b > _DENSE:
        blocks, levels = -(-blocks // 2), levels + 1
    blocks *= 2**levels
    added = jnp.broadcast_to(jnp.arange(b + 1)[:, None] == 0, (b + 1, blocks * b - n))
    bands = jnp.concatenate([bands, added.astype(bands.dtype)], axis=1)
    bands = bands.reshape(b + 1, blocks, b)
    none = jnp.zeros(blocks, bands.dtype)
    own = [[bands[abs(c - r), :, min(c, r)] for c in range(b)] for r in range(b)]
    following = [[bands[b + c - r, :, r] if c <= r else none for c in range(b)] for r in range(b)]
    return _stack(own), _stack(following), levels


def _stack(entries: list[list[Array]]) -> Array:
    return jnp.stack([jnp.stack(row) for row in entries])


def _eliminate(rows: Array) -> tuple[Array, Array]:
    """Unit rows and pivots of rows (b, w, m) whose first b columns are symmetric."""
    unit, pivots = [], []
    for k in range(rows.shape[0]):
        row = rows[k]
        for j in range(k):
            row = row - unit[j][k] * pivots[j] * unit[j]
        pivots.append(row[k])
        unit.append(row / row[k])
    return jnp.stack(unit), jnp.stack(pivots)


def _outer(left: Array, right: Array) -> Array:
    """Sum over k of left[k, a] right[k, c]: (b, b, m)."""
    return sum(left[k][:, None] * right[k][None] for k in range(left.shape[0]))


def _next(blocks: Array) -> Array:
    """Moved from each block to the one after it; the last falls out."""
    return jnp.pad(blocks[..., :-1], ((0, 0),) * (blocks.ndim - 1) + ((1, 0),))


def _assembled(diagonal: Array, coupling: Array) -> Array:
    """The block tridiagonal matrix, dense."""
    b, _, m = diagonal.shape
    own = jnp.moveaxis(diagonal, 2, 0)[:, :, None]
    before = jnp.moveaxis(jnp.swapaxes(coupling, 0, 1), 2, 0)[None].swapaxes(1, 2)
    block = jnp.arange(m)[:, None] - jnp.arange(m)
    at = block[:, None, :, None]
    # Masks instead of indices: on the CPU a scatter would be a loop.
    dense = jnp.where(at == 0, own, 0.0) + jnp.where(at == 1, before, 0.0)
    dense = dense.reshape(m * b, m * b)
    # Both halves, since the factor's derivative reads both.
    return jnp.tril(dense) + jnp.tril(dense, -1).T


def solve_exactly(bands: Array, rhs: Array) -> Array:
    """H^-1 rhs with derivatives by H and rhs of any order, which need no factor's derivative."""

    def by_factor(_, rhs: Array) -> Array:
        return solve(factorize(jax.lax.stop_gradient(bands)), rhs)

    return jax.lax.custom_linear_solve(lambda x: product(bands, x), rhs, by_factor, symmetric=True)


def product(bands: Array, x: Array) -> Array:
    """H x for x (n,)."""
    total = bands[0] * x
    for k in range(1, bands.shape[0]):
        band = bands[k, :-k]
        total += jnp.pad(band * x[k:], (0, k)) + jnp.pad(band * x[:-k], (k, 0))
    return total


def reaches_beyond(fun: Callable[[Array], Array], x: Array, bands: Array) -> Array:
    """Whether the Hessian of ``fun`` has entries outside its bands, by one product with it."""
    vector = 1.5 + jnp.cos(jnp.arange(x.shape[0], dtype=x.dtype) ** 2) / 2  # as good as random
    true = jax.jvp(jax.grad(fun), (x,), (vector,))[1]
    error = jnp.abs(true - product(bands, vector))
    return jnp.any(error > _OUTSIDE * product(jnp.abs(bands), vector))


def widest(fun: Callable[[Array], Array], x: Array) -> Array:
    """The half-bandwidth of the Hessian of ``fun``, row by row: O(n^2) operations."""
    nodes = jnp.arange(x.shape[0])

    def reach(i):
        row = jnp.abs(jax.jvp(jax.grad(fun), (x,), ((nodes == i).astype(x.dtype),))[1])
        return jnp.max(jnp.where(row > _OUTSIDE * jnp.max(row), jnp.abs(nodes - i), 0))

    return jnp.max(jax.lax.map(reach, nodes))


# Last, since it needs what is above.
from jaxclay.banded_newton import BandedResult as BandedResult  # noqa: E402
from jaxclay.banded_newton import minimize_banded as minimize_banded  # noqa: E402
