"""The scheme "spline" as the host calls it: shapes from a few sizes, answers as Solutions.

Arrays of a few sizes serve all scenes, so that nothing is compiled for a new one:
rest shapes are filled up with empty pieces, meshes with empty spans.
"""

from __future__ import annotations

import dataclasses
from typing import Any, cast

import jax.numpy as jnp
import numpy as np

from jaxclay._host import compiled, in_float64, is_concrete, is_transformed
from jaxclay.band import tool_of
from jaxclay.certificate import Forces
from jaxclay.clay import Array, Clay, Material
from jaxclay.conversion import as_smooth, in_pieces, interpolated
from jaxclay.loop import Start
from jaxclay.merging import merged, padded, without_empty
from jaxclay.schemes.spline import mesh
from jaxclay.schemes.spline.adapt import Adapted, adapted
from jaxclay.schemes.spline.pose import located, meshed
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.solve import SplineAnswer, answered
from jaxclay.smooth_clay import SmoothClay, unchecked_smooth_clay
from jaxclay.solution import Solution, Status
from jaxclay.squash import Squash, check_fits

_PIECES = (1, 48, 144, 432, 1296)  # sizes of rest shapes
_SPANS = (128, 512)  # and of meshes that adapt, after for cylinders
_FEW = {1: 28, 2: 40}  # with a band at the bottom, and above it
_KINKS = 16  # breaks of the rest shape at which meshes that adapt let the displacement kink
_FOLDED = 24  # pieces above which an answer's are merged,
_FOLD = 0.05  # to this share of the tolerance, or
_FOLD_FIXED = 1e-8  # over l where there is none


def posed(
    clay: Clay | SmoothClay, squash: Squash, material: Material, degree: int, elements: int
) -> SplineProblem:
    """The problem on equal spans; see :func:`jaxclay.pose`."""
    check_degree(degree)
    whole = isinstance(elements, int | np.integer) and not isinstance(elements, bool)
    if not whole or elements < 1:
        raise ValueError(f"elements must be a whole number of at least 1, got {elements!r}")
    smooth = prepared(clay)
    sides = sides_of(squash, smooth)
    return in_float64(
        "pose", _posed, smooth, squash, material,
        degree=int(degree), elements=int(elements), sides=sides,
    )  # fmt: skip


def minimize_on_mesh(
    problem: SplineProblem, start: Array | Solution | None, settings: Any, method: str
) -> Solution:
    """The minimum in the problem's splines."""
    begin = _begin(problem, start)
    answer: SplineAnswer = in_float64("minimize", answered, problem, begin, settings, method=method)
    return _solution(answer, method, np.zeros(0, int), None, _FOLD_FIXED)


def deform_to_tolerance(
    clay: Clay | SmoothClay,
    squash: Squash,
    material: Material,
    tolerance: float,
    degree: int,
    settings: Any,
    method: str,
) -> Solution:
    """As few unknowns as the tolerance needs."""
    check_degree(degree)
    if method != "newton":
        raise ValueError(f"a tolerance takes method newton, got {method}: or give elements")
    concrete = is_concrete(clay, squash, material)
    if concrete:
        check_fits(squash, clay)
    smooth = prepared(clay)
    sides = sides_of(squash, smooth)
    transformed = is_transformed(clay, squash, material, tolerance)
    kinks, sizes = (_KINKS, _SPANS) if transformed else rooms(smooth, sides)
    for spans in sizes if concrete else sizes[:1]:
        answer: Adapted = in_float64(
            "deform", _adapted, smooth, squash, material, (1 - _FOLD) * tolerance, settings,
            degree=int(degree), sides=sides, spans=spans, kinks=kinks, differentiable=transformed,
        )  # fmt: skip
        if is_transformed(answer) or not answer.full:
            break
    levels = answer.levels
    if not is_transformed(answer):
        levels = levels[levels > 0]
    solution = _solution(answer, method, levels, answer.error, _FOLD * tolerance)
    return _honest(solution, tolerance)


def check_degree(degree: int) -> None:
    """Raise unless it is 3, 4 or 5."""
    if isinstance(degree, bool) or degree not in (3, 4, 5):
        raise ValueError(f"degree must be 3, 4 or 5, got {degree!r}")


def prepared(clay: Clay | SmoothClay) -> SmoothClay:
    """The clay as a function, filled up to one of a few sizes."""
    if is_transformed(clay):
        if isinstance(clay, SmoothClay):
            return clay
        equal = clay.equal and not len(clay.edges)
        breaks, control = interpolated(clay.thickness, clay.heights) if equal else in_pieces(clay)
        return unchecked_smooth_clay(breaks, control, clay.r0, clay.unit)
    smooth = clay if isinstance(clay, SmoothClay) else as_smooth(clay)
    count = len(smooth.control)
    size = next((size for size in _PIECES if size >= count), count)
    breaks, control = padded(smooth.breaks, smooth.control, size)
    return unchecked_smooth_clay(breaks, control, smooth.r0, smooth.unit)


