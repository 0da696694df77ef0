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
from jaxclay.experiments.solving import clock
from jaxclay.experiments.solving.batched import minimized
from jaxclay.experiments.solving.budget import OUT_OF_TIME, attempt
from jaxclay.experiments.solving.clock import Times
from jaxclay.experiments.solving.references import (
    certified_minima,
    certified_minimum,
    posed,
    whole,
)
from jaxclay.experiments.solving.rows import Row, certified, inputs, skipped
from jaxclay.experiments.solving.where import where
from jaxclay.numerics.checks import REFUSALS, Missing
from jaxclay.solve.batch import deform_batch
from jaxclay.solve.minimize import deform
from jaxclay.solve.solution import Solution


def solve(batch: list[Task]) -> list[Row]:
    """A row for each task of one shape; what cannot be posed has the status "skipped"."""
    first, size = batch[0], batch[0].discretisation
    together = first.kind == "throughput" and size.scheme != "spline"
    if size.placed and (first.method != "newton" or any(task.settings for task in batch)):
        together = False  # of placed slices newton alone, as it is, solves many at once
    try:
        found = _together(batch) if together else [_alone(task) for task in batch]
    except Missing as error:
        found = [skipped(str(error))] * len(batch)
    here, now = where(), datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    return [
        inputs(task) | row | here | {"finished": now}
        for task, row in zip(batch, found, strict=True)
    ]


def _together(batch: list[Task]) -> list[Row]:
    """One compiled call for all that can be posed; of placed slices one for those on as many."""
    method, size = batch[0].method, batch[0].discretisation
    results: dict[int, Row] = {}
    scenes: dict[int, Any] = {}
    for i, task in enumerate(batch):
        try:
            scene = task.specification
            scenes[i] = whole(scene) if size.placed else posed(scene, size)
        except REFUSALS as error:
            results[i] = skipped(str(error))
    begin = time.perf_counter()
    if size.placed:
        how: dict[str, Any] = {"slices": size.slices or None, "tolerance": size.tolerance or None}
        answers = deform_batch(scenes.values(), **how)
    else:
        answers = minimized([*scenes.values()], method, [dict(batch[i].settings) for i in scenes])
    seconds = (time.perf_counter() - begin) / max(len(scenes), 1)
    times = Times(solve_s=seconds, repeats=1, batch=len(scenes))
    minima = (
        [certified_minimum(batch[0], answer) for answer in answers]
        if size.placed
        else certified_minima([*scenes.values()], method)
    )
    for i, answer, minimum in zip(scenes, answers, minima, strict=True):
        results[i] = certified(batch[i], answer, minimum, times)
    return [results[i] for i in range(len(batch))]


def _alone(task: Task) -> Row:
    """A task by itself: timed, or in throughput once."""
    try:
        answer, times, late = _within_budget(task) if task.budget else _timed(task)
        minimum = certified_minimum(task, answer)
    except REFUSALS as error:
        return skipped(str(error))
    row = certified(task, answer, minimum, times)
    if task.precision == SINGLE and minimum is not None:
        row |= {f"single_{name}": value for name, value in rounding_at(minimum)._asdict().items()}
    return row | ({"status": OUT_OF_TIME} if late else {})


def prepared(task: Task, more: dict[str, Any] | None = None) -> Ready:
    """The call that is timed: of a posed problem, or of all from the clay on.

    Raises ValueError, Hindrance: Why there is none.
    """
    d, settings = task.discretisation, dict(task.settings) | (more or {})
    if task.method not in PEERS and (d.placed or task.call == "deform"):
        named = {"slices": d.slices, "degree": d.degree, "elements": d.elements,
                 "tolerance": d.tolerance}  # fmt: skip
        # A tolerance places slices by itself.
        named["spacing"] = "" if d.tolerance else d.spacing
        how: dict[str, Any] = {name: value for name, value in named.items() if value} | settings
        piece = whole(task.specification)
        call = functools.partial(deform, *piece, task.method, scheme=d.scheme, **how)
        return Ready(call, lambda answer: answer)
    problem, seconds = posed(task.specification, d), task.budget or None
    setup = functools.partial(prepare, problem, task.method, settings, task.precision, seconds)
    return clock.setting_up(_program(task), setup) if task.method in PEERS else setup()


def _timed(task: Task) -> tuple[Solution, Times, bool]:
    """The answer, its times, and fresh runs ended after each stop."""
    ready, program = prepared(task), _program(task)
    if task.kind == "throughput":
        outcome, seconds, _ = clock.clocked(ready.call)
        return ready.certified(outcome), Times(solve_s=seconds, repeats=1, batch=1), False
    first_s = clock.first_answer(program, ready.call) if task.first else math.nan
    outcome, times = clock.timed(program, ready.call, task.repeats)
    trace = []
    for stop in task.stops:
        limited = prepared(task, {"max_iterations": stop})
        ended, taken = clock.timed(program, limited.call, task.repeats)
        there = limited.certified(ended)
        trace.append((int(there.iterations), taken.solve_s, float(there.energy)))
        if int(there.iterations) < stop:
            break
    iterations, seconds, energy = np.array(trace).reshape(-1, 3).T
    times = times._replace(
        first_s=first_s, trace_iterations=iterations, trace_s=seconds, trace_energy=energy
    )
    return ready.certified(outcome), times, False


def _within_budget(task: Task) -> tuple[Solution, Times, bool]:
    if task.method in PEERS:  # which are told their seconds
        answer, times, _ = _timed(task)
        return answer, times, str(answer.status) == "iteration limit"
    most = dict(task.settings).get("max_iterations", math.inf)
    ready = functools.partial(prepared, task)
    return attempt(ready, (_program(task), task.budget), task.budget, most)


def _program(task: Task) -> Hashable:
    """What is compiled once in a process; shared with the references, where it is the same."""
    d, static = task.discretisation, static_settings(task.method, dict(task.settings))
    if not (static or d.placed or d.scheme == "spline" or task.precision == SINGLE):
        return task.method, d.scheme, d.slices
    return task.method, d, task.precision, static
