"""How long tasks take: measured where the folder has results, else about what methods need."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

from jaxclay.experiments.entries.tasks import Task

MEASURED = ("kind", "method", "scheme", "slices", "elements", "tolerance")  # what times go by
MOST = 256  # tasks in a batch
_SAVE_EVERY = 10.0  # seconds of work that a kill may cost
_QUICK = {"newton": 1e-3, "greedy": 5e-3, "lbfgs-preconditioned": 1e-2}  # at 64 slices
_OTHERS = 5e-2  # seconds of another method there, growing with the slices squared
_AROUND = 5e-3  # posing, the reference and the certificate
_REFERENCE, _FIRST = 0.3, 3.0  # the continuum's minimum and distances to it; a first answer
_COMPILING, _COMPILING_SPLINE = 5.0, 15.0  # for each shape
_RUNS, _SHORT = 10, 0.1  # of a timed task, about, and of one that takes so many seconds two


class Estimate(NamedTuple):
    """Seconds by what was measured: medians of ``solve_s`` for each value of MEASURED."""

    known: dict[tuple, float]

    def seconds(self, task: Task) -> float:
        """Seconds that a task takes, compiling apart."""
        d = task.discretisation
        solve = self.known.get((task.kind, task.method, *(getattr(d, n) for n in MEASURED[2:])))
        if solve is None:
            solve = _QUICK.get(task.method, _OTHERS) * ((d.slices or 64) / 64) ** 2
            solve = min(solve, task.budget or solve)
        runs = min(_RUNS, 1 + _RUNS * _SHORT / solve) if task.kind == "timing" else 1
        runs *= 1 + len(task.stops) / 2
        return solve * runs + _AROUND + _REFERENCE * bool(task.continuum) + _FIRST * task.first

    def total(self, todo: list[Task], workers: int) -> float:
        """Seconds that all tasks take on so many workers, compiling included."""
        schemes = (scheme for scheme, *_ in {task.shape for task in todo})
        compiling = sum(_COMPILING_SPLINE if one == "spline" else _COMPILING for one in schemes)
        return sum(map(self.seconds, todo)) / workers + compiling

    def batches(self, todo: list[Task], workers: int) -> Iterator[list[Task]]:
        """The tasks in lists of one shape: work for all, saved every few seconds."""
        for _, group in itertools.groupby(todo, key=lambda task: task.shape):
            same = list(group)
            most = min(int(_SAVE_EVERY / max(map(self.seconds, same))), MOST)
            size = max(1, min(most, math.ceil(len(same) / workers)))
            yield from (same[begin : begin + size] for begin in range(0, len(same), size))
