"""Run scenes x methods x slices: every answer certified, every time measured apart from compiling.

Four kinds of rows come out, told apart by the column ``experiment``:

- ``answer``: the method's default settings, the table's rows;
- ``grid``: the same on the other grids of the chart of contour errors;
- ``ladder``: fresh runs over a ladder of steps or tolerances, for the chart of
  gap against time;
- ``trace``: fresh runs stopped after more and more iterations, for E_total
  against time.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator

from jaxclay.clay.clay import Clay
from jaxclay.experiments.compare.clock import Clock
from jaxclay.experiments.compare.peers import PEERS, refusal
from jaxclay.experiments.compare.plan import Job, Plan
from jaxclay.experiments.compare.rows import Row, certified, distance, slack, start_energy
from jaxclay.numerics.checks import REFUSALS
from jaxclay.solve.minimize import minimize
from jaxclay.solve.solution import Solution

LADDERS: dict[str, tuple[str, tuple[float, ...]]] = {
    "newton": ("tolerance", (1.0, 1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-11, 1e-14)),
    "lbfgs": ("tolerance", (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)),
    "lbfgs-preconditioned": ("tolerance", (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)),
    "optax-lbfgs": ("tolerance", (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)),
    "lbfgsb": ("tolerance", (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-13)),
    "projected-gradient": ("tolerance", (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-13)),
    "augmented-lagrangian": ("tolerance", (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)),
    "adam": ("tolerance", (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-13)),
    "greedy": ("step", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)),
    "greedy-refined": ("smallest_step", (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)),
    "lattice": ("smallest_spacing", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)),
}
PEER_LADDER = ("tolerance", (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12))
STOPS = (1, 2, 4, 8, 16, 64, 256, 1024, 8192)


@dataclasses.dataclass
class Overlay:
    """Shapes for the overlay chart, from the first grid of a scene in one of the units."""

    scene: str
    units: str
    slices: int
    rest: Clay
    rough: Clay
    answers: dict[str, Clay]


def run(
    plan: Plan, tick: Callable[[str], None] = lambda _: None
) -> Iterator[tuple[Row, Overlay | None]]:
    """Yield rows as they are measured; ``tick`` hears of every job and method as it begins."""
    clock = Clock(plan.repeats)
    finest: dict[tuple[str, str], Clay | None] = {}
    for job in plan.jobs():
        yield from _run_job(plan, job, clock, finest, tick)


def _run_job(plan, job, clock, finest, tick):
    scene, units, n = job.scene, job.units, job.slices
    tick(f"{scene.name} {units} {n}")
    clock.warm_up(plan.contestants, n)
    try:
        problem = scene.problems(units, n)[-1]
    except REFUSALS as error:
        for method in plan.contestants:
            yield _skipped(job, method, str(error)), None
        return
    reference = minimize(problem)
    target = _finest(plan, job, finest)
    answers: dict[str, Clay] = {}
    for method in plan.contestants:
        reason = refusal(method, problem) if method in PEERS else ""
        if reason:
            yield _skipped(job, method, reason), None
            continue
        tick(f"{scene.name} {units} {n} {method}")
        row, answer = _answer(job, method, job.experiment, problem, reference, clock)
        row["contour_error_finest"] = distance(answer.clay, target)
        answers[method] = answer.clay
        overlay = None
        if job.shown and method == plan.methods[-1]:
            rough = answer.rough.clay(problem.clay)
            overlay = Overlay(scene.name, units, n, problem.clay, rough, answers)
        yield row, overlay
        if job.shown and scene.name in plan.on_ladders:
            yield from _ladders(job, method, problem, reference, clock)


def _ladders(job, method, problem, reference, clock):
    setting, values = PEER_LADDER if method in PEERS else LADDERS.get(method, ("", ()))
    for value in values:
        row, _ = _answer(job, method, "ladder", problem, reference, clock, {setting: value})
        yield row, None
    for stop in STOPS:
        row, _ = _answer(job, method, "trace", problem, reference, clock, {"max_iterations": stop})
        yield row, None
        if row["iterations"] < stop:
            return


def _finest(plan: Plan, job: Job, known: dict) -> Clay | None:
    """The certified minimum on the finest grid, or None if it is not asked for or certified."""
    key = job.scene.name, job.units
    if job.scene.name not in plan.on_grids:
        return None
    if key not in known:
        try:
            answer = minimize(job.scene.problems(job.units, plan.finest)[-1])
            known[key] = answer.clay if answer.certificate.accepted else None
        except REFUSALS:
            known[key] = None
    return known[key]


def _answer(
    job, method, experiment, problem, reference, clock, settings=None
) -> tuple[Row, Solution]:
    """One method's answer as a row, certified against the certified minimum."""
    settings = settings or {}
    timing, answer = clock.time(problem, reference.rough, method, settings)
    row = _row(job, method, experiment) | timing
    row |= certified(answer, reference)
    row |= {
        "setting": next(iter(settings), ""),
        "value": float(next(iter(settings.values()), float("nan"))),
        "energy_start": start_energy(answer),
        "slack": slack(answer),
        "visits_per_second": _visits(method, answer, timing["solve_s"]),
        "paper_1993_s": 0.3 if method == "greedy" and job.slices == 64 else float("nan"),
    }
    return row, answer


def _row(job: Job, method: str, experiment: str) -> Row:
    return {
        "experiment": experiment,
        "scene": job.scene.name,
        "units": job.units,
        "slices": job.slices,
        "method": method,
    }


def _skipped(job: Job, method: str, reason: str) -> Row:
    return _row(job, method, job.experiment) | {"status": "skipped", "reason": reason}


def _visits(method: str, answer: Solution, seconds: float) -> float:
    """Greedy's speed: free nodes visited a second, both candidate moves tried."""
    if not method.startswith("greedy"):
        return float("nan")
    return int(answer.iterations) * int(answer.unknowns) / seconds
