"""Times one task at a time, on one core; compiling never mixes with solving."""

from __future__ import annotations

import contextlib
import functools
import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import jax
import numpy as np

from jaxclay.experiments.compare.clock import Clock
from jaxclay.experiments.compare.solves import on_device, spans
from jaxclay.experiments.sweep.tasks import Task
from jaxclay.methods.choice import spline_settings
from jaxclay.numerics.checks import Hindrance
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.rough import rough_shape
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.solve.minimize import minimize
from jaxclay.solve.on_spans import begin_from
from jaxclay.solve.solution import Solution

_NONE = np.zeros(0)
LOCKS = Path(tempfile.gettempdir())


class Times(NamedTuple):
    """Columns of times; seconds are of the compiled call alone, medians of ``repeats``.

    In a batch of throughput ``solve_s`` is the call's share of each task, and compiling is in it.
    """

    solve_s: float = np.nan
    solve_s_least: float = np.nan
    solve_s_most: float = np.nan
    compile_s: float = np.nan
    repeats: int = 0
    batch: int = 0
    trace_iterations: np.ndarray = _NONE
    trace_s: np.ndarray = _NONE
    trace_energy: np.ndarray = _NONE


def timed_slices(task: Task, problem: Problem) -> tuple[Solution, Times]:
    """The answer on slices, its times, and fresh runs ended after each stop."""
    clock, settings = _clock(task.repeats), dict(task.settings)
    clock.warm_up([task.method], task.slices, task.scheme)
    rough = rough_shape(problem)
    columns, answer = clock.time(problem, rough, task.method, settings)
    trace = []
    for stop in task.stops:
        limited, ended = clock.time(
            problem, rough, task.method, settings | {"max_iterations": stop}
        )
        trace.append((int(ended.iterations), limited["solve_s"], float(ended.energy)))
        if int(ended.iterations) < stop:
            break
    iterations, seconds, energy = np.array(trace).reshape(-1, 3).T
    return answer, Times(
        **columns, batch=1, trace_iterations=iterations, trace_s=seconds, trace_energy=energy
    )


def timed_spans(task: Task, problem: SplineProblem) -> tuple[Solution, Times]:
    """The same on splines, without stops."""
    settings = on_device(spline_settings(task.method, {}))
    values = on_device((problem, begin_from(problem, None)))

    def solve() -> float:
        begin = time.perf_counter()
        with jax.enable_x64(True):
            jax.block_until_ready(spans(values, settings, task.method))
        return time.perf_counter() - begin

    first, *others = (solve() for _ in range(task.repeats + 1))
    median = float(np.median(others))
    return minimize(problem, task.method), Times(
        solve_s=median, solve_s_least=min(others), solve_s_most=max(others),
        compile_s=max(first - median, 0.0), repeats=len(others), batch=1,
    )  # fmt: skip


@functools.cache
def _clock(repeats: int) -> Clock:
    """One for a whole process, which so compiles each method once a grid."""
    return Clock(repeats)


@contextlib.contextmanager
def alone() -> Iterator[None]:
    """Keep this user's other timing runs off the machine: two at once spoil each other's times.

    Raises
    ------
    RuntimeError
        There is one already.
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
    core = max(before)
    _hold({core})
    try:
        yield core
    finally:
        _hold(before)


def _hold(cores: set[int]) -> None:
    for thread in Path("/proc/self/task").iterdir():
        # A thread may have ended since.
        with contextlib.suppress(OSError):
            os.sched_setaffinity(int(thread.name), cores)
