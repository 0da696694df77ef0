"""What ran on what: versions, machine, device and cores, as columns of every row."""

from __future__ import annotations

import functools
import os
import platform

from jaxclay.experiments.compare.results import versions
from jaxclay.experiments.sweep.tasks import DTYPE, device


def where() -> dict[str, str | int]:
    """Versions and machine of this process."""
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []
    return _versions() | {"cores": len(cores) or os.cpu_count() or 1, "process": os.getpid()}


@functools.cache
def _versions() -> dict[str, str]:
    return versions(()) | {
        "dtype": DTYPE,
        "device": device(),
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
