"""Solves a batch of tasks of one shape: a row each, of what was asked for and what came out."""

from __future__ import annotations

import dataclasses
import datetime
import functools
import math
import time
from collections.abc import Hashable
from typing import Any

import numpy as np

from jaxclay.clay.contour import contour_error
from jaxclay.experiments.contestants import SINGLE, Ready, prepare, rounding_at
from jaxclay.experiments.entries.tasks import Task
from jaxclay.experiments.entries.values import static_settings
from jaxclay.experiments.machine import where
from jaxclay.experiments.peers import PEERS
from jaxclay.experiments.solving import clock
from jaxclay.experiments.solving.clock import OUT_OF_TIME, Times
from jaxclay.experiments.solving.references import (
    certified_minima,
    certified_minimum,
    continuum,
    posed,
    reference_method,
    whole,
)
from jaxclay.methods.choice import method_settings
from jaxclay.numerics.checks import REFUSALS, Missing
from jaxclay.numerics.host import as_compiled
from jaxclay.schemes.energies import total_energy
from jaxclay.solve.batch import deform_batch, minimize_batch
from jaxclay.solve.minimize import deform
from jaxclay.solve.solution import Solution

Row = dict[str, Any]
_NONE = "none certified"
_OF_SCENE = ("source", "units", "place", "number", "radius", "height", "k", "mu", "alpha", "beta")
_OF_TASK = ("key", "kind", "method", "precision", "budget", "call")


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


def inputs(task: Task) -> Row:
    """What was asked for, as columns."""
    s = task.specification
    row: Row = {name: getattr(task, name) for name in _OF_TASK}
    row |= {name: getattr(s, name) for name in _OF_SCENE}
    row |= dataclasses.asdict(task.discretisation)
    for name in ("bottom", "height", "ratio"):
        row[f"band_{name}"] = getattr(s.bands[-1], name) if s.bands else math.nan
    return row | {
        "scene": s.name, "specification": s.key, "squashes": len(s.bands),
        "settings": task.chosen, "task": task.described(),
        "packages": " ".join(map(" ".join, task.packages.items())),
    }  # fmt: skip


def skipped(reason: str) -> Row:
    """What came out where nothing was solved."""
    empty = dict.fromkeys(("contour_height", "contour_radius"), np.zeros(0))
    return {"status": "skipped", "reason": reason, "reference": _NONE} | empty | Times()._asdict()


@as_compiled()  # an answer that is none may have no contour
def _certified(task: Task, answer: Solution, minimum: Solution | None, times: Times) -> Row:
    """What came out, the gap and the contour error those to a minimum that is certified."""
    certificate, problem, nan = answer.certificate, answer.problem, math.nan
    lowest = nan if minimum is None else float(minimum.energy)
    scale = float((minimum or answer).certificate.energy_free)
    gap, estimate = float(answer.energy) - lowest, answer.error_estimate
    fine = continuum(task.specification, task.continuum) if task.continuum else None
    clay, error = fine or (None, nan)
    start = slack = nan
    if task.discretisation.scheme != "spline":
        start = float(total_energy(problem, answer.rough.heights))
        # Least thickness above the floor of a loose slice, over its thickness at rest.
        stretch = np.asarray(answer.clay.thickness) / np.asarray(problem.clay.thickness)
        slack = float((stretch - problem.material.floor)[problem.loose].min(initial=np.inf))
    row = times._asdict() | {
        "status": str(answer.status),
        "reason": answer.message,
        "case": answer.rough.case,
        "case_below": answer.rough.case_below,
        "floored": bool(answer.rough.floored),
        "energy": float(answer.energy),
        "energy_start": start,
        "energy_minimum": lowest,
        "energy_free": scale,
        "gap": gap,
        # Where nothing is free, E_free is 0.
        "gap_relative": gap / scale if scale > 0 else 0.0 if gap == 0 else nan,
        "contour_error": nan if minimum is None else contour_error(answer.clay, minimum.clay),
        "contour_error_continuum": nan if clay is None else contour_error(answer.clay, clay),
        "continuum_error": error,
        "error_estimate": nan if estimate is None else float(estimate),
        "reference": _NONE if minimum is None else reference_method(task.method),
        "iterations": int(answer.iterations),
        "unknowns": int(answer.unknowns),
        "slack": slack,
        **{name: float(getattr(certificate, name)) for name in ("decrement", "step", "residual")},
        "positive": bool(certificate.positive),
        **_shape("contour", answer.clay),
    }
    if task.kind == "timing":
        row |= _shape("before", answer.before)
        if task.discretisation.scheme != "spline":
            row |= _shape("start", answer.rough.clay(problem.clay))
    return row


