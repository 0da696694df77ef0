"""What timing benchmarks share: calls timed in turn, compilations seen, one banded solve."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

import jax
import numpy as np
from scipy.linalg import solveh_banded

_BURST = 5e-3  # seconds

compilations: list[float] = []  # seconds of each that XLA has made since the import


def _listen(event: str, duration_secs: float, **_: str | int) -> None:
    if event.endswith("backend_compile_duration"):
        compilations.append(duration_secs)


jax.monitoring.register_event_duration_secs_listener(_listen)


def spread(values, form: str = "{:.3g}", scale: float = 1.0) -> str:
    """Median, least and most."""
    if not len(values):
        return "-"
    values = scale * np.asarray(values)
    return "{} [{}, {}]".format(*(form.format(f(values)) for f in (np.median, np.min, np.max)))


def alternate(calls: dict[str, Callable[[], Any]], seconds: float) -> dict[str, np.ndarray]:
    """Seconds of each call, all of them made in turn, over and over; the first turn compiles.

    Short calls are made several times a turn, the first of them not timed: it pays for
    what the others left in the caches.
    """
    taken: dict[str, list[float]] = {name: [] for name in calls}
    often = {name: _clocked(call, 2)[1] for name, call in calls.items()}
    often = {name: int(np.clip(_BURST / once, 1, 20)) for name, once in often.items()}
    end = time.perf_counter() + seconds
    while min(map(len, taken.values())) < 3 or time.perf_counter() < end:
        for name, call in calls.items():
            if often[name] > 1:
                call()
            taken[name] += _clocked(call, often[name])
    return {name: np.array(times) for name, times in taken.items()}


def _clocked(call: Callable[[], Any], times: int) -> list[float]:
    clock = [time.perf_counter()]
    for _ in range(times):
        call()
        clock.append(time.perf_counter())
    return np.diff(clock).tolist()


def medians(calls: dict[str, Callable[[], Any]], seconds: float) -> dict[str, float]:
    """Of each call's seconds."""
    return {name: float(np.median(taken)) for name, taken in alternate(calls, seconds).items()}


def each(calls: Iterable[dict[str, Callable[[], Any]]], seconds: float) -> dict[str, np.ndarray]:
    """The medians of several such groups of calls, by name."""
    rows = [medians(group, seconds) for group in calls]
    return {name: np.array([row[name] for row in rows]) for name in (rows[0] if rows else ())}


def banded_solve(n: int) -> Callable[[], Any]:
    """SciPy's solve with a positive definite matrix of half-bandwidth 3, to be timed."""
    bands = np.zeros((4, n))
    for k, value in enumerate((20.0, -15.0, 6.0, -1.0)):  # sixth differences
        bands[k, : n - k] = value
    bands[0] += 1.0
    return lambda: solveh_banded(bands, np.ones(n), lower=True)
