"""Parts c, d, e, g and h of the newton benchmark: what it is like to use."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from bounds import Bound, Part, table
from clocks import alternate, compilations, spread
from newton_timing import SAME, Effort

import jaxclay
from jaxclay.problem import Problem

sys.path.append(str(Path(__file__).resolve().parent.parent / "tests"))
from oracles import population  # pyright: ignore[reportMissingImports]

STEPS, DRAGGED = 60, 256  # of the tool, slices
FIRST_CALL, FIRST_CACHED = 2.5, 0.5  # seconds

DRAGS: dict[str, Callable[[int], jaxclay.Squash]] = {
    "radius": lambda i: jaxclay.Squash(0.0, 0.3, 0.45 - 0.001 * i),
    "top": lambda i: jaxclay.Squash(0.0, 0.25 + 0.001 * i, 0.4),
    "middle": lambda i: jaxclay.Squash(0.3 + 0.001 * i, 0.5 + 0.001 * i, 0.4),
}


def drag(effort: Effort) -> Part:
    """Part c: a tool dragged in small steps, each solve started from the answer before."""
    found = table(
        f"c. Drag: {STEPS} steps of the tool at n = {DRAGGED}, each from the last answer",
        *("tool", "median ms", "p99 ms", "p99/median", "iterations", "cold", "pose ms"),
        *("certified", "compilations"),
    )
    made, ratios = 0, []
    for units, material in _materials(64).items():
        for name, squash in DRAGS.items():
            clay = jaxclay.Clay.cylinder(slices=DRAGGED)
            solution = jaxclay.minimize(jaxclay.pose(clay, squash(0), material, "paper"))
            cold, before, rows = int(solution.iterations), len(compilations), []
            for i in range(1, STEPS + 1):
                begin = time.perf_counter()
                problem = jaxclay.pose(clay, squash(i), material, "paper")
                ready = time.perf_counter()
                solution = jaxclay.minimize(problem, start=solution)
                end = time.perf_counter()
                accepted = bool(solution.certificate.accepted)
                rows.append((end - ready, ready - begin, int(solution.iterations), accepted))
            times, poses, iterations, accepted = map(np.array, zip(*rows, strict=True))
            made += (new := len(compilations) - before)
            median, p99 = np.percentile(times, (50, 99))
            ratios.append(p99 / median)
            found.add_row(
                *(f"{name} {units}", f"{1e3 * median:.3g}", f"{1e3 * p99:.3g}"),
                *(f"{ratios[-1]:.2f}", spread(iterations, "{:.0f}"), str(cold)),
                *(f"{1e3 * np.median(poses):.3g}", f"{accepted.sum()}/{STEPS}", str(new)),
            )
    bound = Bound("c. compilations after the first step", "0", str(made), made == 0)
    return Part(found, [bound], [f"c. p99/median of all drags: {spread(ratios)}"])


def _materials(slices: int) -> dict[str, jaxclay.Material]:
    snake = jaxclay.Material.from_snake_units(slices=slices)
    return {"snake": snake, "printed": jaxclay.Material()}


def by_size(effort: Effort) -> Part:
    """Part d: time per slice of two large pieces, fig4a in the snake units of each grid."""
    found = table(
        "d. Time per slice, fig4a in the grid's own snake units, the whole minimize call",
        *("slices", "seconds", "us per slice", "iterations", "coarser grids", "status"),
    )
    per_slice = []
    for n in effort.large:
        problem = _cylinder(n, jaxclay.Squash(0.0, 0.3, 0.4))
        taken = alternate({"whole": lambda p=problem: jaxclay.minimize(p)}, effort.seconds)["whole"]
        solution = jaxclay.minimize(problem)
        per_slice.append(float(np.median(taken)) / n)
        found.add_row(
            *(str(n), spread(taken), f"{1e6 * per_slice[-1]:.3g}", str(solution.iterations)),
            *(" ".join(map(str, solution.levels)), str(solution.status)),
        )
    few, many = effort.large
    ratio = per_slice[1] / per_slice[0]
    return Part(found, [], [f"d. time per slice at n = {many} over that at {few}: {ratio:.3g}"])


def _cylinder(n: int, squash: jaxclay.Squash) -> Problem:
    """In the grid's own snake units: those of a coarser grid move the free end of a finer one."""
    clay = jaxclay.Clay.cylinder(slices=n)
    return jaxclay.pose(clay, squash, _materials(n)["snake"], "paper")


