"""Scheme "paper": heights Y_i at n+1 nodes, differences divided by h = 1/n (eqs. 20-22).

The radius of slice i stands at its lower node, and every weight is h.  Terms that would need
X_n, which eq. 22 does not define, or a node beyond the ends are left out; node 0 never moves.
"""

from __future__ import annotations

import jax.numpy as jnp

from jaxclay.numerics.arrays import Array
from jaxclay.schemes.sums import Sums


def sums_of(slices: int, like: Array) -> Sums:
    """The paper's sums on n equal slices, in the dtype of ``like``."""
    n = slices
    h = jnp.full(n + 1, 1 / n, like.dtype)
    return Sums(h[:-1], h[:-1], h.at[0].set(0.0), h[:-2], h[:-2], h[:-3])
