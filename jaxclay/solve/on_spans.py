"""Finding the minimum in a problem's splines, certifying it, and the clay that it describes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.methods.loop import Outcome, Start, initial_guess
from jaxclay.model.energy import Terms
from jaxclay.numerics.arrays import Array, Bool, Float
from jaxclay.numerics.host import compiled, in_float64, is_transformed
from jaxclay.schemes import sums
from jaxclay.schemes.base import Forces
from jaxclay.schemes.slices.edges import with_edges
from jaxclay.schemes.spline import bspline
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.space import Space, space
from jaxclay.solve.certificate import Certificate, certify
from jaxclay.solve.implicit import solve_implicitly
from jaxclay.solve.solution import Derived, Solution, concluded
from jaxclay.solve.start import check_same_scheme

_PROBES = 9  # places of a span at which Y_u is looked at
_EPS = 1e-6  # friction's smoothing over l where a solve goes on


class SplineAnswer(NamedTuple):
    """All that a solve finds out.

    Whether Y_u ``rises`` everywhere, and ``shift`` (n+1,), the displacement at the nodes of the
    answer's clay.  Where it ``crosses`` zero within a span, ``space`` has friction's cells meet
    there, and a solve on that begins at ``start``.
    """

    outcome: Outcome
    certificate: Certificate
    rises: Array
    clay: Clay
    terms: Terms
    shift: Array
    crosses: Array
    space: Space
    start: Start


def minimize_on_spans(problem: SplineProblem, start: Any, settings: Any, method: str) -> Solution:
    """The minimum in the problem's splines."""

    def solve(problem: SplineProblem, start: Start) -> SplineAnswer:
        return in_float64("minimize", answered, problem, start, settings, method=method)

    problem, answer = solved(solve, problem, begin_from(problem, start))
    clay = answer.clay
    if not is_transformed(clay):
        clay = with_edges(clay, problem.sliced, answer.shift)
    derived = Derived(clay, answer.terms, problem.rough)
    found = answer.outcome, answer.certificate, problem.rough.feasible, ~answer.rises
    return concluded(problem, *found, method, derived)


def solved(
    solve: Callable[[SplineProblem, Start], SplineAnswer], problem: SplineProblem, start: Start
) -> tuple[SplineProblem, SplineAnswer]:
    """``solve``, again where the displacement changes its sign within a span."""
    first = solve(problem, start)
    broken = dataclasses.replace(problem, space=first.space)

    def again() -> SplineAnswer:
        new = solve(broken, first.start)
        total = first.outcome.iterations + new.outcome.iterations
        return new._replace(outcome=new.outcome._replace(iterations=total))

    if is_transformed(first):
        return broken, jax.lax.cond(first.crosses, again, lambda: first)
    return (broken, again()) if first.crosses else (problem, first)


def begin_from(problem: SplineProblem, start: Any) -> Start:
    """Where to start; see :func:`jaxclay.minimize`."""
    if start is None:
        return in_float64("minimize", _evenly, problem)
    check_same_scheme(problem, start)
    warm = isinstance(start, Solution)
    given = start.point if warm else start
    coefficients = getattr(given, "coefficients", given)
    if np.shape(coefficients) != np.shape(problem.shift):
        raise ValueError(
            f"start must hold one coefficient for each of {problem.shift.shape[0]}: got shape "
            f"{np.shape(coefficients)}; give an answer on the same degree and elements"
        )
    guess = in_float64("minimize", _from, problem, coefficients)
    return Start(guess.point, start.forces, np.asarray(True)) if warm else guess


@compiled()
def _evenly(problem: SplineProblem) -> Start:
    return initial_guess(problem, problem.point(problem.even()))


@compiled()
def _from(problem: SplineProblem, coefficients: Array) -> Start:
    return initial_guess(
        problem, problem.point(jnp.where(problem.fixed, problem.shift, coefficients))
    )


@compiled("method")
def answered(problem: SplineProblem, start: Start, settings: Any, *, method: str) -> SplineAnswer:
    """The method, and the certificate of where it ended."""
    feasible = problem.rough.feasible
    outcome = solve_implicitly(problem, jax.lax.stop_gradient(start), settings, feasible, method)
    return SplineAnswer(*_certified(problem, outcome), *_crossing(problem, outcome))


def _crossing(problem: SplineProblem, outcome: Outcome) -> tuple[Array, Space, Start]:
    """Whether the displacement changes its sign within a span, and what to solve then from where.

    Friction's density has a kink there, where its cells should meet.
    """
    coefficients = outcome.point.coefficients
    breaks = problem.space.crossings(jax.lax.stop_gradient(coefficients))
    crosses = jnp.any(breaks != 0.5) & problem.rough.feasible & outcome.finite
    old = problem.space
    broken = space(old.left, old.length, old.degree, breaks)
    problem = dataclasses.replace(problem, space=broken)
    point = problem.point(coefficients)
    friction = problem.friction_limit * point.shift / jnp.sqrt(point.shift**2 + _EPS**2)
    forces = Forces(friction, jnp.zeros_like(problem.floor))
    return crosses, broken, Start(point, forces, jnp.asarray(True))


def _certified(
    problem: SplineProblem, outcome: Outcome
) -> tuple[Outcome, Certificate, Array, Clay, Terms, Array]:
    """The outcome, at rest where there is none, and its certificate, shape and terms."""
    feasible = problem.rough.feasible
    rest = problem.point(jnp.zeros_like(problem.shift))
    point = jax.tree.map(lambda a, b: jnp.where(feasible, a, b), outcome.point, rest)
    outcome = outcome._replace(point=point)
    certificate = certify(*jax.lax.stop_gradient((problem, point, outcome.forces)))
    clay, shift = shape(problem, point.coefficients)
    rises = rising(problem, point.coefficients)
    certificate = dataclasses.replace(certificate, accepted=certificate.accepted & rises)
    return outcome, certificate, rises, clay, problem.terms(point), shift


def shape(
    problem: SplineProblem, coefficients: Float[Array, "N"]
) -> tuple[Clay, Float[Array, "nodes"]]:
    """The clay that coefficients (N,) describe, and the displacement at its nodes, over l.

    Its heights are the spline's, its edges those of the band.  The clay before where no shape
    obeys the lower bound.
    """
    on = problem.sliced
    free = problem.space.at(coefficients, on.rest.material)
    shift = jnp.where(on.rest.held(problem.band), on.shift, free)
    shift = jnp.where(problem.rough.feasible, shift, 0.0)
    thickness = jnp.where(on.banded & problem.rough.feasible, on.band_thickness,
                          on.rest.thickness + jnp.diff(shift))  # fmt: skip
    return on.shape(sums.Displaced(thickness, shift)), shift


def rising(problem: SplineProblem, coefficients: Float[Array, "N"]) -> Bool[Array, ""]:
    """Whether Y_u is positive between the Gauss points too, which alone see the lower bound."""
    splines, s = problem.space, jnp.arange(_PROBES) / (_PROBES - 1)
    length = splines.length[:, None]
    basis = bspline.basis(splines.length, splines.degree, s, (1,))[:, :, 0]
    slope = jnp.einsum("sga,sa->sg", basis, bspline.local(coefficients, splines.degree))
    slope += problem.rest.slope(jnp.clip(splines.left[:, None] + length * s, 0.0, 1.0))
    return jnp.all(jnp.where(length > 0, slope > 0, True))
