"""Runs what is missing of an experiment and keeps what comes out, batch by batch."""

from __future__ import annotations

import contextlib
import itertools
import math
import random
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
from threadpoolctl import threadpool_limits

from jaxclay.experiments import backends
from jaxclay.experiments.entries.tables import Experiment
from jaxclay.experiments.entries.tasks import Task, tasks
from jaxclay.experiments.machine import alone, cores, pinned, pool_threads, where
from jaxclay.experiments.solving.clock import OUT_OF_TIME
from jaxclay.experiments.solving.solve import Row, inputs, skipped
from jaxclay.experiments.store import Store, parts, read_part

Callback = Callable[[list[Row], int], None]
MOST = 256  # tasks in a batch
_SAVE_EVERY = 10.0  # seconds of work that a kill may cost
# What the time of a solve goes by: measured where the folder has results, else about this.
_MEASURED = ("kind", "method", "scheme", "slices", "elements", "tolerance")
_QUICK = {"newton": 1e-3, "greedy": 5e-3, "lbfgs-preconditioned": 1e-2}  # at 64 slices
_OTHERS = 5e-2  # seconds of another method there, growing with the slices squared
_AROUND = 5e-3  # posing, the reference and the certificate
_REFERENCE, _FIRST = 0.3, 3.0  # the continuum's minimum and distances to it; a first answer
_COMPILING, _COMPILING_SPLINE = 5.0, 15.0  # for each shape
_RUNS, _SHORT = 10, 0.1  # of a timed task, about, and of one that takes so many seconds two


class Work(NamedTuple):
    """What an experiment comes to."""

    every: list[Task]
    missing: list[Task]  # of which the folder has no result
    seconds: float  # that those take, about
    others: int  # results in the folder that are of none of these tasks


def check_backend(experiment: Experiment, backend: str, scheduler: str | None) -> None:
    """Raise ValueError unless the experiment can run on this backend."""
    if backend not in backends.BACKENDS:
        raise ValueError(f"unknown backend {backend!r}: choose from {', '.join(backends.BACKENDS)}")
    if experiment.kind == "timing" and backend != "serial":
        raise ValueError(
            f'kind = "timing" runs alone on one core, so backend must be serial, not {backend}: '
            'or take kind = "throughput"'
        )
    if scheduler is not None and backend != "dask":
        raise ValueError(f"--scheduler {scheduler} belongs to --backend dask, not to {backend}")


def tasks_of(experiment: Experiment, backend: str = "serial") -> list[Task]:
    """All tasks, with as many threads as the processes that solve them have."""
    return tasks(experiment, pool_threads() if backend == "serial" else 1)


def work(every: list[Task], folder: Path, backend: str = "serial") -> Work:
    """Which of the tasks the folder lacks, and how long those take; writes nothing."""
    done, measured = _so_far(folder)
    missing = [task for task in every if task.key not in done]
    schemes = (scheme for scheme, *_ in {task.shape for task in missing})
    compiling = sum(_COMPILING_SPLINE if one == "spline" else _COMPILING for one in schemes)
    solving = sum(_seconds(task, measured) for task in missing) / _workers(backend)
    return Work(every, missing, solving + compiling, len(done - {task.key for task in every}))


