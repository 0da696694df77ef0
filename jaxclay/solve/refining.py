"""From few slices to as many as an answer needs, each time placed where the last answer bends.

Each plan is a generator: it asks for the answers to problems, one after the other, and returns
the last.  So whoever has many squashes can have what they all ask for solved at once.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Generator, Iterable
from typing import Any, NamedTuple

import numpy as np

from jaxclay.clay.contour import contour_error_upto
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.slices.posing import Placed, pose_on_host
from jaxclay.schemes.sums import Displaced
from jaxclay.solve.carried import carried
from jaxclay.solve.solution import Solution, Status

SIZES = tuple(32 << i for i in range(8))  # slices that an answer to a tolerance may have
_FIRST = 256, 1024  # slices that the first answer has at least and at most
_MANY = 1024
_SHARE = 3  # at second order the error is a third of the distance to half as many slices


class Wanted(NamedTuple):
    """A problem to be solved from a start, or if that is None from its rough shape.

    Where there is a start the squash is known to be feasible.
    """

    problem: Problem
    start: Displaced | None


Plan = Generator[Wanted, Solution, Solution]


def on_slices(found: Placed, slices: int) -> Plan:
    """The answer on n slices, placed by one on four times as many, 256 to 1024."""
    answers: list[Solution] = []
    for size in (min(max(4 * slices, _FIRST[0]), _FIRST[1]), slices):
        answers.append((yield from _next(found, size, answers)))
        if answers[-1].status is Status.INFEASIBLE:
            break
    return _with_levels(answers)


def beside(found: Placed, slices: int, near: Solution, started: bool = True) -> Plan:
    """The answer on n slices, placed by that to a squash close by, and started from it.

    For a tool that is dragged.  Only answers of the same clay are starts.
    """
    if started:
        return (yield from _next(found, slices, [near]))
    return (yield Wanted(pose_on_host(found, slices, "placed", near), None))


def to_tolerance(found: Placed, tolerance: float, sizes: Iterable[int] = SIZES) -> Plan:
    """The answer on as few slices as put its contour within the tolerance, over the unit l.

    Twice as many slices each time, until the last two answers lie within the tolerance of each
    other; ``error_estimate`` is a third of their distance, and from 1024 slices on it is enough
    that this is within the tolerance.  Where that does not happen the answer is UNRESOLVED.
    """
    first, *more = sizes
    answers = [(yield from _next(found, first, []))]
    distances = [np.inf]  # of each answer from the last one before it that converged
    for size in more:
        if answers[-1].status is Status.INFEASIBLE:
            break
        before = [answer for answer in answers if answer.status is Status.CONVERGED]
        answers.append((yield from _next(found, size, answers)))
        last = answers[-1]
        both = last.status is Status.CONVERGED and bool(before)
        # So many that as many again would not fit: the estimate alone must do.
        wanted = tolerance * (_SHARE if size >= _MANY else 1)
        limit = wanted if size < min(_MANY, more[-1]) else np.inf
        distance = contour_error_upto(limit, last.clay, before[-1].clay) if both else np.inf
        distances.append(distance if distance <= limit else np.inf)
        if distances[-1] <= wanted:
            break
    return _nearest(answers, np.array(distances) / _SHARE, tolerance)


def _nearest(answers: list[Solution], errors: np.ndarray, tolerance: float) -> Solution:
    """The last answer; where it is none, the best of those before, as unresolved."""
    best = len(answers) - 1
    if answers[-1].status is not Status.CONVERGED and np.isfinite(errors).any():
        best = int(np.argmin(errors))
    chosen, code = _with_levels(answers[: best + 1]), answers[best].status_code
    if chosen.status is Status.CONVERGED and not errors[best] <= tolerance:
        code = np.asarray(Status.UNRESOLVED.value)
    return dataclasses.replace(chosen, error_estimate=errors[best], status_code=code)


def _next(found: Placed, slices: int, answers: list[Solution]) -> Plan:
    """The answer on so many slices, placed by the last one and starting from it."""
    # What is no answer places no nodes.
    good = bool(answers) and answers[-1].status is Status.CONVERGED
    answer = answers[-1] if good else None
    problem = pose_on_host(found, slices, "placed", answer)
    if answer is None:
        return (yield Wanted(problem, None))
    new = yield Wanted(problem, carried(problem, answer))
    return new if new.status is Status.CONVERGED else (yield Wanted(problem, None))


def _with_levels(answers: list[Solution]) -> Solution:
    levels = np.array([int(answer.iterations) for answer in answers[:-1]], int)
    return dataclasses.replace(answers[-1], levels=levels)


def followed(plan: Plan, solve: Any) -> Solution:
    """What a plan returns if ``solve(wanted)`` answers what it asks for."""
    try:
        wanted = next(plan)
        while True:
            wanted = plan.send(solve(wanted))
    except StopIteration as end:
        return end.value
