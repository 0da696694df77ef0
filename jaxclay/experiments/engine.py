"""Runs what is missing of an experiment and keeps what comes out, batch by batch."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa
from threadpoolctl import threadpool_limits

from jaxclay.experiments import backends
from jaxclay.experiments.entries.tables import Experiment
from jaxclay.experiments.entries.tasks import Task, tasks
from jaxclay.experiments.estimate import MEASURED, Estimate
from jaxclay.experiments.machine import alone, pinned, pool_threads
from jaxclay.experiments.solving.budget import OUT_OF_TIME
from jaxclay.experiments.solving.rows import Row, inputs, skipped
from jaxclay.experiments.solving.where import cores, where
from jaxclay.experiments.store import Store, parts, read_part

Callback = Callable[[list[Row], int], None]


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
    done, estimate = _so_far(folder)
    missing = [task for task in every if task.key not in done]
    others = len(done - {task.key for task in every})
    return Work(every, missing, estimate.total(missing, _workers(backend)), others)


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
    lists = list(_so_far(folder)[1].batches(missing, _workers(backend)))
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


def set_damage_aside(folder: Path) -> None:
    """Warn of damaged files and rename them, so that their tasks count as missing."""
    Store(folder).statuses()


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
        untried = [task for task in left if task.after in late]
        if untried:
            late |= {task.key for task in untried}
            reason = skipped("out of time on fewer slices")
            store.append([inputs(task) | reason | where() for task in untried])
        if left := [task for task in left if task.key not in late]:
            yield left
        else:
            told([])


def _workers(backend: str) -> int:
    return 1 if backend == "serial" else cores()


def _so_far(folder: Path) -> tuple[set[str], Estimate]:
    """Keys of what is done, and median seconds of a solve."""
    keys: set[str] = set()
    seconds: dict[tuple, list[float]] = {}
    with contextlib.suppress(ValueError):
        for path in parts(folder):
            # What is damaged is found, and said, when the run begins.
            with contextlib.suppress(OSError, pa.ArrowException):
                for row in read_part(path, ["key", *MEASURED, "solve_s"]).to_pylist():
                    keys.add(row["key"])
                    if row["solve_s"] is not None and row["solve_s"] == row["solve_s"]:
                        same = tuple(row[name] for name in MEASURED)
                        seconds.setdefault(same, []).append(row["solve_s"])
    medians = {same: sorted(each)[len(each) // 2] for same, each in seconds.items()}
    return keys, Estimate(medians)


def in_words(seconds: float) -> str:
    """A duration in words, such as "3 min 20 s"."""
    minutes, rest = divmod(max(round(seconds), 1), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes} min"
    return f"{minutes} min {rest} s" if minutes else f"{rest} s"
