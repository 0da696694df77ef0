"""Solves a batch of tasks of one shape and says what came out: the work of one worker."""

from __future__ import annotations

import datetime
import math
import time
from typing import Any

import numpy as np

from jaxclay.experiments.compare import rows
from jaxclay.experiments.compare.rows import Row
from jaxclay.experiments.sweep.batched import minimized
from jaxclay.experiments.sweep.references import (
    certified_minima,
    continuum,
    minimum_on_spans,
    on_spans,
    posed,
    reference_method,
    whole,
)
from jaxclay.experiments.sweep.tasks import Task
from jaxclay.experiments.sweep.timing import Times, timed_slices, timed_spans
from jaxclay.experiments.sweep.where import where
from jaxclay.numerics.checks import REFUSALS
from jaxclay.solve.batch import deform_batch
from jaxclay.solve.minimize import minimize
from jaxclay.solve.solution import Solution

_NONE = "none certified"
_NOT_TIMED = Times()


def solve(batch: list[Task]) -> list[Row]:
    """A row for each task of one shape; what cannot be posed has the status "skipped"."""
    timing, splines = batch[0].kind == "timing", batch[0].scheme == "spline"
    if timing:
        found = [_timed(task) for task in batch]
    elif batch[0].tolerance:
        found = _to_tolerance(batch)
    else:
        found = [_spans(task) for task in batch] if splines else _slices(batch)
    here, now = where(), datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    return [
        _inputs(task) | row | here | {"finished": now}
        for task, row in zip(batch, found, strict=True)
    ]


def _slices(batch: list[Task]) -> list[Row]:
    """One compiled call for all that can be posed."""
    results: dict[int, Row] = {}
    problems = {}
    for i, task in enumerate(batch):
        try:
            problems[i] = posed(task.recipe, task.slices, task.scheme)
        except REFUSALS as error:
            results[i] = _skipped(error)
    method = batch[0].method
    begin = time.perf_counter()
    answers = minimized(
        list(problems.values()), method, [dict(batch[i].settings) for i in problems]
    )
    seconds = (time.perf_counter() - begin) / max(len(problems), 1)
    wanted = [(batch[i].recipe, batch[i].slices, batch[i].scheme) for i in problems]
    minima = certified_minima(wanted, method)
    for i, answer, minimum in zip(problems, answers, minima, strict=True):
        times = Times(solve_s=seconds, repeats=1, batch=len(problems))
        results[i] = _certified(batch[i], answer, minimum, reference_method(method), times)
    return [results[i] for i in range(len(batch))]


def _to_tolerance(batch: list[Task]) -> list[Row]:
    """On as many slices as the tolerance needs, those on as many in one compiled call."""
    results: dict[int, Row] = {}
    scenes = {}
    for i, task in enumerate(batch):
        try:
            scenes[i] = whole(task.recipe)
        except REFUSALS as error:
            results[i] = _skipped(error)
    begin = time.perf_counter()
    answers = deform_batch(scenes.values(), tolerance=batch[0].tolerance)
    seconds = (time.perf_counter() - begin) / max(len(scenes), 1)
    times = Times(solve_s=seconds, repeats=1, batch=len(scenes))
    for i, answer in zip(scenes, answers, strict=True):
        row = _certified(batch[i], answer, None, _NONE, times)
        results[i] = row | {"error_estimate": float(np.asarray(answer.error_estimate))}
    return [results[i] for i in range(len(batch))]


def _spans(task: Task) -> Row:
    """Splines, each a call of its own."""
    try:
        problem = on_spans(task.recipe, task.elements)
    except REFUSALS as error:
        return _skipped(error)
    begin = time.perf_counter()
    answer = minimize(problem, task.method)
    times = Times(solve_s=time.perf_counter() - begin, repeats=1, batch=1)
    return _of_spans(task, answer, times)


def _timed(task: Task) -> Row:
    """A task alone, repeated; compiling apart."""
    try:
        if task.scheme == "spline":
            problem = on_spans(task.recipe, task.elements)
            return _of_spans(task, *timed_spans(task, problem))
        (minimum,) = certified_minima([(task.recipe, task.slices, task.scheme)], task.method)
        answer, times = timed_slices(task, posed(task.recipe, task.slices, task.scheme))
    except REFUSALS as error:
        return _skipped(error)
    return _certified(task, answer, minimum, reference_method(task.method), times)


def _of_spans(task: Task, answer: Solution, times: Times) -> Row:
    minimum = minimum_on_spans(task.recipe, task.elements, task.method)
    return _certified(task, answer, minimum, reference_method(task.method), times)


def _certified(
    task: Task, answer: Solution, minimum: Solution | None, other: str, times: Times
) -> Row:
    row = rows.certified(answer, minimum)
    true = continuum(task.recipe, task.reference) if task.reference else None
    heights = np.asarray(answer.clay.heights)
    return row | times._asdict() | {
        "reference": _NONE if minimum is None else other,
        "energy_start": math.nan if task.scheme == "spline" else rows.start_energy(answer),
        "contour_error_continuum": rows.distance(answer.clay, true),
        "contour_height": (heights[:-1] + heights[1:]) / 2,
        "contour_radius": np.asarray(answer.clay.radii),
    }  # fmt: skip


def _skipped(error: Exception) -> Row:
    none = np.zeros(0)
    return {
        "status": "skipped", "reason": str(error), "reference": _NONE,
        "contour_height": none, "contour_radius": none,
    } | _NOT_TIMED._asdict()  # fmt: skip


def _inputs(task: Task) -> Row:
    """What was asked for, as columns."""
    recipe, last = task.recipe, task.recipe.bands[-1] if task.recipe.bands else None
    row: dict[str, Any] = {
        "key": task.key, "kind": task.kind, "scene": recipe.name, "recipe": recipe.key,
        "number": recipe.number,
        "source": recipe.source, "units": recipe.units, "scheme": task.scheme,
        "slices": task.slices, "elements": task.elements,
        "tolerance": task.tolerance, "error_estimate": math.nan, "method": task.method,
        "settings": task.chosen,
    }  # fmt: skip
    for name in ("radius", "height", "k", "mu", "alpha", "beta"):
        row[name] = getattr(recipe, name)
    row["squashes"] = len(recipe.bands)
    for name in ("bottom", "height", "ratio"):
        row[f"band_{name}"] = math.nan if last is None else getattr(last, name)
    row["task"] = task.described()
    return row
