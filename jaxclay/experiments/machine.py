"""The machine: what solves, on what and with how many threads, and one timing run at a time."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.metadata
import os
import platform
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

import jax
from threadpoolctl import threadpool_info

from jaxclay.numerics.checks import Hindrance
from jaxclay.version import __version__

LOCKS = Path(tempfile.gettempdir())
KEPT_SETTINGS = (
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
)
_PACKAGES = ("jax", "jaxlib", "jaxopt", "optax", "numpy")  # on which answers depend
_ROOMS = ("numerics", "clay", "model", "schemes", "methods", "solve", "experiments")
_NOT_SOLVING = (
    "charts", "packaged", "report.py", "agree.py", "results.py", "summary.py", "store.py",
)  # fmt: skip
_POOL = "tf_XLAEigen"  # how the threads of XLA's pool on a CPU are named


@functools.cache
def identity() -> dict[str, str]:
    """What solves, and on what: results of different ones are different results."""
    first = jax.devices()[0]
    kind = "" if first.device_kind == first.platform else f" {first.device_kind}"
    return {"code": _code(), "device": f"{first.platform}{kind}", **versions(_PACKAGES)}


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Of packages, "none" of one that is not installed."""
    installed = dict.fromkeys(packages, "none")
    for name in installed:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            installed[name] = importlib.metadata.version(name)
    return installed


def _code() -> str:
    """A hash of the package's modules that solve."""
    package, digest = Path(__file__).parents[1], hashlib.sha256()
    for room in _ROOMS:
        for path in sorted((package / room).rglob("*.py")):
            within = path.relative_to(package / room)
            if room != "experiments" or within.parts[0] not in _NOT_SOLVING:
                digest.update(f"{room}/{within}".encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def where() -> dict[str, str | int]:
    """Versions, machine and threads of this process, as they are, as columns of every row."""
    blas = [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]
    return _described() | {
        "cores": cores(),
        "process": os.getpid(),
        "blas_threads": max(blas, default=1),
        "xla_threads": xla_threads(),
    }


@functools.cache
def _described() -> dict[str, str]:
    processor = platform.processor() or "unknown"
    with contextlib.suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
        processor = next(names, processor)
    return {
        **identity(),
        "jaxclay": __version__,
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        "processor": processor,
        "host": platform.node(),
    }


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def xla_threads() -> int:
    """Threads of XLA's pool in this process; where the system does not say, those it was told."""
    counted = 0
    for path in Path("/proc/self/task").glob("*/comm"):
        with contextlib.suppress(OSError):  # it has ended since
            counted += path.read_text().startswith(_POOL)
    return counted or int(os.environ.get("NPROC", os.cpu_count() or 1))


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
