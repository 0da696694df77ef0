"""Friction and lower bound for minimisers of smooth functions, in stages.

Friction is smoothed as sqrt(d^2 + eps^2) with eps stepped down.  Then the nodes
that hardly moved are pinned at rest, the others keep their sign of friction,
and the energy is smooth as it is; pins are moved until they agree with the
forces.  Below the lower bound of thickness the energy goes on with a steep penalty
instead of infinity, at which line searches break down.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp

from jaxclay.numerics.arrays import Array
from jaxclay.schemes.base import SMALL, Forces, no_forces
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.sums import Displaced

_PINNINGS = 10
_PENALTY = 1e3  # first weight of the lower bound's penalty over k; grows as eps falls


class Stage(NamedTuple):
    """A stage of the solve.

    Attributes
    ----------
    base : Displaced
        Where it starts.
    number : int
        From 0; the rungs of the ladder first, then the pinnings.
    signs : (n+1,) array
        Friction's sign at the nodes that move, while pinning.
    pinned : (n+1,) bool array
        Free nodes that are kept at rest.
    ladder : (m,) array
        The eps of each smoothed stage, over the unit l.
    """

    base: Displaced
    number: Array
    signs: Array
    pinned: Array
    ladder: Array

    @property
    def pinning(self) -> Array:
        """Whether friction is as it is, with nodes pinned, rather than smoothed."""
        return self.number >= self.ladder.shape[0]

    @property
    def eps(self) -> Array:
        """Friction's smoothing, the last of the ladder while pinning."""
        return self.ladder[self._rung]

    @property
    def last(self) -> Array:
        """Whether there shall be no other."""
        return self.number >= self.ladder.shape[0] + _PINNINGS

    @property
    def _rung(self) -> Array:
        return jnp.minimum(self.number, self.ladder.shape[0] - 1)

    def moves(self, problem: Problem) -> Array:
        """(n+1,) nodes that this stage moves."""
        return problem.free & ~self.pinned

    def friction(self, problem: Problem, shift: Array) -> Array:
        """Friction's energy at the free nodes, smoothed or with the signs kept."""
        smoothed = jnp.sqrt(shift**2 + self.eps**2)
        sizes = jnp.where(self.pinning, self.signs * shift, smoothed)
        return jnp.sum(problem.friction_limit * sizes)

    def penalty(self, problem: Problem, thickness: Array) -> Array:
        """What lying below the lower bound costs; steeper from rung to rung."""
        weight = _PENALTY * problem.material.k * 10.0**self._rung
        below = jnp.maximum(problem.floor - thickness, 0.0) / problem.rest.thickness
        return weight / 2 * jnp.sum(problem.sums.width * below**2)

    def energy(self, problem: Problem, point: Displaced) -> Array:
        """E_free with this stage's friction and the lower bound's penalty; finite everywhere."""
        # Half the lower bound is far outside, but the radius is still finite there.
        kept = jnp.maximum(point.thickness, problem.floor / 2)
        smooth = problem.free_smooth(Displaced(kept, point.shift))
        kinks = self.friction(problem, point.shift)
        return smooth + kinks + self.penalty(problem, point.thickness)

    def forces(self, problem: Problem, _point: Displaced) -> Forces:
        """None are known."""
        return no_forces(problem)

    def left(self, problem: Problem, point: Displaced, tolerance: Array) -> Array:
        """Energy that may be left to gain when the stage ends.

        The tolerance of E_free, or while friction is smoothed a share of what that changes.
        """
        smoothing = self.eps * jnp.sum(problem.friction_limit)
        energy = tolerance * jnp.maximum(problem.free_terms(point).total, SMALL)
        return jnp.maximum(energy, jnp.where(self.pinning, 0.0, 1e-2 * smoothing))


def first_stage(start: Displaced, ladder: tuple[float, ...]) -> Stage:
    """The widest smoothing."""
    nothing = jnp.zeros_like(start.shift)
    return Stage(start, jnp.asarray(0), nothing, nothing.astype(bool), jnp.asarray(ladder))


def next_stage(problem: Problem, point: Displaced, stage: Stage) -> tuple[Stage, Array]:
    """The next eps; after the last the pins.  Also whether these agree with the forces."""
    limit, d, rungs = problem.friction_limit, point.shift, stage.ladder.shape[0]
    number = stage.number + 1
    g = problem.system.gradient(point)
    rests = jnp.abs(d) <= 10 * stage.ladder[-1]
    crossed = stage.signs * d < 0
    leaves = stage.pinned & (jnp.abs(g) > limit)
    pinned = jnp.where(number == rungs, rests, (stage.pinned & ~leaves) | crossed)
    pinned = pinned & problem.free & (number >= rungs)
    agrees = (number > rungs) & jnp.all(pinned == stage.pinned)
    signs = jnp.where(pinned, 0.0, jnp.where(d == 0, -jnp.sign(g), jnp.sign(d)))
    base = problem.put_to_rest(point, pinned)
    return stage._replace(base=base, number=number, signs=signs, pinned=pinned), agrees
