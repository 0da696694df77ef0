"""The machine: one timing run at a time, on one core, with as many threads as are told."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import jax

from jaxclay.experiments.solving.where import xla_threads
from jaxclay.numerics.checks import Hindrance

LOCKS = Path(tempfile.gettempdir())
KEPT_SETTINGS = (
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
)


def pool_threads() -> int:
    """Threads of XLA's pool here: one, unless JAX has been started with more.

    Problems are small, and handing them from one thread to another costs a third of the time.
    """
    with environment({"NPROC": os.environ.get("NPROC", "1")}):
        jax.devices()  # reads it when JAX starts
    return xla_threads()


def one_thread() -> dict[str, str]:
    """Environment of a worker: one thread for BLAS and XLA, the same cache of compilations."""
    names = "NPROC", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"
    kept = {name.upper(): getattr(jax.config, name) for name in KEPT_SETTINGS}
    return {
        **dict.fromkeys(names, "1"),
        "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
        **{name: str(value) for name, value in kept.items() if value is not None},
    }


@contextlib.contextmanager
def environment(variables: dict[str, str]) -> Iterator[None]:
    """The process's environment with these variables, which processes that it starts inherit."""
    before = dict(os.environ)
    os.environ.update(variables)
    try:
        yield
    finally:
        for name in variables.keys() - before.keys():
            del os.environ[name]
        os.environ.update(before)


@contextlib.contextmanager
def alone() -> Iterator[None]:
    """Keep this user's other timing runs off the machine: two at once spoil each other's times.

    Raises RuntimeError: There is one already.
    """
    try:
        import fcntl
    except ImportError:  # on Windows nobody is kept off
        yield
        return
    with (LOCKS / f"jaxclay-timing-{os.getuid()}.lock").open("a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise Hindrance(
                "another timing run is under way on this machine, and two at once spoil each "
                "other's times: wait for it to end"
            ) from None
        yield


@contextlib.contextmanager
def pinned() -> Iterator[int]:
    """Hold this process on one core, where the system can; yields the core, or -1."""
    if not hasattr(os, "sched_setaffinity"):
        yield -1
        return
    before = os.sched_getaffinity(0)
    _hold({max(before)})
    try:
        yield max(before)
    finally:
        _hold(before)


def _hold(cores: set[int]) -> None:
    for thread in Path("/proc/self/task").iterdir():
        # A thread may have ended since.
        with contextlib.suppress(OSError):
            os.sched_setaffinity(int(thread.name), cores)
