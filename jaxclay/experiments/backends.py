"""Where batches are solved: in this process, or by dask.distributed on this machine or others.

Workers are spawned, never forked: JAX's threads do not survive a fork.  Each gets one thread and,
on this machine, a core of its own, so that two of them on two cores do not wait for each other.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import os
import signal
import uuid
from collections.abc import Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from jaxclay.experiments.entries.tasks import Task
from jaxclay.experiments.machine import cores, environment, identity, one_thread, xla_threads
from jaxclay.experiments.solving.solve import Row, solve
from jaxclay.numerics.checks import Hindrance, needing

BACKENDS = ("serial", "processes", "dask")
ANSWERS_WITHIN = 20.0  # seconds, a scheduler
_AHEAD = 2  # batches that each worker has waiting


def solved(
    batches: Iterator[list[Task]], backend: str, scheduler: str | None = None
) -> Generator[list[Row]]:
    """Solve the batches here, or on a dask cluster: one here, or a scheduler's own.

    A worker that dies is replaced, and its batch solved again.

    Raises ImportError: dask.distributed is missing; OSError: Nobody answers at the scheduler's
    address; RuntimeError: A worker computes by another code, on another kind of device or with
    more threads; a batch has cost several workers their life.
    """
    if backend == "serial":
        yield from (solve_in_worker(batch, identity()) for batch in batches)
        return
    with needing("sweep", "a backend of processes"):
        from distributed import Client, KilledWorker, as_completed

    with contextlib.ExitStack() as stack:
        if scheduler is not None:
            _knock(scheduler)
        where: Any = stack.enter_context(local_cluster()) if scheduler is None else scheduler
        client: Any = stack.enter_context(Client(where, timeout=ANSWERS_WITHIN))
        running = as_completed()

        def submit(count: int) -> None:
            for batch in itertools.islice(batches, count):
                # Others may use the same scheduler, and on other machines process numbers recur.
                key = f"jaxclay-{uuid.uuid4()}"
                running.add(client.submit(solve_in_worker, batch, identity(), key=key, pure=False))

        submit(_AHEAD * max(len(client.nthreads()), cores()))
        for future in running:
            try:
                yield future.result()
            except KilledWorker:
                raise Hindrance(
                    "a worker process died again and again: is there memory enough, and does a "
                    "script guard what it runs by if __name__ == '__main__'? What had ended is kept"
                ) from None
            submit(1)


def _knock(scheduler: str) -> None:
    """Raise unless somebody answers at the address.

    Before there is a client: one that fails waits, when it is let go of, for what never comes, in
    whichever thread that happens.
    """
    from distributed.comm.core import connect

    async def knock() -> None:
        comm = await connect(scheduler, timeout=ANSWERS_WITHIN)
        await comm.close()

    try:
        with ThreadPoolExecutor(1) as pool:  # here, as in a notebook, a loop may run already
            pool.submit(asyncio.run, knock()).result()
    except ValueError as error:  # such as of an address without a port
        raise ValueError(f"--scheduler {scheduler}: {error}") from None


@contextlib.contextmanager
def local_cluster() -> Iterator[Any]:
    """A dask cluster on this machine, of a worker a core, one thread each."""
    from distributed import LocalCluster

    local: Any = LocalCluster  # its annotations leave out what it documents
    # Set before workers start: the variables are read when they import JAX.
    with environment(one_thread() | _quiet_after_ctrl_c()), local(
        n_workers=cores(), threads_per_worker=1, memory_limit="auto", dashboard_address=":0",
        silence_logs=50, preload=[__name__],
    ) as cluster:  # fmt: skip
        yield cluster


def dask_setup(worker: Any) -> None:
    """What dask calls in each of them: it takes a core, and leaves Ctrl-C to its master."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "sched_setaffinity") and isinstance(worker.name, int):
        mine = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {mine[worker.name % len(mine)]})


def _quiet_after_ctrl_c() -> dict[str, str]:
    """Python's clean-up says what a command that ended in a hurry has left: nothing of use."""
    mine = "ignore::UserWarning:multiprocessing.resource_tracker"
    return {"PYTHONWARNINGS": ",".join(filter(None, (os.environ.get("PYTHONWARNINGS"), mine)))}


def solve_in_worker(batch: list[Task], wanted: dict[str, str]) -> list[Row]:
    """Solve a batch, as what its tasks' keys say.

    Raises RuntimeError: This process has other code, another kind of device or more threads.
    """
    threads = {task.threads for task in batch} or {xla_threads()}
    if (here := identity()) != wanted or threads != {xla_threads()}:
        raise Hindrance(
            f"a worker has {here} and {xla_threads()} threads, but {wanted} and "
            f"{', '.join(map(str, threads))} are wanted: start workers with that, threads by NPROC"
        )
    return solve(batch)
