"""The local model of the smooth energy at a point: value, gradient, banded Hessian.

All are taken with respect to a step of the nodes (n+1,), at fixed nodes masked
out: gradients are 0 there and matrices carry the identity.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxclay import banded
from jaxclay.banded import Factor, Model
from jaxclay.clay import Array
from jaxclay.energy import integrate
from jaxclay.problem import Problem
from jaxclay.schemes import paper
from jaxclay.schemes.paper import Point

HALF_BANDWIDTH = 3  # bending couples Y_{i-1} .. Y_{i+2}


def smooth_energy(problem: Problem, point: Point, step: Array) -> Array:
    """Strain, tension and bending after every node has moved by ``step``, without the fixed."""
    return problem.free_terms(point.moved(step)).smooth


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
    X = paper.radii(point.thickness, problem.rest.r0, problem.slices)

    def energy(X):
        samples = paper.sample_contour(problem.rest, point, X)
        return integrate(paper.sample_free(samples, problem.free), problem.material).smooth

    def radius(t):
        return paper.radii(t, problem.rest.r0, problem.slices)

    bend = jax.vmap(jax.grad(jax.grad(radius)))(point.thickness)
    return jnp.where(problem.loose, jax.grad(energy)(X) * bend, 0.0)


def between_nodes(weights: Array, free: Array) -> Array:
    """D^T diag(weights) D for D = diff on the free nodes, in bands: a quadratic of thicknesses."""
    diagonal = jnp.pad(weights, (0, 1)) + jnp.pad(weights, (1, 0))
    none = jnp.zeros((HALF_BANDWIDTH - 1, diagonal.shape[0]))
    coupling = jnp.where(free[1:] & free[:-1], -weights, 0.0)
    bands = [jnp.where(free, diagonal, 0.0)[None], jnp.pad(coupling, (0, 1))[None], none]
    return jnp.concatenate(bands)


def to_nodes(forces: Array) -> Array:
    """D^T forces: what forces on the thicknesses (n,) do to the nodes (n+1,)."""
    return jnp.pad(forces, (1, 0)) - jnp.pad(forces, (0, 1))


class Stiffness(NamedTuple):
    """A factored Hessian, what was added to it included.

    Attributes
    ----------
    factor : Factor
        With the upper end held.
    tip : (n+1,) array
        How all nodes follow when the upper end is lifted by 1.
    tip_stiffness : scalar
        The force that takes.
    positive : bool
        Whether the matrix is positive definite.
    """

    factor: Factor
    tip: Array
    tip_stiffness: Array
    positive: Array


def stiffness(
    problem: Problem, point: Point, bands: Array, between: Array, at_nodes: Array
) -> Stiffness:
    """Factor H + D^T diag(between) D + diag(at_nodes), given H in bands.

    In the heights bending is a sixth-order operator, and on fine grids the
    rounding of its entries hides how softly a free upper end gives way.  From
    thicknesses that is known: so the upper end is eliminated last, with a pivot
    that comes from a Hessian-vector product.
    """
    bands = bands + between_nodes(between, problem.free)
    bands = bands.at[0].add(jnp.where(problem.free, at_nodes, 0.0))
    loose_end = problem.free[-1]
    held = problem.free.at[-1].set(False)
    factor = banded.factorize(banded.masked(bands, held))
    last = jnp.stack([bands[k, bands.shape[1] - 1 - k] for k in range(HALF_BANDWIDTH, 0, -1)])
    coupling = jnp.zeros_like(bands[0]).at[-1 - HALF_BANDWIDTH : -1].set(last)
    follow = banded.solve(factor, jnp.where(held & loose_end, -coupling, 0.0))
    tip = follow.at[-1].set(jnp.where(loose_end, 1.0, 0.0))

    def slope(step):
        return jax.grad(smooth_energy, argnums=2)(problem, point, step)

    _, force = jax.jvp(slope, (jnp.zeros_like(tip),), (tip,))
    softness = tip @ force + between @ jnp.diff(tip) ** 2 + at_nodes @ tip**2
    softness = jnp.where(loose_end, softness, 1.0)
    return Stiffness(factor, tip, softness, factor.positive & (softness > 0))


def relaxed(stiff: Stiffness, force: Array) -> Array:
    """H^-1 force, for force (n+1,)."""
    held = banded.solve(stiff.factor, force.at[-1].set(0.0))
    return held + stiff.tip * (stiff.tip @ force / stiff.tip_stiffness)


def hessian(problem: Problem, point: Point) -> Array:
    """(n+1, n+1) Hessian H of the smooth energy, dense."""
    H = jax.hessian(smooth_energy, argnums=2)(problem, point, jnp.zeros_like(point.shift))
    return masked(H, problem.free)


def gauss_newton(problem: Problem, point: Point) -> Array:
    """(n+1, n+1) J^T J of the energy as a sum of squares: always positive definite."""

    def residuals(step):
        s = paper.sample(problem.rest, point.moved(step))
        m = problem.material
        weighted = [
            jnp.sqrt(m.k) * (s.stretch - 1),
            jnp.sqrt(2 * m.alpha) * s.X_u,
            jnp.sqrt(2 * m.alpha) * s.Y_u,
            jnp.sqrt(2 * m.beta) * s.X_uu,
            jnp.sqrt(2 * m.beta) * s.Y_uu,
        ]
        return jnp.concatenate(weighted) * jnp.tile(jnp.sqrt(s.weight), len(weighted))

    J = jax.jacfwd(residuals)(jnp.zeros_like(point.shift))
    return masked(J.T @ J, problem.free)


def masked(matrix: Array, free: Array) -> Array:
    """The matrix on the free nodes, the identity elsewhere."""
    return jnp.where(free[:, None] & free[None, :], matrix, jnp.eye(free.shape[0]))
