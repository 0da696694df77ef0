"""minimize and deform: one loop for all methods, one status, one certificate."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay._host import compiled, in_float64
from jaxclay.certificate import Certificate, certify
from jaxclay.clay import Array, Clay, Material
from jaxclay.energy import Terms
from jaxclay.implicit import solve_implicitly
from jaxclay.loop import Outcome
from jaxclay.methods import METHODS
from jaxclay.problem import Problem, pose
from jaxclay.resolution import hidden_by_rounding
from jaxclay.schemes.paper import Point
from jaxclay.scm import RoughShape, rough_shape
from jaxclay.solution import Solution, Status
from jaxclay.squash import Squash
from jaxclay.start import Begin, begin_from, first_start, within
from jaxclay.window import Piece, minimize_in_window


def deform(
    clay: Clay, squash: Squash, material: Material, method: str = "newton", **settings: Any
) -> Solution:
    """Squash the clay: pose, rough shape, minimum of E_total.

    Takes what :func:`pose` and :func:`minimize` take and raises what they raise.
    """
    return minimize(pose(clay, squash, material), method, **settings)


def minimize(
    problem: Problem,
    method: str = "newton",
    start: Array | Solution | None = None,
    window: str | tuple[float, float] | None = None,
    **settings: Any,
) -> Solution:
    """Minimise E_total over the free heights.

    Inside ``grad`` and its kin the derivative is the minimum's, from the implicit
    function theorem, not the iterations'.

    Parameters
    ----------
    problem : Problem
        From :func:`pose`.
    method : str
        A key of :data:`jaxclay.METHODS`.
    start : (n+1,) array or Solution, optional
        Heights to start from, in the clay's length unit; the band's nodes are put
        where the tool wants them.  Or the answer to a squash close by of the same
        clay, whose displacements, multipliers and resting nodes are used: that is
        for dragging a tool.  If not given, the rough shape; on more than 256 slices
        ``newton`` goes by way of coarser grids.
    window : "auto" or (bottom, top), optional
        Solve for the clay between these heights of the clay before the squash
        only, or, if "auto", for what the sliced cylinder model moves and some
        more; wider where clay outside turns out to move.  The answer is judged
        as a whole.
    **settings
        The method's own: see ``jaxclay.METHODS[method].settings``.

    Raises
    ------
    ValueError
        Unknown method or setting, a setting out of its range, a start of the
        wrong length, out of order or below the thickness floor, a window that
        is empty or reaches beyond the clay.
    TypeError
        Inside a JAX transformation while float64 is off.
    """
    chosen = method_settings(method, settings)
    whole = begin_from(problem, start)
    if window is not None:
        rough = rough_shape(problem)

        def solve(part: Problem, piece: Piece) -> Outcome:
            begin = within(piece, whole)
            return in_float64("minimize", _answered, part, begin, chosen, method=method).outcome

        outcome = minimize_in_window(problem, rough, window, solve)
        if outcome is not None:
            return conclude(problem, rough, outcome, method)
    answer = in_float64("minimize", _answered, problem, whole, chosen, method=method)
    return solution_of(problem, answer, method)


class Answer(NamedTuple):
    """All that a solve finds out."""

    rough: RoughShape
    outcome: Outcome
    levels: Array
    verdict: Verdict


class Verdict(NamedTuple):
    """What the judge makes of an outcome."""

    clay: Clay
    point: Point
    terms: Terms
    certificate: Certificate
    code: Array


@compiled("method")
def _answered(problem: Problem, begin: Begin, settings: Any, *, method: str) -> Answer:
    """Rough shape, coarser grids where they help, the method, the judge: one compiled call."""
    rough = rough_shape(problem)
    start, levels = first_start(
        *jax.lax.stop_gradient((problem, rough.point, begin, settings)), method
    )
    outcome = solve_implicitly(problem, start, settings, rough.feasible, method)
    return Answer(rough, outcome, levels, _judged(problem, outcome, rough.feasible))


def solution_of(problem: Problem, answer: Answer, method: str) -> Solution:
    """The answer as users see it."""
    rough, outcome, levels, verdict = answer
    return Solution(
        clay=verdict.clay,
        point=verdict.point,
        energy=verdict.terms.total,
        terms=verdict.terms,
        iterations=outcome.iterations,
        levels=levels,
        certificate=verdict.certificate,
        forces=outcome.forces,
        rough=rough,
        problem=problem,
        status_code=verdict.code,
        error_estimate=None,
        method=method,
    )


def conclude(problem: Problem, rough: RoughShape, outcome: Outcome, method: str) -> Solution:
    """Judge where a method, or a solver from elsewhere, ended, and say so."""
    verdict = in_float64("minimize", _judged, problem, outcome, rough.feasible)
    return solution_of(problem, Answer(rough, outcome, np.zeros(0, int), verdict), method)


def method_settings(method: str, settings: dict[str, Any]) -> Any:
    """The method's settings, defaults filled in; errors name what is allowed."""
    if not isinstance(method, str) or method not in METHODS:
        raise ValueError(f"unknown method {method!r}: choose from {', '.join(METHODS)}")
    kind = METHODS[method].settings
    known = [field.name for field in dataclasses.fields(kind)]
    for name in settings:
        if name not in known:
            raise ValueError(f"{method} has no setting {name!r}: it takes {', '.join(known)}")
    return kind(**settings)


@compiled()
def _judged(problem: Problem, outcome: Outcome, feasible: Array) -> Verdict:
    """The shape, its terms, its certificate and the status code."""
    rest = Point(problem.rest.thickness, jnp.zeros_like(problem.shift))
    point = jax.tree.map(lambda a, b: jnp.where(feasible, a, b), outcome.point, rest)
    terms = problem.terms(point)
    certificate = certify(*jax.lax.stop_gradient((problem, point, outcome.forces)))
    finite = outcome.finite & jnp.isfinite(terms.total)
    code = jnp.where(outcome.finished, Status.STALLED.value, Status.ITERATION_LIMIT.value)
    code = jnp.where(hidden_by_rounding(problem), Status.UNRESOLVED.value, code)
    code = jnp.where(certificate.accepted, Status.CONVERGED.value, code)
    code = jnp.where(finite, code, Status.NON_FINITE.value)
    code = jnp.where(feasible, code, Status.INFEASIBLE.value)
    accepted = code == Status.CONVERGED.value
    certificate = dataclasses.replace(certificate, accepted=accepted)
    return Verdict(problem.shape(point), point, terms, certificate, code)
