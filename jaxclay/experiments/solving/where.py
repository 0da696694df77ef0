"""What ran on what: versions, machine, device and threads, as they are, as columns of every row."""

from __future__ import annotations

import contextlib
import functools
import os
import platform
from pathlib import Path

from threadpoolctl import threadpool_info

from jaxclay.experiments.entries.tasks import identity
from jaxclay.version import __version__

_POOL = "tf_XLAEigen"  # how the threads of XLA's pool on a CPU are named


def where() -> dict[str, str | int]:
    """Versions and machine of this process."""
    blas = [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]
    return _versions() | {
        "cores": cores(),
        "process": os.getpid(),
        "blas_threads": max(blas, default=1),
        "xla_threads": xla_threads(),
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


@functools.cache
def _versions() -> dict[str, str]:
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
