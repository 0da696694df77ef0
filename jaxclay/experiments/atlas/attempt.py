"""One attempt at a minimum, with a time limit.

A solve is one compiled call that nothing interrupts.  So it is given iterations
instead of seconds: as many as fit into them at the speed of the last attempt, and
more, afresh, if it comes to its limit early.  What is out of time has run for all of it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxclay.experiments.atlas import single
from jaxclay.experiments.atlas.sweeps import SINGLE
from jaxclay.methods.loop import Outcome, initial_guess, solve
from jaxclay.numerics.host import as_float64
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.rough import RoughShape
from jaxclay.solve.minimize import conclude, method_settings
from jaxclay.solve.solution import Solution

_FIRST = 64  # iterations of which the first speed is taken
_MOST_GROWTH = 16.0  # of the iterations from one run to the next
_FINE = 256  # slices beyond which programs are let go of
_NEARLY = 0.9  # of its time: a run that took that much had all of it


class Attempt(NamedTuple):
    """The answer of the last run, and that run's seconds."""

    solution: Solution
    seconds: float


class _Run(NamedTuple):
    seconds: float
    iterations: int
    certified: Callable[[], Solution]


class Attempts:
    """Tries methods on scenes, each for so many seconds, compiling apart."""

    def __init__(self, seconds: float):
        self.seconds = seconds
        self._speeds: dict[tuple[str, int, str], float] = {}  # iterations in a second
        self._slices = 0

    def on_grid(self, slices: int) -> None:
        """What comes next is on that grid: forget what was compiled for a fine one."""
        if slices != self._slices and self._slices > _FINE:
            self._speeds.clear()
            jax.clear_caches()  # programs for fine grids take hundreds of MB
        self._slices = slices

    def __call__(self, problem: Problem, rough: RoughShape, method: str, precision: str) -> Attempt:
        """The method's answer from the rough shape, within the time."""
        run = _prepared(problem, rough, method, precision)
        key = method, problem.slices, precision
        if key not in self._speeds:
            run(1)  # compiles
            self._speeds[key] = _FIRST / self.seconds
        limit = max(int(self._speeds[key] * self.seconds), 1)
        while True:
            done = run(limit)
            self._speeds[key] = max(done.iterations, 1) / done.seconds
            if done.iterations < limit or done.seconds >= _NEARLY * self.seconds:
                return Attempt(done.certified(), done.seconds)
            limit = int(limit * np.clip(self.seconds / done.seconds, 1.2, _MOST_GROWTH)) + 1


def _prepared(
    problem: Problem, rough: RoughShape, method: str, precision: str
) -> Callable[[int], _Run]:
    """The method on the problem, for a number of iterations."""
    if precision == SINGLE:
        return lambda limit: _single(problem, rough, method, limit)
    return lambda limit: _double(problem, rough, method, limit)


def _double(problem: Problem, rough: RoughShape, method: str, limit: int) -> _Run:
    """The solve alone, so that the certificate is compiled once for all methods."""
    settings = method_settings(method, {"max_iterations": limit})
    with jax.enable_x64(True):
        arguments = jax.device_put(
            as_float64((problem, initial_guess(problem, rough.point), settings, rough.feasible))
        )
        seconds, outcome = _timed(arguments, method)
    return _Run(seconds, int(outcome.iterations), lambda: conclude(problem, rough, outcome, method))


def _single(problem: Problem, rough: RoughShape, method: str, limit: int) -> _Run:
    settings = method_settings(method, {"max_iterations": limit})
    with jax.enable_x64(False):
        arguments = single.rounded(
            (problem, initial_guess(problem, rough.point), settings, rough.feasible)
        )
        seconds, outcome = _timed(jax.device_put(arguments), method)

    def certified() -> Solution:
        return conclude(problem, rough, single.widened(problem, outcome), method)

    return _Run(seconds, int(outcome.iterations), certified)


def _timed(arguments: Any, method: str) -> tuple[float, Outcome]:
    begin = time.perf_counter()
    outcome = jax.block_until_ready(solve(*arguments, method=method))
    seconds = time.perf_counter() - begin
    return seconds, jax.tree.map(np.asarray, outcome)
