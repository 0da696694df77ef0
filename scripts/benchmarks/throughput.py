"""Squashes a second at 64 slices in float64: one call after the other, and many in one call.

Scenes are those of the random population that begin as cylinders.  "solve" is newton on a problem
that is posed, "deform" poses it too, "spline" poses and solves on 8 fixed spans a side, "to 1e-4"
takes as many slices as that needs, where every scene is a call of its own.  A call takes 256
scenes, and on a CPU solves each to its own end: a straggler costs its own iterations and nobody
else's.  Seconds are of processor time, the least of a few runs, so that what else the machine does
counts little; the column "by the clock" has what a clock on the wall says.  The last table holds
every bound; the exit status is 1 if one is not met.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("NPROC", "1")  # threads of XLA's pool: problems are small

import jax
import numpy as np
from bounds import Bound, table, verdict
from rich.console import Console
from solves import on_device
from threadpoolctl import threadpool_limits
from throughput_scenes import WAYS, scenes

import jaxclay
from jaxclay.experiments.machine import cores, one_thread, pinned
from jaxclay.numerics.host import Compiled
from jaxclay.solve.batch import CAPACITY, stack

_SINGLE = 400  # calls that are timed one after the other
_TIMES_SINGLE, _SECOND_CORE = 3.0, 1.7  # the bounds
_RUNS = 5


class Seconds(NamedTuple):
    """Of processor time, and by the clock."""

    processor: float
    clock: float


def main() -> int:
    """Measure and print."""
    arguments = parsed()
    jaxclay.keep_compilations()
    console = Console(width=110)
    found = table(
        f"{arguments.scenes} squashes, a second",
        "", "single calls, 1 core", "batched, 1 core", f"batched, {cores()} cores",
        "by the clock", "GPU",
    )  # fmt: skip
    bounds = []
    for name in arguments.only:
        single, alone = measured(name, arguments.scenes)
        together, clock = on_all_cores(name, arguments.scenes)
        rates = [f"{rate:.0f}" for rate in (single, alone, together, clock)]
        print(f"{name}: {', '.join(rates)}", file=sys.stderr, flush=True)
        found.add_row(name, *rates, on_gpu(name))
        bounds += bounds_of(name, single, alone, together)
    console.print(found)
    console.print(f"stragglers: {stragglers(arguments.scenes)}", highlight=False, soft_wrap=True)
    return verdict(console, bounds)


def bounds_of(name: str, single: float, alone: float, together: float) -> list[Bound]:
    """What is asked of a way: against single calls, if it is batched, and of the second core."""
    gain, scaling = alone / single, together / alone
    found = []
    if WAYS[name].one is not None:
        what = f"{name}, batched over single"
        found.append(Bound(what, f">= {_TIMES_SINGLE}", f"{gain:.2f}", gain >= _TIMES_SINGLE))
    if cores() > 1:
        what = f"{name}, {cores()} cores over one"
        wanted = _SECOND_CORE * cores() / 2
        found.append(Bound(what, f">= {wanted:g}", f"{scaling:.2f}", scaling >= wanted))
    return found


def measured(name: str, count: int) -> tuple[float, float]:
    """Scenes a second on one core: single calls, and batched."""
    way, chosen = WAYS[name], scenes(name, count)
    with threadpool_limits(1), pinned():
        few = chosen[:_SINGLE]
        for scene in few:
            way.single(*scene)
        single = quickest(lambda: [way.single(*scene) for scene in few], len(few))
        return 1 / single.processor, 1 / batched(name, chosen).processor


def quickest(run: Callable[[], Any], count: int) -> Seconds:
    """For each of so many scenes, the least of a few runs of all."""
    found = []
    for _ in range(_RUNS):
        begin = time.process_time(), time.perf_counter()
        run()
        found.append((time.process_time() - begin[0], time.perf_counter() - begin[1]))
    return Seconds(*np.min(found, axis=0) / count)


def batched(name: str, chosen: list, wait: Callable[[], Any] = lambda: None) -> Seconds:
    """Seconds of a scene; compiled, and every shape met, before the clock starts."""
    way = WAYS[name]
    if way.one is None:
        few = chosen[:_SINGLE]
        for scene in few:
            way.single(*scene)
        wait()
        return quickest(lambda: [way.single(*scene) for scene in few], len(few))
    one = way.one
    many = Compiled(lambda those: jax.lax.map(one, those)).whole
    with jax.enable_x64(True):
        parts = [
            on_device(stack(chosen[i : i + CAPACITY], CAPACITY))
            for i in range(0, len(chosen), CAPACITY)
        ]
        jax.block_until_ready(many(parts[0]))
        wait()
        return quickest(lambda: [jax.block_until_ready(many(part)) for part in parts], len(chosen))


def on_all_cores(name: str, count: int) -> tuple[float, float]:
    """Scenes a second, by processor time and by the clock, in a spawned process for each core."""
    workers = cores()
    os.environ.update(one_thread())
    spawn = multiprocessing.get_context("spawn")
    barrier, said = spawn.Barrier(workers), spawn.Queue()
    share = count // workers
    processes = [
        spawn.Process(target=share_of, args=(name, share, number, barrier, said))
        for number in range(workers)
    ]
    for process in processes:
        process.start()
    times = [said.get(timeout=1800) for _ in processes]
    for process in processes:
        process.join()
    by_processor = sum(1 / one.processor for one in times)
    return by_processor, workers / max(one.clock for one in times)


def share_of(name: str, share: int, number: int, barrier, said) -> None:
    """One process's share, on a core of its own, begun when all are ready."""
    if hasattr(os, "sched_setaffinity"):
        mine = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {mine[number % len(mine)]})
    with threadpool_limits(1):
        said.put(batched(name, scenes(name, share, seed=number), barrier.wait))


def on_gpu(name: str) -> str:
    """Scenes a second on a GPU, side by side in lockstep."""
    try:
        device = jax.devices("gpu")[0]
    except RuntimeError:
        return "none here"
    one = WAYS[name].one
    if one is None:
        return "not batched"
    with jax.enable_x64(True), jax.default_device(device):
        chosen = on_device(stack(scenes(name, 8 * CAPACITY)))
        many = jax.jit(jax.vmap(one))
        jax.block_until_ready(many(chosen))
        begin = time.perf_counter()
        jax.block_until_ready(many(chosen))
        return f"{8 * CAPACITY / (time.perf_counter() - begin):.0f}"


def stragglers(count: int) -> str:
    """The time of a batch against that of its median scene, many times over."""
    chosen = scenes("solve", min(count, 4 * CAPACITY))
    iterations = np.array([int(jaxclay.minimize(*scene).iterations) for scene in chosen])
    order = np.argsort(iterations)
    middle = [chosen[order[len(order) // 2]]] * len(chosen)
    with threadpool_limits(1), pinned():
        whole, even = (batched("solve", each).processor for each in (chosen, middle))
    return (
        f"{np.median(iterations):.0f} iterations in the middle, {iterations.max()} at most; a "
        f"batch takes {whole / even:.2f} times as long as one of scenes that all take the middle "
        f"number ({np.mean(iterations) / np.median(iterations):.2f} is what the mean takes; in "
        f"lockstep it would be {iterations.max() / np.median(iterations):.2f})"
    )


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=10_000, help="how many (default 10,000)")
    parser.add_argument("--only", nargs="+", choices=WAYS, default=list(WAYS), help="these alone")
    arguments = parser.parse_args()
    if arguments.scenes < CAPACITY:
        parser.error(f"--scenes must be at least {CAPACITY}, the size of a call")
    return arguments


if __name__ == "__main__":
    sys.exit(main())
