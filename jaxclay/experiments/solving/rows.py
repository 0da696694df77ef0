"""A task's row: what was asked for, what the answer is worth, its distance to a minimum."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.clay.contour import contour_error
from jaxclay.experiments.entries.tasks import Task
from jaxclay.experiments.solving.clock import Times
from jaxclay.experiments.solving.references import continuum, reference_method
from jaxclay.schemes.energies import total_energy
from jaxclay.solve.solution import Solution

Row = dict[str, Any]
_NONE = "none certified"
_EMPTY = np.zeros(0)
_OF_SCENE = ("source", "units", "place", "number", "radius", "height", "k", "mu", "alpha", "beta")
_OF_TASK = ("key", "kind", "method", "precision", "budget", "call")


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
    empty = {"contour_height": _EMPTY, "contour_radius": _EMPTY}
    return {"status": "skipped", "reason": reason, "reference": _NONE} | empty | Times()._asdict()


def certified(task: Task, answer: Solution, minimum: Solution | None, times: Times) -> Row:
    """What came out, the gap and the contour error those to a minimum that is certified."""
    certificate = answer.certificate
    lowest = math.nan if minimum is None else float(minimum.energy)
    scale = float((minimum or answer).certificate.energy_free)
    gap = float(answer.energy) - lowest
    spline, found = task.discretisation.scheme == "spline", None
    if task.continuum:
        found = continuum(task.specification, task.continuum)
    row = times._asdict() | {
        "status": str(answer.status),
        "reason": answer.message,
        "case": answer.rough.case,
        "case_below": answer.rough.case_below,
        "floored": bool(answer.rough.floored),
        "energy": float(answer.energy),
        "energy_start": math.nan if spline else _start_energy(answer),
        "energy_minimum": lowest,
        "energy_free": scale,
        "gap": gap,
        # Where nothing is free, E_free is 0.
        "gap_relative": gap / scale if scale > 0 else 0.0 if gap == 0 else math.nan,
        "contour_error": _distance(answer.clay, minimum),
        "contour_error_continuum": _distance(answer.clay, found),
        "continuum_error": math.nan if found is None else found.error,
        "error_estimate": _number(answer.error_estimate),
        "reference": _NONE if minimum is None else reference_method(task.method),
        "iterations": int(answer.iterations),
        "unknowns": int(answer.unknowns),
        "slack": math.nan if spline else _slack(answer),
        **{name: float(getattr(certificate, name)) for name in ("decrement", "step", "residual")},
        "positive": bool(certificate.positive),
        **_shape("contour", answer.clay),
    }
    if task.kind == "timing":
        row |= _shape("before", answer.before)
        row |= {} if spline else _shape("start", answer.rough.clay(answer.problem.clay))
    return row


def _start_energy(answer: Solution) -> float:
    """E_total of the rough shape, where methods on slices start."""
    return float(total_energy(answer.problem, answer.rough.heights))


def _slack(answer: Solution) -> float:
    """Least thickness above the floor of a loose slice, over its thickness at rest."""
    problem = answer.problem
    stretch = np.asarray(answer.clay.thickness) / np.asarray(problem.clay.thickness)
    return float((stretch - problem.material.floor)[problem.loose].min(initial=np.inf))


def _distance(clay: Clay, target: Any) -> float:
    """The contour error over l; not a number where there is no target."""
    return math.nan if target is None else contour_error(clay, target.clay)


def _number(value: Any) -> float:
    return math.nan if value is None else float(np.asarray(value))


def _shape(name: str, clay: Any) -> Row:
    heights = np.asarray(clay.heights)
    middle, radii = (heights[:-1] + heights[1:]) / 2, np.asarray(clay.radii)
    return {f"{name}_height": middle, f"{name}_radius": radii}