def in_a_window(effort: Effort) -> Part:
    """Part e: a squash of little reach, in a window and as a whole."""
    n = effort.large[1]
    problem = _cylinder(n, jaxclay.Squash(0.0, 0.01, 0.499))
    rough = jaxclay.rough_shape(problem)
    reach = float(rough.reach - rough.reach_below)
    found = table(
        f"e. A squash that reaches {100 * reach:.2g}% of the clay, n = {n}",
        *("solve", "seconds", "iterations", "status", "energy less the whole's"),
    )
    solvers = {
        "whole": lambda: jaxclay.minimize(problem),
        "window": lambda: jaxclay.minimize(problem, window="auto"),
    }
    times = alternate(solvers, effort.seconds)
    answers = {name: solver() for name, solver in solvers.items()}
    whole, scale = answers["whole"], float(answers["whole"].certificate.energy_free)
    gaps = {name: float(a.energy - whole.energy) / scale for name, a in answers.items()}
    for name, answer in answers.items():
        seconds, status = spread(times[name]), str(answer.status)
        found.add_row(name, seconds, str(answer.iterations), status, f"{gaps[name]:+.1e} E_free")
    ratio = np.median(times["whole"]) / np.median(times["window"])
    same = abs(gaps["window"]) <= SAME
    bound = Bound("e. the window's minimum is the whole's", "yes", "yes" if same else "no", same)
    return Part(found, [bound], [f"e. the whole takes {ratio:.3g} times as long as the window"])


def over_population(effort: Effort) -> Part:
    """Part g: the random population at n = 64; earlier squashes carried out by newton."""
    floor_slack, iterations, refused, posed, left_out = np.inf, [], [], 0, 0
    for i, (r0, squashes, material) in enumerate(population(effort.population)):
        try:
            clay = jaxclay.Clay.cylinder(radius=r0)
            for squash in squashes[:-1]:
                if float(squash.bottom) < 0.8 * float(clay.height):
                    clay = jaxclay.deform(clay, squash, material, scheme="paper").clay
            problem = jaxclay.pose(clay, squashes[-1], material, "paper")
        except ValueError:  # a band above what the earlier squashes left
            left_out += 1
            continue
        posed += 1
        solution = jaxclay.minimize(problem)
        iterations.append(int(solution.iterations))
        if not solution.certificate.accepted:
            refused.append(f"{i} {solution.status}")
        room = problem.slack(solution.point) / problem.rest.thickness
        loose = np.asarray(problem.loose)
        floor_slack = min(floor_slack, float(np.min(np.asarray(room)[loose], initial=np.inf)))
    found = table(
        f"g. {effort.population} random scenes, n = 64",
        *("posed", "certified", "least slack / rest thickness", "median", "p90", "most iterations"),
    )
    median, p90 = np.percentile(iterations, (50, 90))
    share = 1 - len(refused) / posed
    figures = f"{share:.2%}", f"{floor_slack:.2g}", f"{median:g}", f"{p90:g}", str(max(iterations))
    found.add_row(str(posed), *figures)
    bounds = [
        Bound("g. random scenes certified", "100%", figures[0], not refused),
        Bound("g. least slack above the floor", ">= -1e-12", figures[1], floor_slack >= -1e-12),
    ]
    note = f"g. {left_out} scenes could not be posed; refused: {', '.join(refused) or 'none'}"
    return Part(found, bounds, [note])


_FIRST = """
import json, time
start = time.perf_counter()
import jaxclay
imported = time.perf_counter()
clay = jaxclay.Clay.cylinder(slices=64)
problem = jaxclay.pose(clay, jaxclay.Squash(0.0, 0.3, 0.4), jaxclay.Material(), "paper")
posed = time.perf_counter()
solution = jaxclay.minimize(problem)
end = time.perf_counter()
assert solution.certificate.accepted
print(json.dumps([imported - start, posed - imported, end - posed]))
"""


def first_calls(effort: Effort) -> Part:
    """Part h: the first calls in a fresh process, without and with a cache on disk."""
    found = table(
        "h. First calls in a fresh process, fig4a at n = 64, seconds",
        *("cache on disk", "import", "pose", "minimize"),
    )
    with tempfile.TemporaryDirectory() as folder:
        without = [_fresh({}) for _ in range(effort.processes)]
        cache = {
            "JAX_COMPILATION_CACHE_DIR": folder,
            "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
            "JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES": "-1",
        }
        _fresh(cache)
        cached = [_fresh(cache) for _ in range(effort.processes)]
    bounds = []
    for name, runs, wanted in (("no", without, FIRST_CALL), ("yes", cached, FIRST_CACHED)):
        columns = list(zip(*runs, strict=True))
        found.add_row(name, *map(spread, columns))
        median = float(np.median(columns[-1]))
        what = f"h. first minimize in a fresh process, cache on disk: {name}, s"
        bounds.append(Bound(what, f"<= {wanted:g}", f"{median:.3g}", median <= wanted))
    return Part(found, bounds, [])


def _fresh(environment: dict[str, str]) -> list[float]:
    """Seconds of import, pose and minimize in a new process."""
    kept = {name: value for name, value in os.environ.items() if "CACHE" not in name}
    result = subprocess.run(
        [sys.executable, "-c", _FIRST],
        env=kept | environment,
        check=True,
        capture_output=True,
        text=True,
    )
    return json.loads(result.stdout)
