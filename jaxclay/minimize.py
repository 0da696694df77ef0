"""minimize and deform: one loop for all methods, one status, one certificate."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay._host import compiled, in_float64, is_concrete, is_transformed
from jaxclay.certificate import certify
from jaxclay.checks import check_tolerance
from jaxclay.clay import Array, Clay, Material
from jaxclay.implicit import solve_implicitly
from jaxclay.loop import Outcome
from jaxclay.methods.choice import method_settings, spline_settings
from jaxclay.posing import check_scheme, pose
from jaxclay.problem import Problem
from jaxclay.resolution import hidden_by_rounding
from jaxclay.schemes.slices.edges import with_edges
from jaxclay.schemes.slices.ladder import carried
from jaxclay.schemes.slices.nodes import least_slices
from jaxclay.schemes.slices.posing import counted, located, pose_on_host
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.solve import minimize_on_spans
from jaxclay.schemes.sums import Point
from jaxclay.scm import RoughShape, rough_shape
from jaxclay.solution import Solution, Status, Verdict, status_code
from jaxclay.squash import Squash, check_fits
from jaxclay.start import Begin, begin_from, first_start, within
from jaxclay.window import Piece, minimize_in_window


def deform(
    clay: Clay,
    squash: Squash,
    material: Material,
    method: str = "newton",
    *,
    scheme: str = "slices",
    tolerance: float | None = None,
    slices: int | tuple[int, int, int] | None = None,
    spacing: str | None = None,
    degree: int | None = None,
    elements: int | None = None,
    **settings: Any,
) -> Solution:
    """Squash the clay: pose (eqs. 10, 11), rough shape (12 to 19), minimum of E_total (9).

    On the scheme "slices" newton solves on half as many slices first, twice, and each time the
    nodes go where the answer before bends; so the problem is the same for every method.

    Parameters
    ----------
    clay, squash, material
        As :func:`pose` takes them.
    method : str
        A key of :data:`jaxclay.METHODS`.
    scheme : str
        "slices", "paper" or "spline", as :func:`pose` takes it.
    tolerance : float, optional
        Largest error of the contour, over the unit l, that the answer may have, on the scheme
        "slices": as few slices as that needs are used, and ``error_estimate`` says what was met.
    slices, spacing, degree, elements : optional
        As :func:`pose` takes them; a tolerance chooses the slices by itself.
    **settings
        The method's own: see ``jaxclay.METHODS[method].settings``.

    Returns
    -------
    Solution
        Its ``status`` says how it ended; ``clay`` is ready for the next squash.

    Raises
    ------
    ValueError
        What :func:`pose` and :func:`minimize` raise; a tolerance below what float64 can
        give or out of range; arguments that do not go together.
    """
    given = {"slices": slices, "spacing": spacing, "degree": degree, "elements": elements}
    check_scheme(scheme, **given)
    if tolerance is not None:
        _check_tolerance(tolerance, scheme, slices, spacing)
        from jaxclay.schemes.slices.tolerance import deform_to_tolerance

        return deform_to_tolerance(clay, squash, material, tolerance, method, settings)
    if scheme == "slices" and is_concrete(clay, squash, material):
        return _placed_twice(clay, squash, material, method, slices, spacing, settings)
    return minimize(pose(clay, squash, material, scheme, **given), method, **settings)


def _check_tolerance(tolerance, scheme, slices, spacing) -> None:
    """Raise where a tolerance is out of range or does not go with the rest."""
    if scheme != "slices":
        raise ValueError(
            f'tolerance={tolerance!r} belongs to scheme "slices", not to "{scheme}": give '
            + ("elements" if scheme == "spline" else "slices")
        )
    for name, value in (("slices", slices), ("spacing", spacing)):
        if value is not None:
            raise ValueError(
                f"give {name}={value!r} or a tolerance, which chooses the slices, not both"
            )
    check_tolerance(tolerance)


def _placed_twice(clay, squash, material, method, slices, spacing, settings) -> Solution:
    """The answer on nodes placed by the answer on half as many slices, where there are enough."""
    method_settings(method, settings)
    check_fits(squash, clay)
    found = located(clay, squash, material)
    wanted = clay.slices if slices is None else slices
    total, counts = counted(wanted)
    half = total // 2
    if spacing == "equal" or counts is not None or half < least_slices(found.band):
        posed = pose_on_host(found, wanted, spacing or "placed")
        return minimize(posed, method, **settings)
    coarse, levels = None, []
    for _ in range(_PLACINGS):
        coarse = minimize(pose_on_host(found, half, "placed", coarse))
        levels.append(int(coarse.iterations))
        if coarse.status is not Status.CONVERGED:
            return minimize(pose_on_host(found, total, "placed"), method, **settings)
    problem = pose_on_host(found, total, "placed", coarse)
    start = carried(problem, coarse) if method == "newton" else None
    solution = minimize(problem, method, start, **settings)
    if start is not None and solution.status is not Status.CONVERGED:
        again = minimize(problem, method, **settings)
        solution = again if again.status is Status.CONVERGED else solution
    return dataclasses.replace(solution, levels=np.array(levels))


def minimize(
    problem: Problem | SplineProblem,
    method: str = "newton",
    start: Array | Point | Solution | None = None,
    window: str | tuple[float, float] | None = None,
    **settings: Any,
) -> Solution:
    """Minimise E_total (eq. 9) over the free heights, or a spline's free coefficients.

    Inside ``grad`` and its kin the derivative is the minimum's, from the implicit
    function theorem, not the iterations'.

    Parameters
    ----------
    problem : Problem or SplineProblem
        From :func:`pose`.
    method : str
        A key of :data:`jaxclay.METHODS`.
    start : (n+1,) array, Point or Solution, optional
        Heights to start from, in the clay's length unit (coefficients (N,) for a
        spline), or a point over l; what is prescribed is put where the tool wants it.  Or the
        answer to a squash close by of the same clay, whose displacements, multipliers and resting
        nodes are used: that is for dragging a tool.  If not given, the rough shape; on
        more than 256 slices of the paper's scheme ``newton`` goes by way of coarser grids.
    window : "auto" or (bottom, top), optional
        On slices, solve for the clay between these heights of the clay before
        the squash only, or, if "auto", for what the sliced cylinder model moves and some
        more; wider where clay outside turns out to move.  The answer is judged
        as a whole.
    **settings
        The method's own: see ``jaxclay.METHODS[method].settings``.

    Returns
    -------
    Solution
        Its ``status`` says how it ended, its certificate why.

    Raises
    ------
    ValueError
        Unknown method or setting, a method that does not know the problem's scheme, a
        setting out of its range, a start of the wrong length, out of order or below the
        thickness floor, a window that is empty or reaches beyond the clay.
    TypeError
        Inside a JAX transformation while float64 is off.
    """
    if isinstance(problem, SplineProblem):
        if window is not None:
            raise ValueError(f'window={window!r} belongs to slices, not to scheme "spline"')
        return minimize_on_spans(problem, start, spline_settings(method, settings), method)
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


_PLACINGS = 2  # on half as many slices, before the last one


class Answer(NamedTuple):
    """All that a solve finds out."""

    rough: RoughShape
    outcome: Outcome
    levels: Array
    verdict: Verdict


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
    clay = verdict.clay
    if problem.before is not None and not is_transformed(clay):
        clay = with_edges(clay, problem, verdict.point.shift)
    return Solution(
        clay=clay,
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


@compiled()
def _judged(problem: Problem, outcome: Outcome, feasible: Array) -> Verdict:
    """The shape, its terms, its certificate and the status code."""
    rest = Point(problem.rest.thickness, jnp.zeros_like(problem.shift))
    point = jax.tree.map(lambda a, b: jnp.where(feasible, a, b), outcome.point, rest)
    terms = problem.terms(point)
    certificate = certify(*jax.lax.stop_gradient((problem, point, outcome.forces)))
    finite = outcome.finite & jnp.isfinite(terms.total)
    hidden = hidden_by_rounding(problem)
    code = status_code(outcome.finished, certificate.accepted, finite, feasible, hidden)
    accepted = code == Status.CONVERGED.value
    certificate = dataclasses.replace(certificate, accepted=accepted)
    return Verdict(problem.shape(point), point, terms, certificate, code)
