"""What a scheme is to the methods and to the judge."""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxclay.numerics.arrays import Array, namespace

AnyProblem = Any  # of either scheme: Problem or SplineProblem
AnyPoint = Any  # and its point

DECREMENT = 1e-10  # accepted, relative to max(E_free, SMALL)
SMALL = 1e-3


class Forces(NamedTuple):
    """Multipliers of the two kinds of kink and bound, energies over lengths.

    Attributes
    ----------
    friction : (n+1,) array
        lam, between -h mu and h mu; h mu sign(d_i) where clay moves.
    floor : (n,) array
        z >= 0, what holds a slice above its least thickness.
    """

    friction: Array
    floor: Array


class Pull(NamedTuple):
    """What a step asks of the linear model: curvatures beside the Hessian's own, and the force.

    ``shift`` times the Hessian's largest entry is added everywhere; where ``gauss`` is 1 the
    Hessian is that of Gauss and Newton.  ``energy`` is E_free, ``weight`` the barrier's.
    """

    floor: Array
    friction: Array
    shift: Array
    gauss: Array
    force: Array
    energy: Array
    weight: Array


def no_forces(problem: AnyProblem) -> Forces:
    """Zero multipliers."""
    xp = namespace(problem.friction_limit)
    return Forces(xp.zeros_like(problem.friction_limit), xp.zeros_like(problem.floor))


def lifted(problem: AnyProblem, point: AnyPoint) -> AnyPoint:
    """The point moved no further than needed for every slice to reach the floor."""
    xp = namespace(problem.shift, point)
    even = problem.evened(point, 1.0).thickness
    low = problem.loose & (point.thickness < problem.floor)
    gained = xp.where(low, even - point.thickness, 1.0)
    fraction = xp.where(low, (problem.floor - point.thickness) / gained, 0.0)
    return problem.evened(point, xp.clip(xp.max(fraction), 0.0, 1.0))