def _shape(name: str, clay: Any) -> Row:
    heights = np.asarray(clay.heights)
    middle, radii = (heights[:-1] + heights[1:]) / 2, np.asarray(clay.radii)
    return {f"{name}_height": middle, f"{name}_radius": radii}


def _together(batch: list[Task]) -> list[Row]:
    """One compiled call for all that can be posed; of placed slices one for those on as many."""
    method, size = batch[0].method, batch[0].discretisation
    results: dict[int, Row] = {}
    found: dict[int, Any] = {}
    for i, task in enumerate(batch):
        try:
            scene = task.specification
            found[i] = whole(scene) if size.placed else posed(scene, size)
        except REFUSALS as error:
            results[i] = skipped(str(error))
    scenes, begin = list(found.values()), time.perf_counter()
    if size.placed:
        how: dict[str, Any] = {"slices": size.slices or None, "tolerance": size.tolerance or None}
        answers = deform_batch(scenes, **how)
    else:
        settings = [method_settings(method, dict(batch[i].settings)) for i in found]
        answers = minimize_batch(scenes, settings, method)
    seconds = (time.perf_counter() - begin) / max(len(scenes), 1)
    times = Times(solve_s=seconds, repeats=1, batch=len(scenes))
    if size.placed:
        minima = [certified_minimum(batch[0], answer) for answer in answers]
    else:
        minima = certified_minima(scenes, method)
    for i, answer, minimum in zip(found, answers, minima, strict=True):
        results[i] = _certified(batch[i], answer, minimum, times)
    return [results[i] for i in range(len(batch))]


def _alone(task: Task) -> Row:
    """A task by itself: timed, or in throughput once."""
    try:
        if task.budget and task.method not in PEERS:
            most = dict(task.settings).get("max_iterations", math.inf)
            ready, program = functools.partial(_prepared, task), (_program(task), task.budget)
            answer, times, late = clock.within_budget(program, ready, task.budget, most)
        else:
            answer, times = _timed(task)  # peers are told their seconds
            late = task.budget > 0 and str(answer.status) == "iteration limit"
        minimum = certified_minimum(task, answer)
    except REFUSALS as error:
        return skipped(str(error))
    row = _certified(task, answer, minimum, times)
    if task.precision == SINGLE and minimum is not None:
        row |= {f"single_{name}": value for name, value in rounding_at(minimum)._asdict().items()}
    return row | ({"status": OUT_OF_TIME} if late else {})


def _prepared(task: Task, more: dict[str, Any] | None = None) -> Ready:
    """The call that is timed: of a posed problem, or of all from the clay on."""
    d, settings = task.discretisation, dict(task.settings) | (more or {})
    if task.method not in PEERS and (d.placed or task.call == "deform"):
        how = {name: value for name, value in dataclasses.asdict(d).items() if value} | settings
        if d.tolerance:  # which places slices by itself
            del how["spacing"]
        piece = whole(task.specification)
        return Ready(functools.partial(deform, *piece, task.method, **how), lambda answer: answer)
    problem, seconds = posed(task.specification, d), task.budget or None
    setup = functools.partial(prepare, problem, task.method, settings, task.precision, seconds)
    return clock.setting_up(_program(task), setup) if task.method in PEERS else setup()


def _timed(task: Task) -> tuple[Solution, Times]:
    """The answer and its times, those of fresh runs ended after each stop among them."""
    ready, program = _prepared(task), _program(task)
    if task.kind == "throughput":
        outcome, seconds, _ = clock.clocked(ready.call)
        return ready.certified(outcome), Times(solve_s=seconds, repeats=1, batch=1)
    first_s = clock.first_answer(program, ready.call) if task.first else math.nan
    outcome, times = clock.timed(program, ready.call, task.repeats)
    trace = []
    for stop in task.stops:
        limited = _prepared(task, {"max_iterations": stop})
        ended, taken = clock.timed(program, limited.call, task.repeats)
        there = limited.certified(ended)
        trace.append((int(there.iterations), taken.solve_s, float(there.energy)))
        if int(there.iterations) < stop:
            break
    iterations, seconds, energy = np.array(trace).reshape(-1, 3).T
    times = times._replace(
        first_s=first_s, trace_iterations=iterations, trace_s=seconds, trace_energy=energy
    )
    return ready.certified(outcome), times


def _program(task: Task) -> Hashable:
    """What is compiled once in a process; shared with the references, where it is the same."""
    d, static = task.discretisation, static_settings(task.method, dict(task.settings))
    if not (static or d.placed or d.scheme == "spline" or task.precision == SINGLE):
        return task.method, d.scheme, d.slices
    return task.method, d, task.precision, static
