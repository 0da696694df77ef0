"""Solves a batch of tasks of one shape and says what came out: the work of one worker."""

from __future__ import annotations

import datetime
import functools
import math
import time
from collections.abc import Hashable
from typing import Any

import numpy as np

from jaxclay.experiments.contestants import Ready, prepare
from jaxclay.experiments.entries.settings import static_settings
from jaxclay.experiments.entries.tasks import Task
from jaxclay.experiments.peers import PEERS
from jaxclay.experiments.precision import SINGLE, rounding_at
from jaxclay.experiments.solving import clock, rows
from jaxclay.experiments.solving.batched import minimized
from jaxclay.experiments.solving.budget import OUT_OF_TIME, attempt
from jaxclay.experiments.solving.clock import Times
from jaxclay.experiments.solving.references import (
    certified_minima,
    certified_minimum,
    continuum,
    minimum_of,
    posed,
    reference_method,
    whole,
)
from jaxclay.experiments.solving.rows import Row
from jaxclay.experiments.solving.where import where
from jaxclay.numerics.checks import REFUSALS, Missing
from jaxclay.solve.batch import deform_batch
from jaxclay.solve.minimize import deform
from jaxclay.solve.solution import Solution

_NONE = "none certified"
_EMPTY = np.zeros(0)


def solve(batch: list[Task]) -> list[Row]:
    """A row for each task of one shape; what cannot be posed has the status "skipped"."""
    try:
        found = _rows(batch)
    except Missing as error:
        found = [skipped(str(error))] * len(batch)
    here, now = where(), datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    return [
        inputs(task) | row | here | {"finished": now}
        for task, row in zip(batch, found, strict=True)
    ]


def _rows(batch: list[Task]) -> list[Row]:
    first, size = batch[0], batch[0].discretisation
    if first.kind == "timing" or size.scheme == "spline":
        return [_alone(task) for task in batch]
    if not size.placed:
        return _slices(batch)
    if first.method == "newton" and not any(task.settings for task in batch):
        return _placed(batch)
    return [_alone(task) for task in batch]


def _slices(batch: list[Task]) -> list[Row]:
    """One compiled call for all that can be posed."""
    results: dict[int, Row] = {}
    problems = {}
    for i, task in enumerate(batch):
        try:
            problems[i] = posed(task.specification, task.discretisation)
        except REFUSALS as error:
            results[i] = skipped(str(error))
    method, begin = batch[0].method, time.perf_counter()
    chosen = [dict(batch[i].settings) for i in problems]
    answers = minimized(list(problems.values()), method, chosen)
    seconds = (time.perf_counter() - begin) / max(len(problems), 1)
    wanted = [(batch[i].specification, batch[i].discretisation) for i in problems]
    minima = certified_minima(wanted, method)
    for i, answer, minimum in zip(problems, answers, minima, strict=True):
        times = Times(solve_s=seconds, repeats=1, batch=len(problems))
        results[i] = _certified(batch[i], answer, minimum, times)
    return [results[i] for i in range(len(batch))]


def _placed(batch: list[Task]) -> list[Row]:
    """Newton on placed slices, those on as many in one compiled call."""
    results: dict[int, Row] = {}
    scenes = {}
    for i, task in enumerate(batch):
        try:
            scenes[i] = whole(task.specification)
        except REFUSALS as error:
            results[i] = skipped(str(error))
    size, begin = batch[0].discretisation, time.perf_counter()
    how: dict[str, Any] = (
        {"tolerance": size.tolerance} if size.tolerance else {"slices": size.slices}
    )
    answers = deform_batch(scenes.values(), **how)
    seconds = (time.perf_counter() - begin) / max(len(scenes), 1)
    times = Times(solve_s=seconds, repeats=1, batch=len(scenes))
    for i, answer in zip(scenes, answers, strict=True):
        minimum = minimum_of(answer.problem, "newton")
        results[i] = _certified(batch[i], answer, minimum, times)
    return [results[i] for i in range(len(batch))]


def _alone(task: Task) -> Row:
    """A task by itself: timed, or in throughput once."""
    try:
        answer, times, late = _within_budget(task) if task.budget else _timed(task)
        d, s = task.discretisation, task.specification
        known = d.placed or task.call == "deform"
        minimum = (
            minimum_of(answer.problem, task.method)
            if known
            else certified_minimum(s, d, task.method)
        )
    except REFUSALS as error:
        return skipped(str(error))
    row = _certified(task, answer, minimum, times)
    if task.precision == SINGLE and minimum is not None:
        row |= {f"single_{name}": value for name, value in rounding_at(minimum)._asdict().items()}
    return row | ({"status": OUT_OF_TIME} if late else {})


