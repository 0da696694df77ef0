"""How a minimum changes with the problem: the implicit function theorem for splines.

Where clay moves friction's force stays; where it rests it goes on resting, and Gauss
points at the lower bound stay on it: penalties see to both.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxclay.methods.loop import Outcome
from jaxclay.numerics.arrays import Array
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.space import Displaced

_AT_REST = 1e-12  # over the unit l
_AT_BOUND = 1e-9  # slack over Y0_u
_PENALTY = 1e6  # over k


def of_splines(problem: SplineProblem, change: SplineProblem, outcome: Outcome) -> Displaced:
    """The point's change for a change of the problem."""
    point, forces = outcome.point, outcome.forces
    rests = jnp.abs(point.shift) <= _AT_REST
    limit, loose = problem.friction_limit, problem.loose
    touches = loose & (problem.slack(point) <= _AT_BOUND * problem.rest_thickness)
    stiff = _PENALTY * problem.material.k
    hold = jnp.where(touches, stiff * problem.space.weight, 0.0)
    penalties = jnp.where(rests & (limit > 0), stiff * problem.space.friction_weight, 0.0)
    lam = jnp.where(rests, jnp.clip(forces.friction, -limit, limit), 0.0)
    signs = jnp.where(rests, 0.0, jnp.sign(point.shift))

    def placed(problem: SplineProblem) -> Displaced:
        return problem.point(jnp.where(problem.fixed, problem.shift, point.coefficients))

    def force(problem: SplineProblem) -> Array:
        """What would move the free coefficients if the problem changed around them."""
        at = placed(problem)
        friction = problem.friction_limit * signs + lam + penalties * at.shift
        below = hold * problem.slack(at)
        return (
            problem.smooth_model(at).gradient
            + problem.from_shift(friction)
            + problem.from_thickness(below)
        )

    _, rate = jax.jvp(force, (problem,), (change,))
    model = problem.smooth_model(point)
    factor = problem.stiffness(point, model.bands, hold, penalties)
    step = -problem.solved(factor, jnp.where(problem.free, rate, 0.0))
    coefficients = jnp.where(problem.fixed, change.shift, step)

    def answer(problem: SplineProblem, free: Array) -> Displaced:
        return problem.point(jnp.where(problem.fixed, problem.shift, free))

    _, tangent = jax.jvp(answer, (problem, point.coefficients), (change, coefficients))
    return tangent
