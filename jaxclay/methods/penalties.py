"""Friction and lower bound on splines as penalties with multipliers, for smooth minimisers.

Points of a spline do not move one by one, so that none can be pinned.  Instead
friction, mu |d|, is seen through a penalty of stiffness mu / eps that slips where it
would have to hold more than mu:

    max over |l| <= mu of  l d - eps / (2 mu) (l - lam)^2,

which is smooth in d and has its minimum where E_total has as soon as lam is
friction's force there.  Each stage ends by taking lam from its penalties (method of
multipliers: Rockafellar 1976), with eps stepped down first and then kept until the
forces agree with the displacements.  The lower bound of thickness is a penalty with a
multiplier of its own, which only pushes.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp

from jaxclay.numerics.arrays import Array
from jaxclay.schemes.base import DECREMENT, SMALL, Forces
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.space import Displaced

_LADDER = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)  # eps, over the unit l
_MAY_END = 1e-7  # from which stages end at the tolerance, and the solve may
_ROUNDS = 60  # at most, at the last eps
_BOUND = 1e3  # first stiffness of the lower bound over k; grows as eps falls
_RESTS = 1e-2  # displacement over eps within which clay is put back to rest
_AGREES = 1e-2  # of what the certificate accepts


class Penalties(NamedTuple):
    """A stage of the solve.

    Attributes
    ----------
    base : Displaced
        Where it starts.
    number : int
        From 0.
    friction : (S * 6,) array
        lam / mu, between -1 and 1.
    floor : (S * 4,) array
        The lower bound's multiplier, energy over stretch and clay; not negative.
    """

    base: Displaced
    number: Array
    friction: Array
    floor: Array

    @property
    def eps(self) -> Array:
        """Displacement over the unit l at which friction's penalties slip."""
        return jnp.asarray(_LADDER)[self._rung]

    @property
    def may_end(self) -> Array:
        """Whether the stage may be the last."""
        return self.eps <= _MAY_END

    @property
    def last(self) -> Array:
        """Whether there shall be no other."""
        return self.number >= len(_LADDER) + _ROUNDS

    @property
    def _rung(self) -> Array:
        return jnp.minimum(self.number, len(_LADDER) - 1)

    def moves(self, problem: SplineProblem) -> Array:
        """(N,) coefficients that this stage moves."""
        return problem.free

    def held(self, shift: Array) -> Array:
        """(S * 6,) force of friction's penalties over mu."""
        return jnp.clip(self.friction + shift / self.eps, -1.0, 1.0)

    def pushed(self, problem: SplineProblem, point: Displaced) -> Array:
        """(S * 4,) force of the lower bound's penalties, energy over stretch and clay."""
        stretch = problem.slack(point) / problem.rest_thickness
        return jnp.maximum(self.floor - self._bound_stiffness(problem) * stretch, 0.0)

    def _bound_stiffness(self, problem: SplineProblem) -> Array:
        return _BOUND * problem.material.k * 10.0**self._rung

    def energy(self, problem: SplineProblem, point: Displaced) -> Array:
        """E_free with friction and lower bound as penalties; finite everywhere."""
        # Half the lower bound is far outside, but the radius is still finite there.
        Y_u = jnp.maximum(point.thickness, problem.floor / 2)
        slopes = jnp.concatenate([Y_u[:, None], point.slopes[:, 1:]], axis=1)
        held, z = self.held(point.shift), self.pushed(problem, point)
        friction = held * point.shift - self.eps / 2 * (held - self.friction) ** 2
        floor = (z**2 - self.floor**2) / (2 * self._bound_stiffness(problem))
        floor = jnp.where(problem.loose, problem.space.weight * floor, 0.0)
        smooth = problem.free_smooth(point._replace(slopes=slopes))
        return smooth + problem.total(problem.friction_limit * friction, floor)

    def curvatures(self, problem: SplineProblem) -> tuple[Array, Array]:
        """What the penalties add at the base by Y_u, (S * 4,), and by displacement, (S * 6,)."""
        slips = jnp.abs(self.friction + self.base.shift / self.eps) > 1
        friction = jnp.where(slips, 0.0, problem.friction_limit / self.eps)
        stiffness = self._bound_stiffness(problem) * problem.space.weight
        pushes = problem.loose & (self.pushed(problem, self.base) > 0)
        return jnp.where(pushes, stiffness / problem.rest_thickness**2, 0.0), friction

    def forces(self, problem: SplineProblem, point: Displaced) -> Forces:
        """What the penalties hold."""
        floor = problem.space.weight * self.pushed(problem, point) / problem.rest_thickness
        friction = problem.friction_limit * self.held(point.shift)
        return Forces(friction, jnp.where(problem.loose, floor, 0.0))

    def left(self, problem: SplineProblem, point: Displaced, tolerance: Array) -> Array:
        """Energy that may be left to gain when the stage ends.

        The tolerance of E_free, or while eps is large a share of what that changes.
        """
        smoothing = self.eps * jnp.sum(problem.friction_limit)
        energy = tolerance * jnp.maximum(problem.free_terms(point).total, SMALL)
        return jnp.maximum(energy, jnp.where(self.may_end, 0.0, 1e-2 * smoothing))


def first_penalties(problem: SplineProblem, start: Displaced) -> Penalties:
    """The softest ones, without multipliers."""
    friction, floor = jnp.zeros_like(problem.friction_limit), jnp.zeros_like(problem.floor)
    return Penalties(start, jnp.asarray(0), friction, floor)


def next_penalties(
    problem: SplineProblem, point: Displaced, stage: Penalties
) -> tuple[Penalties, Array]:
    """The next eps with the penalties' forces for multipliers; also whether these agree.

    They do where they leave no gap: friction's is mu |d| - lam d.
    """
    friction, floor = stage.held(point.shift), stage.pushed(problem, point)
    rests = (jnp.abs(friction) < 1) & (jnp.abs(point.shift) <= _RESTS * stage.eps)
    point = problem.put_to_rest(point, rests & stage.may_end)
    slack = problem.slack(point) / problem.rest_thickness
    apart = problem.friction_limit * (jnp.abs(point.shift) - friction * point.shift)
    weight = jnp.where(problem.loose, problem.space.weight, 0.0)
    gap = problem.total(apart, weight * floor * jnp.abs(slack))
    energy = jnp.maximum(problem.free_terms(point).total, SMALL)
    agrees = stage.may_end & (gap <= _AGREES * DECREMENT * energy)
    following = stage._replace(base=point, number=stage.number + 1, friction=friction, floor=floor)
    return following, agrees
