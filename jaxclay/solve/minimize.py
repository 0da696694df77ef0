"""minimize and deform: one loop for all methods, one status, one certificate."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.methods.choice import method_settings, spline_settings
from jaxclay.methods.loop import Outcome, Start, initial_guess, solve
from jaxclay.methods.newton import NewtonSettings
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash, check_fits
from jaxclay.numerics.arrays import Array, namespace
from jaxclay.numerics.checks import check_tolerance
from jaxclay.numerics.host import (
    as_compiled,
    as_float64,
    check_float64,
    compiled,
    in_float64,
    is_concrete,
    is_transformed,
    promoting,
)
from jaxclay.schemes.posing import check_scheme, pose
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.resolution import hidden_by_rounding
from jaxclay.schemes.rough import RoughShape, rough_shape, rough_start
from jaxclay.schemes.slices.nodes import least_slices
from jaxclay.schemes.slices.posing import counted, place, pose_on_host
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.sums import Displaced
from jaxclay.schemes.system import System
from jaxclay.solve.certificate import Certificate, certify
from jaxclay.solve.certified_newton import solve_on_host
from jaxclay.solve.implicit import solve_implicitly
from jaxclay.solve.on_spans import minimize_on_spans
from jaxclay.solve.refining import Wanted, followed, on_slices, to_tolerance
from jaxclay.solve.solution import Derived, Solution, concluded
from jaxclay.solve.start import start_of


@promoting
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

    On the scheme "slices" newton solves twice, on 256 to 1024 slices, then with nodes where that
    answer bends; so the problem is the same for every method.

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
    concrete = is_concrete(clay, squash, material)
    if tolerance is not None:
        _check_tolerance(tolerance, concrete, scheme, slices, spacing)
    if scheme != "slices" or not concrete:
        return minimize(pose(clay, squash, material, scheme, **given), method, **settings)
    method_settings(method, settings)
    check_fits(squash, clay)
    found = place(clay, squash, material)
    if tolerance is not None:
        return _by(method, settings, followed(to_tolerance(found, float(tolerance)), newton_answer))
    wanted = clay.slices if slices is None else slices
    total, counts = counted(wanted)
    if spacing == "equal" or counts is not None or total < least_slices(found.band):
        posed = pose_on_host(found, wanted, spacing or "placed")
        return minimize(posed, method, **settings)
    return _by(method, settings, followed(on_slices(found, total), newton_answer))


def _check_tolerance(tolerance, concrete: bool, scheme, slices, spacing) -> None:
    """Raise where a tolerance is out of range or does not go with the rest."""
    if scheme != "slices":
        raise ValueError(
            f'tolerance={tolerance!r} belongs to scheme "slices", not to "{scheme}": give '
            + ("elements" if scheme == "spline" else "slices")
        )
    if not concrete:
        raise ValueError(
            f"tolerance={tolerance!r} needs values, which jit, grad, vmap and scan do not have "
            "yet: give slices=n, such as slices=128"
        )
    for name, value in (("slices", slices), ("spacing", spacing)):
        if value is not None:
            raise ValueError(
                f"give {name}={value!r} or a tolerance, which chooses the slices, not both"
            )
    check_tolerance(tolerance)


def newton_answer(wanted: Wanted) -> Solution:
    """What a plan asks for, by newton, in one compiled call."""
    problem = wanted.problem
    with as_compiled():
        start, feasible = newton_start(wanted)
        found = solve_on_host(problem.system, start, NewtonSettings(), feasible)
        return solution_of(problem, feasible, *found, "newton")


def newton_start(wanted: Wanted) -> tuple[Start, Array]:
    """Where newton starts; and whether the squash is feasible, as it is where a start is known."""
    problem, start = wanted
    if start is not None:
        return initial_guess(problem, start), np.asarray(True)
    rough, feasible = rough_start(problem)
    return start_of(problem, rough, None, "newton"), feasible


def _by(method: str, settings: dict[str, Any], found: Solution) -> Solution:
    """Newton's answer, or that of another method to the same problem."""
    if method == "newton" and not settings:
        return found
    answer = minimize(found.problem, method, **settings)
    return dataclasses.replace(answer, levels=found.levels, error_estimate=found.error_estimate)


