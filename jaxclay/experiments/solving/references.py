"""The certified minima that answers are measured against, from another method than theirs."""

from __future__ import annotations

import functools
from typing import Any

from jaxclay.clay.clay import Clay
from jaxclay.clay.contour import contour_error
from jaxclay.experiments.entries.specification import Specification
from jaxclay.experiments.entries.tables import Discretisation
from jaxclay.experiments.entries.tasks import Task
from jaxclay.experiments.solving.clock import compiled
from jaxclay.methods.lbfgs import has_jaxopt
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash, check_fits
from jaxclay.numerics.checks import REFUSALS
from jaxclay.schemes.posing import pose
from jaxclay.solve.batch import minimize_batch
from jaxclay.solve.minimize import deform, minimize
from jaxclay.solve.solution import Solution

_FINE = 512  # slices of the clay that splines and placed slices start from
_KEPT = 1024
_DENSE = 256  # slices beyond which only newton is a reference: the other's time goes as their cube
_OTHER = "lbfgs-preconditioned"  # newton's, on all schemes
_answers: dict[tuple, Solution | None] = {}  # by scene, discretisation and method


def reference_method(method: str) -> str:
    """Whose certified minimum a method's gap is measured from, never its own."""
    return _OTHER if method == "newton" else "newton"


def posed(specification: Specification, size: Discretisation) -> Any:
    """The last squash, posed on a scheme whose slices or spans are known beforehand.

    Raises ValueError or Hindrance: why the scene cannot be posed, or an earlier squash not be
    solved, on this grid.
    """
    problem = _posed(specification, size)
    if isinstance(problem, Exception):
        raise problem
    return problem


@functools.lru_cache(maxsize=_KEPT)
def _posed(specification: Specification, size: Discretisation) -> Any:
    """The problem, or why there is none: either is found once for all methods."""
    try:
        if size.scheme == "spline":
            how: dict[str, Any] = {"degree": size.degree, "elements": size.elements}
            return pose(*whole(specification), "spline", **how)
        scene = specification.scene()
        return scene.problems(specification.units, size.slices, size.scheme)[-1]
    except REFUSALS as error:
        return error


def certified_minima(problems: list[Any], method: str) -> list[Solution | None]:
    """The reference method's answers on slices, many at once; None if not certified."""
    other = reference_method(method)
    if not problems or not _has(problems[0], other):
        return [None] * len(problems)
    return [_accepted(one) for one in minimize_batch(problems, method=other)]


def certified_minimum(task: Task, answer: Solution) -> Solution | None:
    """The same for the problem of one answer, by the program that users run, each once."""
    other, size = reference_method(task.method), task.discretisation
    if size.placed or task.call == "deform":  # whose problem is the answer's own
        return _accepted(_minimum(answer.problem, other))
    if len(_answers) > _KEPT:
        _answers.clear()
    same = task.specification, size
    if not (task.settings or task.budget or task.precision != "float64"):
        _answers.setdefault((*same, task.method), answer)  # what others are measured from
    if (*same, other) not in _answers:
        _answers[*same, other] = _minimum(answer.problem, other)
    return _accepted(_answers[*same, other])


def _minimum(problem: Any, other: str) -> Solution | None:
    if not _has(problem, other):
        return None
    slices = 0 if problem.scheme == "spline" else problem.slices
    return compiled((other, problem.scheme, slices), lambda: minimize(problem, other))[0]


def _has(problem: Any, other: str) -> bool:
    """Whether there is such an answer: one of the two methods is dense, and jaxopt's."""
    few = problem.scheme == "spline" or problem.slices <= _DENSE
    return other != _OTHER or (few and has_jaxopt())


def _accepted(answer: Solution | None) -> Solution | None:
    return answer if answer is not None and bool(answer.certificate.accepted) else None


@functools.lru_cache(maxsize=_KEPT)
def whole(specification: Specification, slices: int = _FINE) -> tuple[Clay, Squash, Material]:
    """The last squash and the clay before it, earlier ones solved on so many placed slices.

    Raises ValueError, Hindrance: Why an earlier squash could not be solved; a squash above the
    clay.
    """
    *_, (clay, squash, material) = specification.scene().stages(specification.units, slices)
    check_fits(squash, clay)
    return clay, squash, material


@functools.lru_cache(maxsize=_KEPT)
def continuum(specification: Specification, slices: int) -> tuple[Clay, float] | None:
    """Newton's answer on placed slices, for the continuum, and about how far it is off, over l.

    None if it is not certified.  Of second order: its error is about a third of the way from the
    answer on half as many.
    """
    try:
        piece = whole(specification, slices)
        half, full = (deform(*piece, slices=n) for n in (slices // 2, slices))
    except REFUSALS:
        return None
    if _accepted(half) is None or _accepted(full) is None:
        return None
    return full.clay, contour_error(half.clay, full.clay) / 3
