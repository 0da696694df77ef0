"""What a worker of dask does first: it takes a core of its own, and leaves Ctrl-C to its master."""

from __future__ import annotations

import os
import signal
from typing import Any


def dask_setup(worker: Any) -> None:
    """Called by dask.distributed in each worker that preloads this module."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(os, "sched_setaffinity") and isinstance(worker.name, int):
        mine = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {mine[worker.name % len(mine)]})
