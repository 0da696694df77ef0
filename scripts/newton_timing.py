"""What the parts of the newton benchmark share: scenes, solves to time, clocks and tables."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxclay.refine import refined_start

import jaxclay
from jaxclay._host import Compiled, as_float64, compiled
from jaxclay.compare.scenes import NAMED
from jaxclay.loop import cold, run, solve
from jaxclay.minimize import Solution, conclude, method_settings
from jaxclay.problem import Problem

SAME = 1e-7  # of E_free: energies nearer than that are of the same minimum


class Effort(NamedTuple):
    """How thoroughly to measure."""

    sizes: tuple[int, ...]  # slices
    large: tuple[int, int]  # slices of the two large pieces
    seconds: float  # of timed repeats that a scene gets
    population: int  # random scenes
    processes: int  # fresh ones


@lru_cache
def posed(n: int) -> tuple[dict[str, Problem], list[str]]:
    """The last squash of every named scene, what came before it solved; and what was left out.

    fig5 is fig4a's second stage, the same solve.
    """
    problems, skipped = {}, []
    for scene in NAMED.values():
        for units in scene.units if scene.name != "fig5" else ():
            name = f"{scene.name} {units}"
            try:
                if n < scene.fewest_slices:
                    raise ValueError(f"needs {scene.fewest_slices} slices")
                problems[name] = scene.problems(units, n)[-1]
            except (ValueError, RuntimeError) as error:
                skipped.append(f"{name} at n = {n} left out: {error}")
    return problems, skipped


class Solve:
    """Newton from the rough shape, ready to be called again and again on device arrays."""

    def __init__(self, problem: Problem, fun: Compiled, **static: Any):
        self.problem, self.rough = problem, jaxclay.rough_shape(problem)
        settings = method_settings("newton", {})
        values = problem, self.rough.point, settings, self.rough.feasible
        with jax.enable_x64(True):
            self.arguments = jax.device_put(as_float64(values))
        self.fun, self.static = fun, static

    def __call__(self) -> Any:
        """The compiled call and nothing else."""
        with jax.enable_x64(True):
            return jax.block_until_ready(self.fun.whole(*self.arguments, **self.static))

    def judged(self) -> tuple[Solution, np.ndarray]:
        """The answer with its certificate, and the iterations on every grid, coarse to fine."""
        answer = jax.tree.map(np.asarray, self())
        outcome, levels = answer if self.fun is climb else (answer, np.zeros(0, int))
        solution = conclude(self.problem, self.rough, outcome, "newton")
        return solution, np.append(levels, outcome.iterations)


def direct(problem: Problem) -> Solve:
    """On the problem's own grid alone."""
    return Solve(problem, solve, method="newton")


def coarse_to_fine(problem: Problem) -> Solve:
    """By way of coarser grids, as :func:`jaxclay.minimize` goes beyond 256 slices."""
    return Solve(problem, climb)


@compiled()
def climb(problem, rough, settings, feasible):
    """The outcome, and the iterations on the coarser grids."""
    start, levels = refined_start(problem, rough, settings, "newton", jnp.asarray(True))
    return run(problem, cold(problem, start), settings, feasible, "newton"), levels
