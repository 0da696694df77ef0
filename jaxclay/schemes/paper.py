"""Scheme "paper": heights Y_i at n+1 nodes, differences divided by h (eqs. 20-22).

Sample i = 0..n-1 holds Y_u and the strain of slice i, the shift of node i+1,
X_u between slices i and i+1, and both second derivatives at node i.  Terms that
would need X_n, which eq. 22 does not define, or a node beyond the ends are 0.

Solvers hold a :class:`Point`, thicknesses beside displacements, rather than
heights: second differences of heights are rounding noise on fine grids.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp

from jaxclay.band import Rest
from jaxclay.clay import Array
from jaxclay.energy import Samples


class Point(NamedTuple):
    """A shape, lengths over the unit l.

    Attributes
    ----------
    thickness : (n,) array
        t_i = Y_{i+1} - Y_i.
    shift : (n+1,) array
        Y_i - Y0_i.
    """

    thickness: Array
    shift: Array

    def moved(self, step: Array) -> Point:
        """The shape after every node has moved by ``step``, (n+1,)."""
        return Point(self.thickness + jnp.diff(step), self.shift + step)


def radii(thickness: Array, r0: Array, slices: int) -> Array:
    """X_i = r0 sqrt(h / t_i) of any slices of a grid of n, eq. 22."""
    return r0 / jnp.sqrt(slices * thickness)


def sample(rest: Rest, point: Point) -> Samples:
    """Samples of the contour at each slice, with weight h (eq. 21) and X_i from eq. 22."""
    return sample_contour(rest, point, radii(point.thickness, rest.r0, rest.slices))


def sample_contour(rest: Rest, point: Point, X: Array) -> Samples:
    """The same for radii X (n,) of their own, whether or not they keep the volume."""
    n = rest.slices
    zero = jnp.zeros((1,), X.dtype)
    return Samples(
        stretch=point.thickness / rest.thickness,
        shift=point.shift[1:],
        Y_u=n * point.thickness,
        X_u=jnp.concatenate([n * jnp.diff(X), zero]),
        Y_uu=jnp.concatenate([zero, n**2 * jnp.diff(point.thickness)]),
        X_uu=jnp.concatenate([zero, n**2 * jnp.diff(X, n=2), zero]),
        weight=jnp.full((n,), 1 / n, X.dtype),
    )


def sample_free(samples: Samples, free: Array) -> Samples:
    """Samples with the terms that touch no free node set to nothing; free is (n+1,) bool."""

    def touched(before: int, after: int) -> Array:
        """Whether any of the nodes i - before .. i + after is free, for i = 0..n-1."""
        n = free.shape[0] - 1
        padded = jnp.concatenate([jnp.zeros(before, bool), free, jnp.zeros(after, bool)])
        return jnp.any(jnp.stack([padded[j : j + n] for j in range(before + after + 1)]), axis=0)

    return samples._replace(
        stretch=jnp.where(touched(0, 1), samples.stretch, 1.0),
        shift=jnp.where(free[1:], samples.shift, 0.0),
        Y_u=jnp.where(touched(0, 1), samples.Y_u, 0.0),
        X_u=jnp.where(touched(0, 2), samples.X_u, 0.0),
        Y_uu=jnp.where(touched(1, 1), samples.Y_uu, 0.0),
        X_uu=jnp.where(touched(1, 2), samples.X_uu, 0.0),
    )
