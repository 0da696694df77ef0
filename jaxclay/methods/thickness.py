"""Thicknesses as unknowns, each with a lower bound.

The nodes that a stage does not move, fixed or pinned, cut the clay into
segments.  Between two of them the thicknesses add up to a given sum; above the
last one they are free.  The unknowns are changes of the stretch t_i / t0_i from
where the stage starts; the nodes follow by sums from the segment's lower end.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax.numpy as jnp

from jaxclay.methods.coordinates import Coordinates
from jaxclay.methods.smoothed import DescentSettings
from jaxclay.methods.stages import Stage
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.host import pytree
from jaxclay.schemes.problem import Problem

EPS = (1e-2, 1e-3, 1e-4, 1e-5)  # friction's smoothing, over the unit l; the pins do the rest


@pytree
@dataclasses.dataclass(frozen=True)
class BoundedSettings(DescentSettings):
    """tolerance: energy to be gained, relative to E_free, at which a stage ends."""

    max_iterations: Array = 20_000
    tolerance: Array = 1e-13


class Segments(NamedTuple):
    """The slices between the nodes that do not move.

    Attributes
    ----------
    number : (n,) int array
        Which segment a slice belongs to, rising from the bottom.
    summed : (n,) bool array
        Whether the segment ends at a node that does not move.
    """

    number: Array
    summed: Array

    @property
    def same(self) -> Array:
        """(n, n) whether two slices share a segment."""
        return self.number[:, None] == self.number[None, :]

    def running(self, values: Array) -> Array:
        """Sums of values (n, ...) along axis 0 from the start of each slice's segment."""
        sums = jnp.concatenate([jnp.zeros_like(values[:1]), jnp.cumsum(values, axis=0)])
        first = jnp.searchsorted(self.number, self.number, side="left")
        return sums[1:] - sums[first]


class Box(NamedTuple):
    """The x between lower and upper, (n,) arrays."""

    lower: Array
    upper: Array

    def nearest(self, x: Array) -> Array:
        """The allowed point nearest to x."""
        return jnp.clip(x, self.lower, self.upper)

    def scaled(self, unit: Array) -> Box:
        """The same set of x / unit."""
        return Box(self.lower / unit, self.upper / unit)


class Simplex(NamedTuple):
    """The x >= least, with sum weight x = 0 in every summed segment.

    Attributes
    ----------
    least : (n,) array
        Lower bound of x; not above 0.
    weight : (n,) array
        Thickness for a unit of x, up to a common factor.
    segments : Segments
    """

    least: Array
    weight: Array
    segments: Segments

    def nearest(self, x: Array) -> Array:
        """The allowed point nearest to x (Duchi et al. 2008, here with weights).

        It is least + max(x - least - m weight, 0).  Each group of a segment's slices
        that reach the lower bound last gives an estimate of the multiplier m, as if only
        those lay above it; the largest estimate is m itself.
        """
        parts, w, above = self.segments, self.weight, x - self.least
        order = jnp.lexsort((-above / w, parts.number))
        total = -jnp.sum(jnp.where(parts.same, w * self.least, 0.0), axis=1)
        estimates = (parts.running((w * above)[order]) - total) / parts.running((w**2)[order])
        m = jnp.max(jnp.where(parts.same, estimates, -jnp.inf), axis=1)
        return self.least + jnp.maximum(above - jnp.where(parts.summed, m * w, 0.0), 0.0)

    def scaled(self, unit: Array) -> Simplex:
        """The same set of x / unit."""
        return self._replace(least=self.least / unit)


def segments(problem: Problem, stage: Stage) -> Segments:
    """The segments of a stage."""
    still = ~stage.moves(problem)
    number = jnp.cumsum(still[:-1])
    return Segments(number, (number < number[-1]) | still[-1])


def eliminated(problem: Problem, stage: Stage) -> Coordinates:
    """One slice of each summed segment follows from the others; bounds are a :class:`Box`.

    It is the slice with most slack where the stage starts.  It has no bound of its own:
    the stage's penalty keeps it above the lower bound.
    """
    parts, slack, rest = segments(problem, stage), _slack(problem, stage), problem.rest.thickness
    farthest = jnp.argmax(jnp.where(parts.same, slack, -jnp.inf), axis=1)
    follows = parts.summed & (farthest == jnp.arange(problem.slices))
    growth = (jnp.eye(problem.slices) - (parts.same & follows[:, None])) * rest
    box = Box(jnp.where(follows, -jnp.inf, -slack), jnp.full_like(slack, jnp.inf))
    return _coordinates(problem, parts, jnp.where(follows, 0.0, growth), box)


def summed(problem: Problem, stage: Stage) -> Coordinates:
    """All slices; bounds are a :class:`Simplex`.

    Pinning may leave a slice a little below the lower bound; then its bound is
    where it starts, so that the set is never empty.
    """
    parts, slack, rest = segments(problem, stage), _slack(problem, stage), problem.rest.thickness
    return _coordinates(
        problem, parts, jnp.diag(rest), Simplex(jnp.minimum(-slack, 0.0), rest, parts)
    )


def _slack(problem: Problem, stage: Stage) -> Array:
    """(n,) stretch above the lower bound where the stage starts."""
    return stage.base.thickness / problem.rest.thickness - problem.material.floor


def _coordinates(
    problem: Problem, parts: Segments, growth: Array, bounds: Box | Simplex
) -> Coordinates:
    """Coordinates from what a unit of each unknown does to the thicknesses, (n, m)."""
    scale = jnp.concatenate([jnp.zeros((1, growth.shape[1])), parts.running(growth)])
    start = bounds.nearest(jnp.zeros(growth.shape[1]))
    return Coordinates(start, scale, problem.material.k / problem.slices, bounds)