def prepared(task: Task, more: dict[str, Any] | None = None) -> Ready:
    """The call that is timed: of a posed problem, or of all from the clay on.

    Raises
    ------
    ValueError, Hindrance
        Why there is none.
    """
    d, settings = task.discretisation, dict(task.settings) | (more or {})
    if task.method not in PEERS and (d.placed or task.call == "deform"):
        piece, method = whole(task.specification), task.method
        named = {"slices": d.slices, "spacing": d.spacing, "degree": d.degree,
                 "elements": d.elements, "tolerance": d.tolerance}  # fmt: skip
        how: dict[str, Any] = {name: value for name, value in named.items() if value}
        if d.tolerance:
            del how["spacing"]  # a tolerance places slices by itself
        call = functools.partial(deform, *piece, method, scheme=d.scheme, **how, **settings)
        return Ready(call, lambda answer: answer)
    problem, seconds = posed(task.specification, d), task.budget or None
    setup = functools.partial(prepare, problem, task.method, settings, task.precision, seconds)
    return clock.setting_up(_program(task), setup) if task.method in PEERS else setup()


def _timed(task: Task) -> tuple[Solution, Times, bool]:
    """The answer, its times, and fresh runs ended after each stop."""
    ready = prepared(task)
    if task.kind == "throughput":
        outcome, seconds, _ = clock.clocked(ready.call)
        return ready.certified(outcome), Times(solve_s=seconds, repeats=1, batch=1), False
    first_s = clock.first_answer(_program(task), ready.call) if task.first else math.nan
    outcome, times = clock.timed(_program(task), ready.call, task.repeats)
    times = times._replace(first_s=first_s)
    trace = []
    for stop in task.stops:
        limited = prepared(task, {"max_iterations": stop})
        ended, taken = clock.timed(_program(task), limited.call, task.repeats)
        there = limited.certified(ended)
        trace.append((int(there.iterations), taken.solve_s, float(there.energy)))
        if int(there.iterations) < stop:
            break
    if trace:
        iterations, seconds, energy = np.array(trace).T
        times = times._replace(trace_iterations=iterations, trace_s=seconds, trace_energy=energy)
    return ready.certified(outcome), times, False


def _within_budget(task: Task) -> tuple[Solution, Times, bool]:
    if task.method in PEERS:  # which are told their seconds
        answer, times, _ = _timed(task)
        return answer, times, str(answer.status) == "iteration limit"
    most = dict(task.settings).get("max_iterations")
    return attempt(
        lambda limit: prepared(task, limit), (_program(task), task.budget), task.budget,
        None if most is None else int(most),
    )  # fmt: skip


def _program(task: Task) -> Hashable:
    """What is compiled once in a process; shared with the references, where it is the same."""
    d, static = task.discretisation, static_settings(task.method, dict(task.settings))
    if not (static or d.placed or d.scheme == "spline" or task.precision == SINGLE):
        return task.method, d.scheme, d.slices
    return task.method, d, task.precision, static


def _certified(task: Task, answer: Solution, minimum: Solution | None, times: Times) -> Row:
    row = rows.certified(answer, minimum)
    found = continuum(task.specification, task.continuum) if task.continuum else None
    estimate, spline = answer.error_estimate, task.discretisation.scheme == "spline"
    row |= times._asdict() | {
        "reference": _NONE if minimum is None else reference_method(task.method),
        "energy_start": math.nan if spline else rows.start_energy(answer),
        "slack": math.nan if spline else rows.slack(answer),
        "contour_error_continuum": rows.distance(answer.clay, found and found.clay),
        "continuum_error": math.nan if found is None else found.error,
        "error_estimate": math.nan if estimate is None else float(np.asarray(estimate)),
    }
    row |= _shape("contour", answer.clay)
    if task.kind == "timing":
        row |= _shape("before", answer.before)
        row |= {} if spline else _shape("start", answer.rough.clay(answer.problem.clay))
    return row


def _shape(name: str, clay: Any) -> Row:
    heights = np.asarray(clay.heights)
    middle, radii = (heights[:-1] + heights[1:]) / 2, np.asarray(clay.radii)
    return {f"{name}_height": middle, f"{name}_radius": radii}


def skipped(reason: str) -> Row:
    """The row of what was not solved."""
    empty = {"contour_height": _EMPTY, "contour_radius": _EMPTY}
    row = {"status": "skipped", "reason": reason, "reference": _NONE}
    return row | empty | Times()._asdict()


def inputs(task: Task) -> Row:
    """What was asked for, as columns."""
    s, last = task.specification, task.specification.bands[-1] if task.specification.bands else None
    d = task.discretisation
    row: Row = {
        "key": task.key, "kind": task.kind, "scene": s.name, "specification": s.key,
        "number": s.number, "source": s.source, "units": s.units, "place": s.place,
        "scheme": d.scheme, "spacing": d.spacing, "degree": d.degree, "slices": d.slices,
        "elements": d.elements, "tolerance": d.tolerance, "method": task.method,
        "settings": task.chosen, "precision": task.precision, "budget": task.budget,
        "call": task.call, "squashes": len(s.bands), "task": task.described(),
        "packages": " ".join(map(" ".join, task.packages.items())),
    }  # fmt: skip
    row |= {n: getattr(s, n) for n in ("radius", "height", "k", "mu", "alpha", "beta")}
    for name in ("bottom", "height", "ratio"):
        row[f"band_{name}"] = math.nan if last is None else getattr(last, name)
    return row
