"""Derivatives through a minimum, from the implicit function theorem.

Where clay moves, the gradient of the energy stays 0 when the problem changes
a little; where it rests, it goes on resting; slices at the lower bound stay on it.
So one linear solve with the Hessian at the answer replaces differentiating the
iterations, and the derivative is that of the minimum whatever method found it.
It jumps where a node starts to move or a band's edge passes a node.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.methods.loop import Outcome, Start, run
from jaxclay.numerics import banded
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.host import promoting
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.sums import Displaced
from jaxclay.schemes.system import Linear
from jaxclay.solve.certificate import at_lower_bound
from jaxclay.solve.spline_derivative import of_splines

_HOLD = 1e6  # stiffness that keeps slices at the lower bound, over the Hessian's own


@partial(jax.custom_jvp, nondiff_argnums=(4,))
def solve_implicitly(
    problem: Problem, start: Start, settings: Any, feasible: Array, method: str
) -> Outcome:
    """:func:`jaxclay.methods.loop.run`, whose point can be differentiated by the problem."""
    return run(problem, start, settings, feasible, method)


@solve_implicitly.defjvp
@promoting
def _solve_jvp(method, primals, tangents):
    (problem, start, settings, feasible), change = primals, tangents[0]
    # The rule for derivatives of this rule is the rule itself: so second ones are right too.
    outcome = solve_implicitly(problem, start, settings, feasible, method)
    rule: Any = of_splines if isinstance(problem, SplineProblem) else _of_heights
    tangent = jax.tree.map(_no_change, outcome)
    return outcome, tangent._replace(point=rule(problem, change, outcome))


def _of_heights(problem: Problem, change: Problem, outcome: Outcome) -> Displaced:
    """How the minimum's point on the paper's scheme changes with the problem."""
    point, system = outcome.point, problem.system
    moving = problem.free & (point.shift != 0)
    bands = system.smooth_model(point).bands
    hold = _HOLD * at_lower_bound(system, point) * system.own_stiffness(bands)[1]

    def force(problem: Problem) -> Array:
        """What would move the free nodes if the problem changed around them."""
        system = problem.system
        shift = jnp.where(problem.fixed, problem.shift, point.shift)
        here = Displaced(system.rest_thickness + system.thickness_change(shift), shift)
        friction = system.friction_limit * jnp.sign(point.shift)
        return system.gradient(here) + friction + system.from_thickness(hold * system.slack(here))

    _, rate = jax.jvp(force, (problem,), (change,))
    linear = Linear(hold, 0 * point.shift, rate, 1.0 * moving)
    matrix = system.matrix(bands, linear)
    step = -banded.solve_exactly(matrix, jnp.where(moving, rate, 0.0))
    shift = jnp.where(problem.fixed, change.shift, jnp.where(moving, step, 0.0))
    return Displaced(change.rest.thickness + jnp.diff(shift), shift)


def _no_change(leaf: Array) -> Array:
    if jnp.issubdtype(leaf.dtype, jnp.inexact):
        return jnp.zeros_like(leaf)
    return np.zeros(leaf.shape, jax.dtypes.float0)
