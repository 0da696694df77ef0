"""minimize and deform: one loop for all methods, one status, one certificate."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay._host import compiled, in_float64
from jaxclay.certificate import certify
from jaxclay.checks import check_tolerance
from jaxclay.clay import Array, Clay, Material
from jaxclay.conversion import cut
from jaxclay.implicit import solve_implicitly
from jaxclay.loop import Outcome
from jaxclay.methods.choice import method_settings, spline_settings
from jaxclay.posing import pose
from jaxclay.problem import Problem
from jaxclay.resolution import hidden_by_rounding
from jaxclay.schemes.paper import Point
from jaxclay.schemes.spline.host import deform_to_tolerance, minimize_on_mesh
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.scm import RoughShape, rough_shape
from jaxclay.smooth_clay import SmoothClay
from jaxclay.solution import Solution, Status, Verdict, status_code
from jaxclay.squash import Squash
from jaxclay.start import Begin, begin_from, first_start, within
from jaxclay.window import Piece, minimize_in_window


def deform(
    clay: Clay | SmoothClay,
    squash: Squash,
    material: Material,
    method: str = "newton",
    *,
    scheme: str | None = None,
    tolerance: float | None = None,
    slices: int | str | None = None,
    degree: int = 5,
    elements: int | None = None,
    **settings: Any,
) -> Solution:
    """Squash the clay: pose (eqs. 10, 11), rough shape (12 to 19), minimum of E_total (9).

    Parameters
    ----------
    clay, squash, material
        As :func:`pose` takes them.
    method : str
        A key of :data:`jaxclay.METHODS`.
    scheme : str, optional
        "paper" or "spline"; if not given, "spline" where there is a tolerance.
    tolerance : float, optional
        Largest error of the contour, over the unit l, that the answer may have: as few
        unknowns as that needs are used, and ``error_estimate`` says what was met.
        With scheme "paper" that takes ``slices="auto"``.
    slices : int or "auto", optional
        For the paper's scheme: cut the clay into so many slices first.
    degree, elements : int, optional
        Of the splines, see :func:`pose`; a tolerance chooses the elements by itself.
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
    scheme = _scheme(scheme, tolerance, slices, elements)
    if tolerance is None:
        if isinstance(slices, int):
            clay = cut(clay, slices)
        count = 8 if elements is None else elements
        return minimize(pose(clay, squash, material, scheme, degree, count), method, **settings)
    check_tolerance(tolerance)
    if scheme == "paper":
        from jaxclay.auto_slices import deform_on_slices

        return deform_on_slices(clay, squash, material, method, tolerance, settings)
    chosen = spline_settings(method, settings)
    return deform_to_tolerance(clay, squash, material, tolerance, degree, chosen, method)


def _scheme(scheme, tolerance, slices, elements) -> str:
    """The scheme meant; raises where arguments do not go together."""
    if scheme is None:
        scheme = "paper" if tolerance is None or slices is not None else "spline"
    if scheme == "spline":
        if slices is not None:
            raise ValueError(f'slices={slices!r} belongs to scheme "paper", not to "spline"')
        if tolerance is not None and elements is not None:
            raise ValueError("give elements or a tolerance, which chooses them, not both")
        return scheme
    if elements is not None:
        raise ValueError(f'elements={elements!r} belongs to scheme "spline", not to "paper"')
    if (slices == "auto") != (tolerance is not None):
        raise ValueError(
            'on the paper\'s scheme a tolerance takes slices="auto" and slices="auto" a '
            f"tolerance: got slices={slices!r} and tolerance={tolerance!r}"
        )
    if isinstance(slices, str) and slices != "auto":
        raise ValueError(f'slices must be a whole number or "auto", got {slices!r}')
    return scheme


def minimize(
    problem: Problem | SplineProblem,
    method: str = "newton",
    start: Array | Solution | None = None,
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
    start : (n+1,) array or Solution, optional
        Heights to start from, in the clay's length unit (coefficients (N,) for a
        spline); what is prescribed is put where the tool wants it.  Or the answer to a
        squash close by of the same clay, whose displacements, multipliers and resting
        nodes are used: that is for dragging a tool.  If not given, the rough shape; on
        more than 256 slices ``newton`` goes by way of coarser grids.
    window : "auto" or (bottom, top), optional
        On the paper's scheme, solve for the clay between these heights of the clay before
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
            raise ValueError(f'window={window!r} belongs to scheme "paper", not to "spline"')
        return minimize_on_mesh(problem, start, spline_settings(method, settings), method)
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
