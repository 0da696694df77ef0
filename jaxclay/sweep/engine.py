"""Runs what is missing of an experiment and keeps what comes out, batch by batch."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
from threadpoolctl import threadpool_limits

from jaxclay.compare.rows import Row
from jaxclay.sweep import backends
from jaxclay.sweep.estimate import batch_sizes, total_seconds
from jaxclay.sweep.store import Store, parts, read_part
from jaxclay.sweep.tables import Experiment
from jaxclay.sweep.tasks import Task, batches, tasks
from jaxclay.sweep.timing import pinned

Report = Callable[[list[Row]], None]


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
    """

    every: list[Task]
    missing: list[Task]
    seconds: float


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
    every = tasks(experiment)
    done, known = _so_far(folder)
    missing = [task for task in every if task.key not in done]
    return Work(every, missing, total_seconds(missing, known, _workers(backend)))


def run(
    experiment: Experiment,
    folder: Path,
    backend: str = "serial",
    scheduler: str | None = None,
    tell: Report = lambda rows: None,
) -> Work:
    """Solve what is missing and add it to the folder; ``tell`` hears of every batch's rows.

    Returns the work as it was at the beginning.

    Raises
    ------
    ValueError
        A backend that does not go with the experiment.
    OSError
        The folder cannot be written to: what had been written is kept.
    RuntimeError
        A worker died.
    """
    check_backend(experiment, backend, scheduler)
    return run_tasks(tasks(experiment), folder, backend, scheduler, tell)


def run_tasks(
    every: list[Task],
    folder: Path,
    backend: str = "serial",
    scheduler: str | None = None,
    tell: Report = lambda rows: None,
) -> Work:
    """The same for tasks that are all of one kind."""
    store = Store(folder)
    store.keys()  # sets damaged files aside
    done, known = _so_far(folder)
    missing = [task for task in every if task.key not in done]
    workers = _workers(backend)
    lists = _still_missing(store, batches(missing, batch_sizes(missing, known, workers)))
    with contextlib.ExitStack() as stack:
        stack.enter_context(threadpool_limits(1))
        timing = any(task.kind == "timing" for task in missing)
        core = stack.enter_context(pinned()) if timing else -1
        results = _results(backend, scheduler, lists)
        stack.callback(results.close)
        for rows in results:
            rows = [row | {"pinned": core} for row in rows]
            store.append(rows)
            tell(rows)
    return Work(every, missing, total_seconds(missing, known, workers))


def _results(backend: str, scheduler: str | None, lists) -> Any:
    if backend == "dask":
        return backends.dask(lists, scheduler)
    return backends.processes(lists) if backend == "processes" else backends.serial(lists)


def _still_missing(store: Store, lists: Iterator[list[Task]]) -> Iterator[list[Task]]:
    """The batches less what another run on the same folder has done meanwhile."""
    for batch in lists:
        done = store.keys()
        left = [task for task in batch if task.key not in done]
        if left:
            yield left


def _workers(backend: str) -> int:
    return 1 if backend == "serial" else backends.cores()


def _so_far(folder: Path) -> tuple[set[str], dict[tuple, float]]:
    """Keys of what is done, and median seconds of a solve by kind and shape."""
    columns = ["key", "kind", "scheme", "method", "slices", "solve_s"]
    keys: set[str] = set()
    seconds: dict[tuple, list[float]] = {}
    with contextlib.suppress(ValueError):
        for path in parts(folder):
            # What is damaged is found, and said, when the run begins.
            with contextlib.suppress(OSError, pa.ArrowException):
                for row in read_part(path, columns).to_pylist():
                    keys.add(row["key"])
                    if row["solve_s"] is not None and row["solve_s"] == row["solve_s"]:
                        shape = row["kind"], row["scheme"], row["method"], row["slices"]
                        seconds.setdefault(shape, []).append(row["solve_s"])
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
