"""Solving on one mesh, and judging the answer."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxclay import bernstein
from jaxclay._host import compiled
from jaxclay.clay import Array
from jaxclay.implicit import solve_implicitly
from jaxclay.loop import Outcome, Start
from jaxclay.schemes.spline import judge
from jaxclay.schemes.spline.estimate import near
from jaxclay.schemes.spline.pose import Squashed, on_knots
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.shape import crossings, displaced, shape
from jaxclay.solution import Verdict, status_code

_PROBES = 9  # places of a piece at which Y_u is looked at
_EPS = 1e-6  # friction's smoothing over l where a solve goes on


class SplineAnswer(NamedTuple):
    """All that a solve finds out; the problem is that of the mesh it ended on."""

    problem: SplineProblem
    outcome: Outcome
    verdict: Verdict


def squashed(problem: SplineProblem) -> Squashed:
    """The problem without its mesh."""
    return Squashed(
        problem.clay,
        problem.rest,
        problem.tool,
        problem.material,
        problem.band,
        problem.band_terms,
        problem.rough,
    )


@compiled("method")
def answered(problem: SplineProblem, start: Start, settings: Any, *, method: str) -> SplineAnswer:
    """The method, again where the displacement changes sign within a span, and the judge."""
    feasible = problem.rough.feasible
    start = jax.lax.stop_gradient(start)
    outcome = solve_implicitly(problem, start, settings, feasible, method)
    problem, outcome = at_crossings(problem, outcome, settings, feasible, method)
    return SplineAnswer(problem, outcome, judged(problem, outcome))


def at_crossings(problem, outcome: Outcome, settings, feasible, method) -> tuple[Any, Outcome]:
    """Where the displacement changes sign, cells of friction that meet there, and a new solve."""
    knots, degree = problem.space.knots, problem.space.degree
    coefficients = jax.lax.stop_gradient(outcome.point.coefficients)
    breaks = crossings(displaced(problem.space, coefficients)[1])
    crosses = jnp.any(breaks != 0.5) & feasible & outcome.finite

    def again():
        broken = on_knots(squashed(problem), knots, breaks, degree)
        start = jax.lax.stop_gradient(near(broken, broken.point(coefficients), jnp.asarray(_EPS)))
        new = solve_implicitly(broken, start, settings, feasible, method)
        return broken, new._replace(iterations=outcome.iterations + new.iterations)

    return jax.lax.cond(crosses, again, lambda: (problem, outcome))


def judged(problem: SplineProblem, outcome: Outcome) -> Verdict:
    """The shape, its terms, its certificate and the status code."""
    feasible = problem.rough.feasible
    rest = problem.point(jnp.zeros_like(problem.shift))
    point = jax.tree.map(lambda a, b: jnp.where(feasible, a, b), outcome.point, rest)
    terms = problem.terms(point)
    certificate = judge.certify(*jax.lax.stop_gradient((problem, point, outcome.forces)))
    breaks, control = shape(problem, point.coefficients)
    finite = outcome.finite & jnp.isfinite(terms.total)
    rises = _rises(breaks, control)
    accepted = certificate.accepted & finite & feasible & rises
    code = status_code(outcome.finished, accepted, finite, feasible, ~rises)
    certificate = dataclasses.replace(certificate, accepted=accepted)
    breaks, control = _kept(problem, breaks, control, feasible)
    return Verdict((breaks, control * problem.clay.unit), point, terms, certificate, code)


def _rises(breaks: Array, control: Array) -> Array:
    """Whether Y_u is positive between the Gauss points too, which alone see the floor."""
    width = jnp.diff(breaks)
    filled = width > 0
    s = jnp.arange(_PROBES) / (_PROBES - 1)
    unit = jnp.where(filled, width, 1.0)[:, None]
    slopes = bernstein.in_piece(control[:, None], unit, s, 2)[1]
    return jnp.all(jnp.where(filled[:, None], slopes > 0, True))


def _kept(problem: SplineProblem, breaks: Array, control: Array, feasible: Array):
    """The rest shape, padded, where there is no answer."""
    rest = problem.rest
    missing = breaks.shape[0] - rest.breaks.shape[0]
    old_breaks = jnp.append(rest.breaks, jnp.ones(missing))
    empty = jnp.broadcast_to(rest.control[-1:, -1:], (missing, control.shape[1]))
    old_control = jnp.concatenate([rest.control, empty])
    return jnp.where(feasible, breaks, old_breaks), jnp.where(feasible, control, old_control)
