"""The local model of the smooth energy at a point: gradient, Hessian, Gauss-Newton.

All are taken with respect to a step of the nodes (n+1,), at fixed nodes masked
out: gradients are 0 there and matrices carry the identity.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxclay.clay import Array
from jaxclay.problem import Problem
from jaxclay.schemes import paper
from jaxclay.schemes.paper import Point


def smooth_energy(problem: Problem, point: Point, step: Array) -> Array:
    """Strain, tension and bending after every node has moved by ``step``."""
    return problem.terms(point.moved(step)).smooth


def gradient(problem: Problem, point: Point) -> Array:
    """(n+1,) gradient g of the smooth energy."""
    g = jax.grad(smooth_energy, argnums=2)(problem, point, jnp.zeros_like(point.shift))
    return jnp.where(problem.free, g, 0.0)


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


def between_nodes(weights: Array) -> Array:
    """D^T diag(weights) D for D = diff, (n+1, n+1): a quadratic of the thicknesses."""
    diagonal = jnp.pad(weights, (0, 1)) + jnp.pad(weights, (1, 0))
    return jnp.diag(diagonal) - jnp.diag(weights, 1) - jnp.diag(weights, -1)


def to_nodes(forces: Array) -> Array:
    """D^T forces: what forces on the thicknesses (n,) do to the nodes (n+1,)."""
    return jnp.pad(forces, (1, 0)) - jnp.pad(forces, (0, 1))
