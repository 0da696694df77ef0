"""What a worker of dask does first: it leaves Ctrl-C to the process that it works for."""

from __future__ import annotations

import signal
from typing import Any


def dask_setup(worker: Any) -> None:
    """Called by dask.distributed in each worker that preloads this module."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
