"""Coordinates: what a minimiser's unknowns mean, and what they must obey."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple, Protocol

import jax
import jax.numpy as jnp

from jaxclay.methods.penalties import Penalties
from jaxclay.methods.stages import Stage
from jaxclay.numerics import banded
from jaxclay.numerics.arrays import Array
from jaxclay.schemes.base import AnyDisplaced, AnyProblem
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.system import Linear

_POWERS = 20
AnyStage = Any  # Stage or Penalties


class Bounds(Protocol):
    """A set of allowed x."""

    def nearest(self, x: Array) -> Array:
        """The allowed point nearest to x."""
        ...

    def scaled(self, unit: Array) -> Bounds:
        """The same set of x / unit."""
        ...


class Unbounded(NamedTuple):
    """Every x."""

    def nearest(self, x: Array) -> Array:
        """The point itself."""
        return x

    def scaled(self, unit: Array) -> Unbounded:
        """The same."""
        return self


class Coordinates(NamedTuple):
    """What a stage's unknowns x mean; x = 0 is its base.

    Attributes
    ----------
    start : (m,) array
        Where to start: 0, or what is nearest to it within the bounds.
    scale : (n+1, m) or (N, m) array
        Step of the nodes or coefficients for a unit of each unknown; () for each its own.
    curvature : scalar
        Least curvature of the energy along x, about.
    bounds : Bounds
        What x must obey.
    """

    start: Array
    scale: Array
    curvature: Array
    bounds: Bounds = Unbounded()

    def point(self, problem: AnyProblem, stage: AnyStage, x: Array) -> AnyDisplaced:
        """The shape at x."""
        step = self.scale @ x if self.scale.ndim else self.scale * x
        return problem.moved(stage.base, jnp.where(stage.moves(problem), step, 0.0))

    def energy(self, problem: AnyProblem, stage: AnyStage) -> Callable[[Array], Array]:
        """The stage's energy as a function of x."""
        return lambda x: stage.energy(problem, self.point(problem, stage, x))


Chart = Callable[[Any, AnyStage], Coordinates]


def heights(problem: Problem, stage: Stage) -> Coordinates:
    """The nodes' heights as they are."""
    return Coordinates(
        jnp.zeros_like(problem.shift), jnp.ones(()), problem.material.k / problem.slices
    )


def preconditioned(problem: Problem, stage: Stage) -> Coordinates:
    """L^-T of the Hessian where the stage starts, or of Gauss-Newton's if it is not definite."""
    limit, eps = problem.friction_limit, stage.eps
    kink = limit * eps**2 / (stage.base.shift**2 + eps**2) ** 1.5
    curvature = jnp.where(stage.pinning, 0.0, kink)
    system = problem.system
    bands = system.smooth_model(stage.base).bands
    factor, fallback = (
        jnp.linalg.cholesky(banded.dense(system.matrix(bands, Linear(*linear))))
        for linear in ((0.0, curvature, 0.0, system.free), (-bands[3], curvature, 0.0, system.free))
    )
    factor = jnp.where(jnp.all(jnp.isfinite(factor)), factor, fallback)
    inverse = jax.scipy.linalg.solve_triangular(factor, jnp.eye(factor.shape[0]), lower=True)
    return Coordinates(jnp.zeros_like(limit), inverse.T, jnp.ones(()))


def coefficients(problem: SplineProblem, _stage: Penalties) -> Coordinates:
    """A spline's coefficients as they are."""
    count = problem.shift.shape[0]
    return Coordinates(jnp.zeros_like(problem.shift), jnp.ones(()), problem.material.k / count)


def preconditioned_splines(problem: SplineProblem, stage: Penalties) -> Coordinates:
    """The factor of the Hessian's inverse where the stage starts, penalties included.

    Of Gauss and Newton's if it is not definite.  A column of the inverse is what a
    unit force on a coefficient does.
    """
    point, penalties = stage.base, stage.curvatures(problem)
    matrix = problem.smooth_model(point).bands
    definite = problem.stiffness(point, matrix, *penalties).positive
    stiff = problem.stiffness(point, matrix, *penalties, gauss=~definite)
    inverse = jax.vmap(partial(problem.solved, stiff))(jnp.eye(problem.shift.shape[0]))
    factor = jnp.linalg.cholesky(inverse, symmetrize_input=True)
    return Coordinates(jnp.zeros_like(problem.shift), factor, jnp.ones(()))


def normalised(chart: Chart) -> Chart:
    """The same coordinates in units in which the energy's largest curvature starts at about 1.

    A first step along the gradient then has the right length.
    """

    def chosen(problem: AnyProblem, stage: AnyStage) -> Coordinates:
        raw = chart(problem, stage)
        largest = _largest_curvature(raw.energy(problem, stage), raw.start)
        usable = jnp.isfinite(largest) & (largest > raw.curvature)
        unit = jnp.sqrt(1 / jnp.where(usable, largest, raw.curvature))
        bounds = raw.bounds.scaled(unit)
        return Coordinates(raw.start / unit, raw.scale * unit, raw.curvature * unit**2, bounds)

    return chosen


def _largest_curvature(energy: Callable[[Array], Array], x: Array) -> Array:
    """The Hessian's largest eigenvalue at x, from below, by power iterations."""

    def grown(_, carry: tuple[Array, Array]) -> tuple[Array, Array]:
        v, size = carry
        v = jax.jvp(jax.grad(energy), (x,), (v / size,))[1]
        return v, jnp.maximum(jnp.linalg.norm(v), 1e-300)

    v = jax.random.normal(jax.random.key(0), x.shape, x.dtype)
    return jax.lax.fori_loop(0, _POWERS, grown, (v, jnp.linalg.norm(v)))[1]
