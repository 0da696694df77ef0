"""Runs what is missing of an experiment and keeps what comes out, batch by batch."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
from threadpoolctl import threadpool_limits

from jaxclay.experiments import backends
from jaxclay.experiments.entries.tables import Experiment
from jaxclay.experiments.entries.tasks import Task, batches, tasks
from jaxclay.experiments.estimate import MEASURED, batch_sizes, total_seconds
from jaxclay.experiments.machine import alone, cores, pinned, pool_threads
from jaxclay.experiments.solving.budget import OUT_OF_TIME
from jaxclay.experiments.solving.rows import Row
from jaxclay.experiments.solving.solve import inputs, skipped
from jaxclay.experiments.solving.where import where
from jaxclay.experiments.store import Store, parts, read_part

Callback = Callable[[list[Row], int], None]


class Work(NamedTuple):
    """What an experiment comes to.

    Attributes
    ----------
    every : list of Task
        All its tasks.
    missing : list of Task
        Those of which the folder has no result.
    seconds : float
        That those take, about.
    others : int
        Results in the folder that are of none of these tasks.
    """

    every: list[Task]
    missing: list[Task]
    seconds: float
    others: int


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


def work(experiment: Experiment, folder: Path, backend: str) -> Work:
    """All tasks, those that the folder lacks, and how long they take; writes nothing."""
    every = tasks(experiment, threads_of(backend))
    done, known = _so_far(folder)
    missing = [task for task in every if task.key not in done]
    others = len(done - {task.key for task in every})
    return Work(every, missing, total_seconds(missing, known, _workers(backend)), others)


def run(
    experiment: Experiment,
    folder: Path,
    backend: str = "serial",
    scheduler: str | None = None,
    callback: Callback = lambda rows, done: None,
) -> int:
    """Solve what is missing and add it to the folder; see :func:`run_tasks`.

    Raises
    ------
    ValueError
        A backend that does not go with the experiment.
    """
    check_backend(experiment, backend, scheduler)
    return run_tasks(tasks(experiment, threads_of(backend)), folder, backend, scheduler, callback)


def run_tasks(
    every: list[Task],
    folder: Path,
    backend: str = "serial",
    scheduler: str | None = None,
    callback: Callback = lambda rows, done: None,
) -> int:
    """Solve those of the tasks, all of one kind, that the folder lacks.

    ``callback`` hears of every batch's rows, and how many tasks are done by whatever run.  Returns
    how many still lack a result at the end, as where somebody took results away.

    Raises
    ------
    OSError
        The folder cannot be written to: what had been written is kept.
    RuntimeError
        A worker died; another timing run is under way.
    """
    store, wanted = Store(folder), {task.key for task in every}
    done = store.keys()
    missing = [task for task in every if task.key not in done]
    sizes = batch_sizes(missing, _so_far(folder)[1], _workers(backend))

    def told(rows: list[Row]) -> None:
        callback(rows, len(wanted & store.keys()))

    if not missing:  # the folder need not even be writable
        return 0
    timing = any(task.kind == "timing" for task in missing)
    lists = list(batches(missing, sizes))
    lists = _still_missing(store, lists if timing else _from_anywhere(lists), told)
    with contextlib.ExitStack() as stack:
        stack.enter_context(threadpool_limits(1))
        core = -1
        if timing:
            stack.enter_context(alone())
            core = stack.enter_context(pinned())
        results = _results(backend, scheduler, lists)
        stack.callback(results.close)
        for rows in results:
            rows = [row | {"pinned": core} for row in rows]
            store.append(rows)
            told(rows)
    return len(wanted - store.keys())


def set_damage_aside(folder: Path) -> None:
    """Warn of damaged files and rename them, so that their tasks count as missing."""
    if folder.exists():
        Store(folder).keys()


def _results(backend: str, scheduler: str | None, lists) -> Any:
    if backend == "serial":
        return backends.serial(lists)
    return backends.distributed(lists, scheduler)


def _from_anywhere(every: list[list[Task]]) -> list[list[Task]]:
    """The batches from any of them on and round: two runs on one folder seldom meet."""
    begin = random.randrange(len(every)) if every else 0
    return every[begin:] + every[:begin]


def _still_missing(
    store: Store, lists: list[list[Task]], told: Callable[[list[Row]], None]
) -> Iterator[list[Task]]:
    """The batches less what another run on the same folder has done meanwhile.

    What was out of time on fewer slices is not tried.
    """
    late: set[str] = set()
    for batch in lists:
        done = store.keys()
        left = [task for task in batch if task.key not in done]
        if any(task.after for task in left):
            late |= store.keys(OUT_OF_TIME)
            untried = [task for task in left if task.after in late]
            late |= {task.key for task in untried}
            left = [task for task in left if task.after not in late]
            if untried:
                reason = skipped("out of time on fewer slices")
                store.append([inputs(task) | reason | where() for task in untried])
        if left:
            yield left
        else:
            told([])


def _workers(backend: str) -> int:
    return 1 if backend == "serial" else cores()


def threads_of(backend: str) -> int:
    """Of XLA's pool in the processes that solve."""
    return pool_threads() if backend == "serial" else 1


def _so_far(folder: Path) -> tuple[set[str], dict[tuple, float]]:
    """Keys of what is done, and median seconds of a solve by kind and shape."""
    columns = ["key", *MEASURED, "solve_s"]
    keys: set[str] = set()
    seconds: dict[tuple, list[float]] = {}
    with contextlib.suppress(ValueError):
        for path in parts(folder):
            # What is damaged is found, and said, when the run begins.
            with contextlib.suppress(OSError, pa.ArrowException):
                for row in read_part(path, columns).to_pylist():
                    keys.add(row["key"])
                    if row["solve_s"] is not None and row["solve_s"] == row["solve_s"]:
                        same = tuple(row[name] for name in MEASURED)
                        seconds.setdefault(same, []).append(row["solve_s"])
    medians = {shape: sorted(each)[len(each) // 2] for shape, each in seconds.items()}
    return keys, medians


def in_words(seconds: float) -> str:
    """A duration in words, such as "3 min 20 s"."""
    whole = round(seconds)
    if whole < 60:
        return f"{max(whole, 1)} s"
    minutes, rest = divmod(whole, 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"
