"""Part g of the spline benchmark: many squashes at once, on all cores."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from bounds import Bound, Part, table
from spline_scenes import Effort

from jaxclay._host import Compiled
from jaxclay.compare.population import population
from jaxclay.compare.solves import on_device, seconds_of
from jaxclay.methods.choice import spline_settings
from jaxclay.schemes.spline import host
from jaxclay.schemes.spline.solve import answered

WANTED = {"8 fixed spans": 10_000.0, "adaptive to 1e-4": 3_000.0}  # a second
_SPANS = host._FEW[2]


def batched(effort: Effort) -> Part:
    """Part g: vmap and lax.map inside one compiled call, one thread and one a core."""
    threads = os.cpu_count() or 1
    scenes = _stacked(effort.batch)
    names = "vmap", "lax.map", f"vmap, {threads} threads", f"lax.map, {threads} threads"
    found = table(f"g. {effort.batch} squashes of cylinders at once, a second", "spans", *names)
    bounds, notes = [], ["g. scenes that begin with a cylinder, bands at the bottom or above it"]
    for (name, wanted), one in zip(WANTED.items(), (_fixed, _adaptive), strict=True):
        ways = [Compiled(many(one)).whole for many in (jax.vmap, _mapped)]
        times = [_seconds(way, scenes, t, effort) for t in (1, threads) for way in ways]
        rates = effort.batch / np.array(times)
        found.add_row(name, *(f"{rate:.0f}" for rate in rates))
        best = float(np.max(rates))
        what = f"g. squashes a second, {name}, {threads} cores"
        bounds.append(Bound(what, f">= {wanted:g}", f"{best:.0f}", best >= wanted))
    with jax.enable_x64(True):
        full, converged = Compiled(_mapped(_adaptive)).whole(scenes)
    notes.append(
        f"g. adaptive: {float(jnp.mean(~full)):.1%} fit into {_SPANS} spans, "
        f"{float(jnp.mean(converged)):.1%} converged"
    )
    return Part(found, bounds, notes)


def _stacked(count: int) -> Any:
    """Scenes as one tree of arrays."""
    scenes = population(count, seed=1, worked=False)
    chosen = [jax.tree.map(np.asarray, (one.clay, one.squash, one.material)) for one in scenes]
    return on_device(jax.tree.map(lambda *leaves: np.stack(leaves), *chosen))


def _mapped(one: Callable) -> Callable:
    return lambda scenes: jax.lax.map(one, scenes)


def _fixed(scene):
    problem = host._posed.traced(*scene, degree=5, elements=8, sides=2)
    start = host._start(problem, problem.even())
    answer = answered.traced(problem, start, spline_settings("newton", {}), method="newton")
    return answer.outcome.iterations, answer.verdict.clay


def _adaptive(scene):
    answer = host._adapted.traced(
        *scene, 1e-4, spline_settings("newton", {}),
        degree=5, sides=2, spans=_SPANS, kinks=0, differentiable=False,
    )  # fmt: skip
    return answer.full, answer.verdict.code == 0


def _seconds(solve: Callable, scenes: Any, threads: int, effort: Effort) -> float:
    """Median seconds of all scenes in a compiled call for each core's share, on some threads."""
    count, cores = len(jax.tree.leaves(scenes)[0]), os.cpu_count() or 1
    ends = count // cores * np.arange(cores + 1)
    parts = [jax.tree.map(lambda leaf, a=a, b=b: leaf[a:b], scenes) for a, b in pairwise(ends)]

    def run(part):
        with jax.enable_x64(True):
            return jax.block_until_ready(solve(part))

    with ThreadPoolExecutor(threads) as pool:
        return seconds_of(lambda: list(pool.map(run, parts)), 10 * effort.seconds)
