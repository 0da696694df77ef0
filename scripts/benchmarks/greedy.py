"""Greedy's speed on one core: visits of a free node, both candidate moves tried, a second.

The step is so small that no sweep ends the search, so every run makes all its sweeps.  Compiling
is not timed; the median of the runs counts, with the least and the most beside it.
"""

import os
import statistics
import time

if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import jax

import jaxclay
from jaxclay.methods.loop import initial_guess, solve
from jaxclay.numerics.host import as_float64
from jaxclay.solve.minimize import method_settings

SWEEPS, RUNS = 4000, 9


def visits_a_second(slices: int) -> list[float]:
    """One figure a run, for the reference scene with the printed constants."""
    clay = jaxclay.Clay.cylinder(slices=slices)
    squash = jaxclay.Squash(0.0, 0.29296875, 0.4)
    problem = jaxclay.pose(clay, squash, jaxclay.Material(), "paper")
    settings = method_settings("greedy", {"step": 1e-9, "max_iterations": SWEEPS})
    start = jaxclay.rough_shape(problem).point
    with jax.enable_x64(True):
        arguments = jax.device_put(
            as_float64((problem, initial_guess(problem, start), settings, True))
        )
        figures = []
        for _ in range(RUNS + 1):
            begin = time.perf_counter()
            outcome = jax.block_until_ready(solve(*arguments, method="greedy"))
            visits = int(outcome.iterations) * int(problem.unknowns)
            figures.append(visits / (time.perf_counter() - begin))
    return figures[1:]  # the first run compiles


def main() -> None:
    """Print a line a grid."""
    print(f"{SWEEPS} sweeps, {RUNS} runs, one core, float64")
    print("slices   median visits/s   least      most")
    for slices in (64, 128, 256, 512):
        figures = visits_a_second(slices)
        median = statistics.median(figures)
        print(f"{slices:6d}   {median:15.3g}   {min(figures):.3g}   {max(figures):.3g}")


if __name__ == "__main__":
    main()