def run(
    every: list[Task],
    folder: Path,
    backend: str = "serial",
    scheduler: str | None = None,
    callback: Callback = lambda rows, done: None,
) -> int:
    """Solve those of the tasks, all of one kind, that the folder lacks.

    ``callback`` hears of every batch's rows, and how many tasks are done by whatever run.  Returns
    how many still lack a result at the end, as where somebody took results away.

    Raises OSError: The folder cannot be written to: what had been written is kept; RuntimeError: A
    worker died; another timing run is under way.
    """
    store, wanted = Store(folder), {task.key for task in every}
    done = store.statuses()
    missing = [task for task in every if task.key not in done]
    if not missing:  # the folder need not even be writable
        return 0
    timing = any(task.kind == "timing" for task in missing)
    lists = list(_batches(missing, _so_far(folder)[1], _workers(backend)))
    if not timing:  # two runs on one folder seldom meet
        begin = random.randrange(len(lists))
        lists = lists[begin:] + lists[:begin]

    def told(rows: list[Row]) -> None:
        callback(rows, len(wanted & store.statuses().keys()))

    with contextlib.ExitStack() as stack:
        stack.enter_context(threadpool_limits(1))
        core = -1
        if timing:
            stack.enter_context(alone())
            core = stack.enter_context(pinned())
        left = _still_missing(store, lists, told)
        results = backends.solved(left, backend, scheduler)
        stack.callback(results.close)
        for rows in results:
            store.append([row | {"pinned": core} for row in rows])
            told(rows)
    return len(wanted - store.statuses().keys())


def _still_missing(
    store: Store, lists: Iterable[list[Task]], told: Callable[[list[Row]], None]
) -> Iterator[list[Task]]:
    """The batches less what another run on the same folder has done meanwhile.

    What was out of time on fewer slices is not tried.
    """
    late: set[str] = set()
    for batch in lists:
        done = store.statuses()
        late |= {key for key, status in done.items() if status == OUT_OF_TIME}
        left = [task for task in batch if task.key not in done]
        if untried := [task for task in left if task.after in late]:
            late |= {task.key for task in untried}
            reason = skipped("out of time on fewer slices")
            store.append([inputs(task) | reason | where() for task in untried])
        if left := [task for task in left if task.key not in late]:
            yield left
        else:
            told([])


def _workers(backend: str) -> int:
    return 1 if backend == "serial" else cores()


def _so_far(folder: Path) -> tuple[set[str], dict[tuple, float]]:
    """Keys of what is done, and median seconds of a solve for each value of _MEASURED."""
    keys: set[str] = set()
    seconds: dict[tuple, list[float]] = {}
    with contextlib.suppress(ValueError):
        for path in parts(folder):
            # What is damaged is found, and said, when the run begins.
            with contextlib.suppress(OSError, pa.ArrowException):
                for row in read_part(path, ["key", *_MEASURED, "solve_s"]).to_pylist():
                    keys.add(row["key"])
                    if (row["solve_s"] or 0.0) > 0:  # neither missing nor not a number
                        same = tuple(row[name] for name in _MEASURED)
                        seconds.setdefault(same, []).append(row["solve_s"])
    return keys, {same: sorted(each)[len(each) // 2] for same, each in seconds.items()}


def _seconds(task: Task, measured: dict[tuple, float]) -> float:
    """Seconds that a task takes, compiling apart."""
    d = task.discretisation
    solve = measured.get((task.kind, task.method, *(getattr(d, n) for n in _MEASURED[2:])))
    if solve is None:
        solve = _QUICK.get(task.method, _OTHERS) * ((d.slices or 64) / 64) ** 2
        solve = min(solve, task.budget or solve)
    runs = min(_RUNS, 1 + _RUNS * _SHORT / solve) if task.kind == "timing" else 1
    runs *= 1 + len(task.stops) / 2
    return solve * runs + _AROUND + _REFERENCE * bool(task.continuum) + _FIRST * task.first


def _batches(todo: list[Task], measured: dict[tuple, float], workers: int) -> Iterator[list[Task]]:
    """The tasks in lists of one shape: work for all, saved every few seconds."""
    for _, group in itertools.groupby(todo, key=lambda task: task.shape):
        same = list(group)
        longest = max(_seconds(task, measured) for task in same)
        size = max(1, min(int(_SAVE_EVERY / longest), MOST, math.ceil(len(same) / workers)))
        yield from (same[begin : begin + size] for begin in range(0, len(same), size))


def in_words(seconds: float) -> str:
    """A duration in words, such as "3 min 20 s"."""
    minutes, rest = divmod(max(round(seconds), 1), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