@promoting
def minimize(
    problem: Problem | SplineProblem,
    method: str = "newton",
    start: Array | Displaced | Solution | None = None,
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
    start : (n+1,) array, Displaced or Solution, optional
        Heights to start from, in the clay's length unit (coefficients (N,) for a
        spline), or a displaced shape; what is prescribed is put where the tool wants it.  Or the
        answer to a squash close by of the same clay, whose displacements, multipliers and resting
        nodes are used: that is for dragging a tool.  If not given, the rough shape.
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
        setting out of its range, a start on another scheme, of the wrong length, out of order or
        below the lower bound of thickness.
    TypeError
        Inside a JAX transformation while float64 is off.
    """
    if isinstance(problem, SplineProblem):
        return minimize_on_spans(problem, start, spline_settings(method, settings), method)
    chosen = method_settings(method, settings)
    if is_transformed(problem, start):
        check_float64("minimize")
        return _traced(problem, start, chosen, method)
    with as_compiled():
        problem = _in_numpy(problem)
        point, feasible = rough_start(problem)
        first = start_of(problem, point, start, method)
        found = _solve_on_host(problem, first, chosen, feasible, method)
        return solution_of(problem, feasible, *found, method)


def _in_numpy(problem: Problem) -> Problem:
    """The same, if it came out of a transformation."""
    if namespace(problem) is np:
        return problem
    return dataclasses.replace(as_float64(problem), before=problem.before)


def conclude(problem: Problem, rough: RoughShape, outcome: Outcome, method: str) -> Solution:
    """Certify where a method, or a solver from elsewhere, ended, and say so."""
    problem, outcome = _in_numpy(problem), as_float64(outcome)
    with as_compiled():
        certificate = in_float64("minimize", _certified, problem.system, outcome, rough.feasible)
        return solution_of(problem, rough.feasible, outcome, certificate, method)


def _solve_on_host(problem, start, settings, feasible, method) -> tuple[Outcome, Certificate]:
    """The method, and the certificate of where it ended."""
    system = problem.system
    if method == "newton":
        return solve_on_host(system, start, settings, feasible)
    outcome = in_float64("minimize", solve, problem, start, settings, feasible, method=method)
    return outcome, in_float64("minimize", _certified, system, outcome, feasible)


@compiled()
def _certified(system: System, outcome: Outcome, feasible: Array) -> Certificate:
    return certify(system, _kept(system, outcome, feasible), outcome.forces)


def _kept(system: System, outcome: Outcome, feasible: Array) -> Displaced:
    """The outcome's point; the clay at rest where there is none."""
    point, xp = outcome.point, namespace(outcome.point, feasible)
    thickness = xp.where(feasible, point.thickness, system.rest_thickness)
    return Displaced(thickness, xp.where(feasible, point.shift, 0.0))


def _traced(problem, start, settings, method) -> Solution:
    """The same inside a transformation, with the minimum's derivatives."""
    rough = rough_shape(problem)
    still, rough_still = jax.lax.stop_gradient((problem, rough))
    first = jax.lax.stop_gradient(start_of(still, rough_still.point, start, method))
    outcome = solve_implicitly(problem, first, settings, rough.feasible, method)
    still, last = jax.lax.stop_gradient((problem, outcome))
    certificate = _certified.traced(still.system, last, rough.feasible)
    solution = solution_of(problem, rough.feasible, outcome, certificate, method)
    return dataclasses.replace(solution, derived=Derived(solution.clay, solution.terms, rough))


def solution_of(problem, feasible, outcome: Outcome, certificate: Certificate, method) -> Solution:
    """The answer on slices, the clay at rest where there is none."""
    outcome = outcome._replace(point=_kept(problem.system, outcome, feasible))
    hidden = hidden_by_rounding(problem)
    return concluded(problem, outcome, certificate, feasible, hidden, method)