def rooms(smooth: SmoothClay, sides: int) -> tuple[int, tuple[int, ...]]:
    """How many kinks a mesh for this clay needs room for, and the numbers of spans to try."""
    if smooth.pieces == 1:
        return 0, (_FEW[sides], *_SPANS)
    return _KINKS, _SPANS if smooth.pieces <= _PIECES[1] else _SPANS[1:]


def sides_of(squash: Squash, smooth: SmoothClay) -> int:
    """1 where no clay can be below the band; 2 for worked clay, to compile once for all bands."""
    plain = smooth.control.shape[0] == 1
    return 1 if plain and is_concrete(squash.bottom) and float(squash.bottom) == 0 else 2


@compiled("degree", "elements", "sides")
def _posed(clay, squash, material, *, degree: int, elements: int, sides: int) -> SplineProblem:
    squashed = located(clay, tool_of(squash, clay.unit), material, sides)
    inner = mesh.uniform(squashed.band, elements, sides)
    return meshed(squashed, inner, None, degree, sides)


@compiled("degree", "sides", "spans", "kinks", "differentiable")
def _adapted(
    clay, squash, material, tolerance, settings, *, degree, sides, spans, kinks, differentiable
) -> Adapted:
    return adapted(
        clay, tool_of(squash, clay.unit), material, tolerance, settings,
        degree=degree, sides=sides, spans=spans, kinks=kinks, differentiable=differentiable,
    )  # fmt: skip


def _begin(problem: SplineProblem, start: Array | Solution | None) -> Start:
    """Where to start; see :func:`jaxclay.minimize`."""
    if start is None:
        return in_float64("minimize", _cold, problem)
    if isinstance(start, Solution):
        coefficients, near = start.point.coefficients, True
        forces = start.forces
    else:
        coefficients, near = start, False
        forces = None
    if np.shape(coefficients) != np.shape(problem.shift):
        raise ValueError(
            f"start must hold one coefficient for each of {problem.shift.shape[0]}: got shape "
            f"{np.shape(coefficients)}; give an answer on the same degree and elements"
        )
    begin = in_float64("minimize", _from, problem, coefficients)
    if forces is None:
        return begin
    return begin._replace(forces=forces, near=np.asarray(near))


@compiled()
def _cold(problem: SplineProblem) -> Start:
    return _start(problem, problem.even())


@compiled()
def _from(problem: SplineProblem, coefficients: Array) -> Start:
    return _start(problem, jnp.where(problem.fixed, problem.shift, coefficients))


def _start(problem: SplineProblem, coefficients: Array) -> Start:
    none = Forces(jnp.zeros_like(problem.friction_limit), jnp.zeros_like(problem.floor))
    return Start(problem.point(coefficients), none, jnp.asarray(False))


def _solution(answer, method: str, levels: Array, error: Array | None, fold: float) -> Solution:
    """The answer as users see it; its clay without empty pieces, merged if there are many."""
    problem, outcome, verdict = answer.problem, answer.outcome, answer.verdict
    breaks, control = verdict.clay
    before = problem.clay
    if not is_transformed(answer):
        breaks, control = without_empty(breaks, control)
        if len(control) > _FOLDED and np.isfinite(control).all():
            breaks, control = merged(breaks, control, float(before.r0), float(before.unit), fold)
            error = None if error is None else error + fold
    return Solution(
        clay=unchecked_smooth_clay(breaks, control, before.r0, before.unit),
        point=verdict.point,
        energy=verdict.terms.total,
        terms=verdict.terms,
        iterations=outcome.iterations,
        levels=levels,
        certificate=verdict.certificate,
        forces=outcome.forces,
        rough=problem.rough,
        problem=problem,
        status_code=verdict.code,
        error_estimate=error,
        method=method,
    )


def _honest(solution: Solution, tolerance: float) -> Solution:
    """Unresolved where the tolerance was not met."""
    converged = solution.status_code == Status.CONVERGED.value
    missed = converged & (cast(Array, solution.error_estimate) > tolerance)
    if is_transformed(solution):
        code = jnp.where(missed, Status.UNRESOLVED.value, solution.status_code)
    else:
        code = np.where(missed, Status.UNRESOLVED.value, solution.status_code)
    return dataclasses.replace(solution, status_code=code)
