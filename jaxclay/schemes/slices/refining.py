"""From few slices to as many as an answer needs, each time placed where the last answer bends."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable

import numpy as np

from jaxclay.contour import contour_error
from jaxclay.problem import Problem
from jaxclay.schemes.slices.ladder import carried
from jaxclay.schemes.slices.posing import Located, pose_on_host
from jaxclay.schemes.sums import Point
from jaxclay.solution import Solution, Status

SIZES = tuple(32 << i for i in range(7))  # slices that an answer to a tolerance may have
_DIRECT = 256  # slices up to which the rough shape is near enough to start from
_SHARE = 3  # at second order the error is a third of the distance to half as many slices

Solve = Callable[[Problem, Point | None], Solution]


def refined(found: Located, sizes: Iterable[int], solve: Solve) -> Iterable[Solution]:
    """Answers on these numbers of slices, one after the other, each starting from the last."""
    answer = None
    for slices in sizes:
        problem = pose_on_host(found, slices, "placed", answer)
        start = None if answer is None else carried(problem, answer)
        new = solve(problem, start)
        if start is not None and new.status is not Status.CONVERGED:
            new = solve(problem, None)
        # What is no answer places no nodes.
        answer = new if new.status is Status.CONVERGED else None
        yield new
        if new.status is Status.INFEASIBLE:
            break


def on_slices(found: Located, slices: int, solve: Solve) -> Solution:
    """The answer on n slices, placed three times, the first time on not too many."""
    first = min(slices, _DIRECT)
    return _with_levels(list(refined(found, [first, slices, slices], solve)))


def to_tolerance(found: Located, tolerance: float, solve: Solve) -> Solution:
    """The answer on as few slices as put its contour within the tolerance, over the unit l.

    Twice as many slices each time, until the last two answers lie within the tolerance of each
    other; ``error_estimate`` is a third of their distance.  Where that does not happen the answer
    is UNRESOLVED.
    """
    answers: list[Solution] = []
    distance = np.inf
    for new in refined(found, [SIZES[0], *SIZES], solve):
        answers.append(new)
        if len(answers) <= 2:
            continue
        both = [answer.status is Status.CONVERGED for answer in answers[-2:]]
        distance = contour_error(new.clay, answers[-2].clay) if all(both) else np.inf
        if distance <= tolerance:
            break
    last = _with_levels(answers)
    code = last.status_code
    if last.status is Status.CONVERGED and not distance <= tolerance:
        code = np.asarray(Status.UNRESOLVED.value)
    return dataclasses.replace(last, error_estimate=distance / _SHARE, status_code=code)


def _with_levels(answers: list[Solution]) -> Solution:
    levels = np.array([int(answer.iterations) for answer in answers[:-1]], int)
    return dataclasses.replace(answers[-1], levels=levels)
