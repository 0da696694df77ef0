"""How long tasks take: measured where the folder has results, else what is known of the methods."""

from __future__ import annotations

import math

from jaxclay.experiments.entries.tasks import Task

# Seconds of a solve at 64 slices on the scenes of the paper, and how they grow with the slices.
_UNKNOWN = (5e-2, 1.5)  # of a method that is not among them
_SECONDS = {
    "newton": (4e-4, 1.1),
    "lbfgs": (2e-2, 1.5),
    "lbfgs-preconditioned": (8e-3, 2.0),
    "optax-lbfgs": (3e-2, 1.5),
    "lbfgsb": (2e-2, 1.5),
    "projected-gradient": (5e-2, 2.0),
    "augmented-lagrangian": (0.2, 1.5),
    "adam": (5e-2, 1.5),
    "greedy": (5e-3, 2.0),
    "greedy-refined": (0.2, 2.0),
    "lattice": (2e-2, 1.5),
}
_OTHER = 1e-2  # on splines, or to a tolerance
_AROUND = 5e-3  # posing, the reference and the certificate
_REFERENCE = 0.3  # the continuum's minimum, where that is asked for, and distances to it
_COMPILING, _COMPILING_SPLINE, _COMPILING_REFERENCE = 5.0, 15.0, 15.0  # seconds for each shape
_RUNS, _SHORT = 10, 0.1  # of a timed task, about, and of one that takes so many seconds two
_FIRST = 3.0  # seconds of a first answer
_SAVE_EVERY = 10.0  # seconds of work that a kill may cost
MOST = 256  # tasks in a batch
MEASURED = ("kind", "method", "scheme", "slices", "elements", "tolerance")  # what times go by


def seconds_of(task: Task, known: dict[tuple, float]) -> float:
    """Seconds that a task takes, compiling apart; ``known`` are medians of ``solve_s``."""
    d = task.discretisation
    solve = known.get((task.kind, task.method, *(getattr(d, name) for name in MEASURED[2:])))
    if solve is None:
        at_64, power = _SECONDS.get(task.method, _UNKNOWN)
        solve = at_64 * (d.slices / 64) ** power if d.slices else _OTHER
        solve = min(solve, task.budget or solve)
    runs = min(_RUNS, 1 + _RUNS * _SHORT / solve) if task.kind == "timing" else 1
    runs *= 1 + len(task.stops) / 2
    around = _AROUND + (_REFERENCE if task.continuum else 0.0) + (_FIRST if task.first else 0.0)
    return solve * runs + around


def batch_sizes(todo: list[Task], known: dict[tuple, float], workers: int) -> dict[tuple, int]:
    """How many tasks of each shape go into a batch: work for all, saved every few seconds."""
    counts: dict[tuple, list[float]] = {}
    for task in todo:
        counts.setdefault(task.shape, []).append(seconds_of(task, known))
    return {
        shape: max(1, min(int(_SAVE_EVERY / max(each)), MOST, math.ceil(len(each) / workers)))
        for shape, each in counts.items()
    }


def total_seconds(todo: list[Task], known: dict[tuple, float], workers: int) -> float:
    """Seconds that all tasks take on so many workers, compiling included."""
    solving = sum(seconds_of(task, known) for task in todo)
    shapes = {task.shape for task in todo}
    compiling = sum(
        _COMPILING_SPLINE if scheme == "spline" else _COMPILING for scheme, *_ in shapes
    )
    if any(task.continuum for task in todo):
        compiling += _COMPILING_REFERENCE
    return solving / workers + compiling
