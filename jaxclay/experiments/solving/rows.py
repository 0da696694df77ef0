"""What an answer is worth, as columns: its status, its certificate, its distance to a minimum."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.clay.contour import contour_error
from jaxclay.schemes.energies import total_energy
from jaxclay.solve.solution import Solution

Row = dict[str, Any]


def certified(answer: Solution, reference: Solution | None) -> Row:
    """An answer's columns, its gap and contour error those to a reference that is certified."""
    if reference is not None and not bool(reference.certificate.accepted):
        reference = None
    minimum = float("nan") if reference is None else float(reference.energy)
    scale = float((reference or answer).certificate.energy_free)
    gap = float(answer.energy) - minimum
    relative = gap / scale if scale > 0 else 0.0 if gap == 0 else float("nan")
    return {
        "status": str(answer.status),
        "reason": answer.message,
        "case": answer.rough.case,
        "case_below": answer.rough.case_below,
        "floored": bool(answer.rough.floored),
        "energy": float(answer.energy),
        "energy_minimum": minimum,
        "energy_free": scale,
        "gap": gap,
        "gap_relative": relative,  # where nothing is free, E_free is 0
        "contour_error": distance(answer.clay, None if reference is None else reference.clay),
        "iterations": int(answer.iterations),
        "unknowns": int(answer.unknowns),
        "decrement": float(answer.certificate.decrement),
        "step": float(answer.certificate.step),
        "residual": float(answer.certificate.residual),
        "positive": bool(answer.certificate.positive),
    }


def start_energy(answer: Solution) -> float:
    """E_total of the rough shape, where methods on the paper's scheme start."""
    return float(total_energy(answer.problem, answer.rough.heights))


def slack(answer: Solution) -> float:
    """Least thickness above the floor of a loose slice, over its thickness at rest."""
    problem = answer.problem
    stretch = np.asarray(answer.clay.thickness) / np.asarray(problem.clay.thickness)
    return float((stretch - problem.material.floor)[problem.loose].min(initial=np.inf))


def distance(clay: Clay, target: Clay | None) -> float:
    """The contour error over l; not a number where there is no target."""
    return float("nan") if target is None else contour_error(clay, target)
