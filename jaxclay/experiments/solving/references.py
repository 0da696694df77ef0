"""The certified minima that answers are measured against, from another method than theirs."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.clay.contour import contour_error
from jaxclay.experiments.entries.specification import Specification
from jaxclay.experiments.entries.tables import Discretisation
from jaxclay.experiments.entries.tasks import Task
from jaxclay.experiments.solving.clock import compiled
from jaxclay.methods.choice import method_settings
from jaxclay.methods.lbfgs import has_jaxopt
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash, check_fits
from jaxclay.numerics import host
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.checks import REFUSALS
from jaxclay.schemes.posing import pose
from jaxclay.schemes.problem import Problem
from jaxclay.solve.batch import CAPACITY, each, minimize_batch, stack
from jaxclay.solve.minimize import deform, minimize
from jaxclay.solve.solution import Solution

_FINE = 512  # slices of the clay that splines and placed slices start from
_KEPT = 1024
_DENSE = 256  # slices beyond which only newton is a reference: the other's time goes as their cube
_OTHER = "lbfgs-preconditioned"  # newton's, on all schemes
_answers: dict[tuple, Solution | None] = {}  # by scene, discretisation and method


def minimized(
    problems: list[Problem], method: str, settings: list[dict[str, float]]
) -> list[Solution]:
    """The answers to problems on as many slices each, many in one call, with the settings of each.

    On a CPU the call solves one problem after the other, each to its own end.
    """
    chosen = [method_settings(method, one) for one in settings]
    if method == "newton":
        return minimize_batch(problems, chosen)
    answers: dict[int, Solution] = {}
    shapes = [jax.tree.structure(one) for one in chosen]  # what a program is compiled for
    for shape in dict.fromkeys(shapes):
        same = [i for i, other in enumerate(shapes) if other == shape]
        for begin in range(0, len(same), CAPACITY):
            part = same[begin : begin + CAPACITY]
            pairs = stack([(problems[i], chosen[i]) for i in part], CAPACITY)
            with jax.enable_x64(True):
                found = _many.whole(pairs, np.array(len(part)), method=method)
            leaves, structure = jax.tree.flatten(jax.tree.map(np.asarray, found))
            for j, i in enumerate(part):
                answers[i] = jax.tree.unflatten(structure, [leaf[j] for leaf in leaves])
    return [answers[i] for i in range(len(problems))]


@host.compiled("method")
def _many(pairs: tuple[Problem, Any], count: Array, *, method: str) -> Solution:
    """The first ``count`` answers."""

    def one(i):
        problem, chosen = jax.tree.map(lambda leaf: leaf[i], pairs)
        names = (field.name for field in dataclasses.fields(chosen))
        return minimize(problem, method, **{name: getattr(chosen, name) for name in names})

    return each(one, count)


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
    return [_accepted(one) for one in minimized(problems, other, [{}] * len(problems))]


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


class Continuum(NamedTuple):
    """The contour that stands for the continuum's minimum, and about how far it is off, over l."""

    clay: Clay
    error: float


@functools.lru_cache(maxsize=_KEPT)
def continuum(specification: Specification, slices: int) -> Continuum | None:
    """Newton's answer on placed slices; None if it is not certified.

    Of second order: its error is about a third of the way from the answer on half as many.
    """
    try:
        piece = whole(specification, slices)
        half, full = (deform(*piece, slices=n) for n in (slices // 2, slices))
    except REFUSALS:
        return None
    if _accepted(half) is None or _accepted(full) is None:
        return None
    return Continuum(full.clay, contour_error(half.clay, full.clay) / 3)
