"""What ran on what: versions, machine, device and threads, as they are, as columns of every row."""

from __future__ import annotations

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
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    blas = [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]
    return _versions() | {
        "cores": len(cores) or os.cpu_count() or 1,
        "process": os.getpid(),
        "blas_threads": max(blas, default=1),
        "xla_threads": xla_threads(),
    }


def xla_threads() -> int:
    """Threads of XLA's pool in this process; where the system does not say, those it was told."""
    names = [_name(path) for path in Path("/proc/self/task").glob("*/comm")]
    counted = sum(name.startswith(_POOL) for name in names)
    return counted or int(os.environ.get("NPROC", os.cpu_count() or 1))


def _name(path: Path) -> str:
    try:
        return path.read_text()
    except OSError:  # it has ended since
        return ""


@functools.cache
def _versions() -> dict[str, str]:
    return {
        **identity(),
        "jaxclay": __version__,
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        "processor": _processor(),
        "host": platform.node(),
    }


def _processor() -> str:
    """The processor's name, where the system tells it."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            for line in file:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:
        pass
    return platform.processor() or "unknown"
