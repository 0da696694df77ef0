"""Run every method on every cell of the sweeps and mark what came of it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from jaxclay.experiments.atlas.attempt import Attempt, Attempts
from jaxclay.experiments.atlas.marks import Mark, mark_of
from jaxclay.experiments.atlas.single import rounding_at
from jaxclay.experiments.atlas.sweeps import SINGLE, Cell, Grids
from jaxclay.schemes.rough import RoughShape, rough_shape
from jaxclay.solve.minimize import minimize
from jaxclay.solve.solution import Solution

Row = dict[str, Any]

_DEFAULT = "newton"


def run(
    grids: Grids, methods: list[str], seconds: float, tick: Callable[[str], None] = lambda _: None
) -> Iterator[list[Row]]:
    """Yield the rows of each cell, one for each method; ``tick`` hears of each attempt.

    In the sweep over slices a method that was out of time on a grid is not tried on finer ones,
    but for the default method.
    """
    attempts, slow = Attempts(seconds), set()
    for cell in grids.cells():
        tick(cell.name)
        attempts.on_grid(cell.slices)
        rows = rows_of(cell, [m for m in methods if (cell.panel, m) not in slow], attempts, tick)
        if cell.sweep == "slices":
            late = {r["method"] for r in rows if r["mark"] == str(Mark.OUT_OF_TIME)} - {_DEFAULT}
            slow |= {(cell.panel, method) for method in late}
        yield rows


def rows_of(cell: Cell, methods: list[str], attempts: Attempts, tick) -> list[Row]:
    """What the methods make of a cell, a row each."""
    try:
        problem = cell.problem()
    except ValueError as error:
        refused = {"mark": str(Mark.REFUSED), "status": "error", "reason": str(error)}
        return [_place(cell, method) | refused for method in methods]
    rough, best = rough_shape(problem), minimize(problem)
    shared = _rounding(best) if cell.precision == SINGLE else {}
    answers: dict[str, Attempt] = {}
    for method in methods:
        tick(f"{cell.name} {method}")
        answers[method] = attempts(problem, rough, method, cell.precision)
    least = _least_certified([best, *(answer.solution for answer in answers.values())])
    return [
        _place(cell, method) | _outcome(answer, rough, least, best) | shared
        for method, answer in answers.items()
    ]


def _least_certified(answers: list[Solution]) -> float:
    energies = [float(a.energy) for a in answers if a.certificate.accepted]
    return min(energies, default=float("nan"))


def _place(cell: Cell, method: str) -> Row:
    return {
        "sweep": cell.sweep,
        "panel": cell.panel,
        "x": cell.x,
        "y": cell.y,
        "slices": cell.slices,
        "precision": cell.precision,
        "method": method,
    }


def _outcome(attempt: Attempt, rough: RoughShape, least: float, best: Solution) -> Row:
    answer, scale = attempt.solution, float(best.certificate.energy_free)
    gap = (float(answer.energy) - least) / scale if scale > 0 else 0.0
    return {
        "mark": str(mark_of(answer.status, gap)),
        "status": str(answer.status),
        "reason": answer.message,
        "gap_relative": gap,
        "energy": float(answer.energy),
        "energy_minimum": least,
        "decrement": float(answer.certificate.decrement),
        "step": float(answer.certificate.step),
        "iterations": int(answer.iterations),
        "solve_s": attempt.seconds,
        "floored": bool(rough.floored),
    }


def _rounding(best: Solution) -> Row:
    """What float32 says at the minimum, if there is one."""
    if not best.certificate.accepted:
        return {}
    return {f"single_{name}": value for name, value in rounding_at(best)._asdict().items()}
