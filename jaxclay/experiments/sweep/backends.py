"""Where batches are solved: in this process, in spawned ones, or by dask.distributed.

Processes are spawned, never forked: JAX's threads do not survive a fork.  Each worker gets one
thread, so that two of them on two cores do not wait for each other.
"""

from __future__ import annotations

import contextlib
import itertools
import multiprocessing
import os
import signal
import threading
import uuid
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import jax

from jaxclay.experiments.compare.rows import Row
from jaxclay.experiments.sweep.solving import solve
from jaxclay.experiments.sweep.tasks import Task, identity
from jaxclay.numerics.checks import Hindrance
from jaxclay.numerics.host import let_go

BACKENDS = ("serial", "processes", "dask")
Batches = Iterable[list[Task]]
ANSWERS_WITHIN = 20.0  # seconds, a scheduler
_AHEAD = 2  # batches that each worker has waiting
KEPT_SETTINGS = (
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
)


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def serial(batches: Batches) -> Iterator[list[Row]]:
    """Solve the batches here, one after the other."""
    for batch in batches:
        yield solve_in_worker(batch, identity())


def processes(batches: Batches, workers: int | None = None) -> Iterator[list[Row]]:
    """Solve the batches in as many spawned processes as there are cores.

    Raises
    ------
    RuntimeError
        A process died, as where memory runs out.
    """
    count = workers or cores()
    spawn = multiprocessing.get_context("spawn")
    numbers = spawn.Queue()
    for number in range(count):
        numbers.put(number)
    before = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(count, spawn, _begin_process, (numbers,))
    try:
        with _environment(one_thread()):
            yield from _as_they_end(
                batches, count, lambda batch: pool.submit(solve_in_worker, batch, identity())
            )
    except BrokenProcessPool:
        raise Hindrance(
            "a worker process died: is there memory enough, and does a script guard what it runs "
            "by if __name__ == '__main__'? What had ended is kept"
        ) from None
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()


def dask(batches: Batches, scheduler: str | None = None) -> Iterator[list[Row]]:
    """Solve the batches on a dask cluster: one here, of a worker a core, or a scheduler's own.

    A worker that dies is replaced, and its batch solved again.

    Raises
    ------
    ImportError
        dask.distributed is missing.
    OSError
        Nobody answers at the scheduler's address.
    RuntimeError
        A worker has another version of jaxclay, or computes on another kind of device.
    """
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        raise ImportError(
            "--backend dask needs dask.distributed: pip install 'jaxclay[sweep]'", name=error.name
        ) from error

    with contextlib.ExitStack() as stack:
        where: Any = stack.enter_context(local_cluster()) if scheduler is None else scheduler
        client: Any = stack.enter_context(Client(where, timeout=ANSWERS_WITHIN))
        running = as_completed()
        left = iter(batches)

        def submit(batch):
            # Others may use the same scheduler, and on other machines process numbers recur.
            key = f"jaxclay-{uuid.uuid4()}"
            running.add(client.submit(solve_in_worker, batch, identity(), key=key, pure=False))

        for batch in itertools.islice(left, _AHEAD * max(len(client.nthreads()), cores())):
            submit(batch)
        for future in running:
            yield future.result()
            for batch in itertools.islice(left, 1):
                submit(batch)


@contextlib.contextmanager
def local_cluster() -> Iterator[Any]:
    """A dask cluster on this machine, of a worker a core, one thread each."""
    from distributed import LocalCluster

    local: Any = LocalCluster  # its annotations leave out what it documents
    # Set before workers start: the variables are read when they import JAX.
    with _environment(one_thread()), local(
        n_workers=cores(), threads_per_worker=1, memory_limit="auto", dashboard_address=None,
        silence_logs=50, preload=["jaxclay.experiments.sweep.dask_worker"],
    ) as cluster:  # fmt: skip
        yield cluster


def _as_they_end(batches: Batches, workers: int, submit: Callable):
    """Results in the order in which they come; few batches wait, so that others can be left out."""
    left, running = iter(batches), set()
    while True:
        room = _AHEAD * workers - len(running)
        running |= {submit(batch) for batch in itertools.islice(left, room)}
        if not running:
            return
        done, running = wait(running, return_when=FIRST_COMPLETED)
        for future in done:
            yield future.result()


def solve_in_worker(batch: list[Task], wanted: dict[str, str]) -> list[Row]:
    """Solve a batch, as what its tasks' keys say.

    Raises
    ------
    RuntimeError
        This process is another version, or computes on another kind of device.
    """
    if (here := identity()) != wanted:
        raise Hindrance(f"a worker has {here}, but {wanted} is wanted: start workers with that")
    found = solve(batch)
    let_go()
    return found


def one_thread() -> dict[str, str]:
    """Environment of a worker: one thread for BLAS and for XLA, the same cache of compilations.

    XLA's pool has as many threads as NPROC says; handing small problems from one to another
    costs a third of the time.
    """
    names = "NPROC", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"
    kept = {name.upper(): getattr(jax.config, name) for name in KEPT_SETTINGS}
    return {
        **dict.fromkeys(names, "1"),
        "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
        **{name: str(value) for name, value in kept.items() if value is not None},
    }


def _begin_process(numbers) -> None:
    """A worker's first act: its own core, and Ctrl-C left to the process that it works for."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if hasattr(os, "sched_setaffinity"):
        mine = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {mine[numbers.get() % len(mine)]})


def _end_with_parent() -> None:
    """A process that is killed cannot stop its workers: they have to see it."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextlib.contextmanager
def _environment(variables: dict[str, str]) -> Iterator[None]:
    """The process's environment with these variables, which spawned processes inherit."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
