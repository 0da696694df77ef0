"""The local model of the smooth energy at a point: value, gradient, banded Hessian.

All are taken with respect to a step of the nodes (n+1,), at fixed nodes masked
out: gradients are 0 there and matrices carry the identity.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import jax
import jax.numpy as jnp

from jaxclay import banded
from jaxclay.banded import Factor, Model
from jaxclay.clay import Array
from jaxclay.energy import integrate_smooth
from jaxclay.schemes import sums
from jaxclay.schemes.sums import Point

if TYPE_CHECKING:
    from jaxclay.problem import Problem

HALF_BANDWIDTH = 3  # bending couples Y_{i-1} .. Y_{i+2}
_FINE = 512  # slices from which rounding can hide how the upper end gives way
_DIAGONAL = ((0, HALF_BANDWIDTH), (0, 0))  # pads a diagonal to bands


def smooth_energy(problem: Problem, point: Point, step: Array) -> Array:
    """Strain, tension and bending after every node has moved by ``step``, without the fixed."""
    return problem.free_smooth(point.moved(step))


def gradient(problem: Problem, point: Point) -> Array:
    """(n+1,) gradient g of the smooth energy."""
    g = jax.grad(smooth_energy, argnums=2)(problem, point, jnp.zeros_like(point.shift))
    return jnp.where(problem.free, g, 0.0)


def smooth_model(problem: Problem, point: Point) -> Model:
    """Value, gradient (n+1,) and Hessian (4, n+1), in bands, of the smooth part of E_free."""

    def fun(step):
        return smooth_energy(problem, point, step)

    model = banded.local_model(fun, jnp.zeros_like(point.shift), HALF_BANDWIDTH)
    gradient = jnp.where(problem.free, model.gradient, 0.0)
    return Model(model.value, gradient, banded.masked(model.bands, problem.free))


def radius_curvature(problem: Problem, point: Point) -> Array:
    """(n,) dE/dX_i times the second derivative of X_i by t_i (eq. 22).

    With X a linear function of the thicknesses the smooth energy would be a sum
    of squares: the Hessian less :func:`between_nodes` of these weights is that
    of Gauss and Newton, and positive definite.
    """
    X = sums.radii(problem.rest, problem.sums, point.thickness)

    def energy(X):
        samples = sums.sample_contour(problem.rest, problem.sums, point, X)
        return integrate_smooth(sums.sample_free(samples, problem.free), problem.material)

    bend = 0.75 * X / point.thickness**2
    return jnp.where(problem.loose, jax.grad(energy)(X) * bend, 0.0)


def between_nodes(weights: Array, free: Array) -> Array:
    """D^T diag(weights) D for D = diff on the free nodes, in bands: a quadratic of thicknesses."""
    diagonal = jnp.pad(weights, (0, 1)) + jnp.pad(weights, (1, 0))
    coupling = jnp.pad(jnp.where(free[1:] & free[:-1], -weights, 0.0), (0, 1))
    bands = jnp.stack([jnp.where(free, diagonal, 0.0), coupling])
    return jnp.pad(bands, ((0, HALF_BANDWIDTH - 1), (0, 0)))


def to_nodes(forces: Array) -> Array:
    """D^T forces: what forces on the thicknesses (n,) do to the nodes (n+1,)."""
    return jnp.pad(forces, (1, 0)) - jnp.pad(forces, (0, 1))


class Stiffness(NamedTuple):
    """A factored Hessian, what was added to it included.

    Attributes
    ----------
    factor : Factor
        Of the matrix; with the upper end held if ``tip`` is there.
    tip : Tip or None
        How the upper end gives way.
    positive : bool
        Whether the matrix is positive definite.
    """

    factor: Factor
    tip: Tip | None
    positive: Array


class Tip(NamedTuple):
    """The upper end: how all nodes follow (n+1,) when it is lifted by 1, and the force it takes."""

    follow: Array
    stiffness: Array


def stiffness(
    problem: Problem, point: Point, bands: Array, between: Array, at_nodes: Array
) -> Stiffness:
    """Factor H + D^T diag(between) D + diag(at_nodes), given H in bands.

    In the heights bending is a sixth-order operator, and on fine grids the
    rounding of its entries hides how softly a free upper end gives way.  From
    thicknesses that is known: so there the upper end is eliminated last, with a
    pivot that comes from a Hessian-vector product.
    """
    bands = bands + between_nodes(between, problem.free)
    bands = bands + jnp.pad(jnp.where(problem.free, at_nodes, 0.0)[None], _DIAGONAL)
    if problem.slices < _FINE:
        factor = banded.factorize(bands)
        return Stiffness(factor, None, factor.positive)
    loose_end, end = problem.free[-1], _is_end(at_nodes)
    factor = banded.factorize(banded.masked(bands, problem.free & ~end))
    last = jnp.stack([bands[k, -1 - k] for k in range(HALF_BANDWIDTH, 0, -1)])
    coupling = jnp.pad(last, (bands.shape[1] - 1 - HALF_BANDWIDTH, 1))
    follow = banded.solve(factor, jnp.where(problem.free & loose_end & ~end, -coupling, 0.0))
    follow = jnp.where(end, jnp.where(loose_end, 1.0, 0.0), follow)

    def slope(step):
        return jax.grad(smooth_energy, argnums=2)(problem, point, step)

    _, force = jax.jvp(slope, (jnp.zeros_like(follow),), (follow,))
    softness = follow @ force + between @ jnp.diff(follow) ** 2 + at_nodes @ follow**2
    softness = jnp.where(loose_end, softness, 1.0)
    return Stiffness(factor, Tip(follow, softness), factor.positive & (softness > 0))


def relaxed(stiff: Stiffness, force: Array) -> Array:
    """H^-1 force, for force (n+1,)."""
    if stiff.tip is None:
        return banded.solve(stiff.factor, force)
    held = banded.solve(stiff.factor, jnp.where(_is_end(force), 0.0, force))
    return held + stiff.tip.follow * (stiff.tip.follow @ force / stiff.tip.stiffness)


def _is_end(nodes: Array) -> Array:
    return jnp.arange(nodes.shape[0]) == nodes.shape[0] - 1
