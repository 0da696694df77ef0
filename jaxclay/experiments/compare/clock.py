"""Times solves; compiling never mixes with solving."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.experiments.compare.peers import PEERS, prepare
from jaxclay.methods.loop import initial_guess, solve
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash
from jaxclay.numerics.host import as_float64
from jaxclay.schemes.posing import pose
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.rough import RoughShape, rough_shape
from jaxclay.solve.minimize import conclude, method_settings
from jaxclay.solve.solution import Solution

_LONG = 0.2  # seconds: a run longer than that is made twice only
_VERY_LONG = 1.0  # seconds: and longer than that, once
_ENOUGH = 0.02  # seconds of repeats that short runs get
_MOST_REPEATS = 25


class Clock:
    """Times solves, with compiling apart: a first call of each method on each grid pays for it.

    What a peer does before it solves counts as compiling.
    """

    def __init__(self, repeats: int):
        self.repeats = repeats
        self.compiled: dict[tuple[str, int, str], float] = {}

    def warm_up(self, methods: list[str], slices: int, scheme: str = "paper") -> None:
        """Compile each method and set up each peer for a grid, on one step of some squash."""
        material = Material(alpha=0.0, beta=0.0)  # which every peer takes
        problem = pose(Clay.cylinder(slices=slices), Squash(0.0, 0.5, 0.4), material, scheme)
        rough = rough_shape(problem)
        for method in methods:
            if (method, slices, scheme) not in self.compiled:
                begin = time.perf_counter()
                once, _ = _timed(problem, rough, method, {"max_iterations": 1})
                once()
                first, second = time.perf_counter() - begin, once()[0]
                self.compiled[method, slices, scheme] = max(first - second, 0.0)

    def time(self, problem: Problem, rough: RoughShape, method: str, settings: dict):
        """The timing columns, and the answer."""
        once, certify = _timed(problem, rough, method, settings)
        seconds, outcome = once()
        # Short runs are cheap to repeat and noisy, long ones the opposite.
        more = int(np.clip(_ENOUGH / seconds, self.repeats, _MOST_REPEATS))
        repeats = more if seconds < _LONG else 2 if seconds < _VERY_LONG else 1
        times = np.array([seconds, *(once()[0] for _ in range(repeats - 1))])
        timing = {
            "compile_s": self.compiled[method, problem.slices, problem.scheme],
            "solve_s": float(np.median(times)),
            "solve_s_least": float(times.min()),
            "solve_s_most": float(times.max()),
            "repeats": len(times),
        }
        return timing, certify(outcome)


Once = Callable[[], tuple[float, Any]]
Certify = Callable[[Any], Solution]


def _timed(
    problem: Problem, rough: RoughShape, method: str, settings: dict
) -> tuple[Once, Certify]:
    """A solve that can be called again and again, for seconds and outcome; and its certificate."""
    if method in PEERS:
        return _timed_peer(problem, method, settings)
    with jax.enable_x64(True):
        chosen = method_settings(method, settings)
        arguments = jax.device_put(
            as_float64((problem, initial_guess(problem, rough.point), chosen, rough.feasible))
        )

    def once() -> tuple[float, Any]:
        with jax.enable_x64(True):
            begin = time.perf_counter()
            outcome = jax.block_until_ready(solve.whole(*arguments, method=method))
            return time.perf_counter() - begin, outcome

    def certify(outcome) -> Solution:
        return conclude(problem, rough, jax.tree.map(np.asarray, outcome), method)

    return once, certify


def _timed_peer(problem: Problem, name: str, settings: dict) -> tuple[Once, Certify]:
    ready = prepare(name, problem, **settings)

    def once() -> tuple[float, Any]:
        begin = time.perf_counter()
        answer = ready.solve()
        return time.perf_counter() - begin, answer

    return once, ready.certify
