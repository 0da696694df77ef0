"""Second-order slices, each figure beside its bound.

Parts:
  a  contour error at n = 64, 128 and 256 over the random population, against n = 2048,
     and its order in n from 32 to 512
  b  sessions of 20 squashes, three materials: error against a fine n, solves refused
  c  solves certified, population, n up to 1024
  d  dragging a tool's top by 50 steps: jumps of the contour beyond a fine n's own
  e  newton's compiled solve against the paper's sums on as many slices, same run
"""

from __future__ import annotations

import itertools
import time
from typing import NamedTuple

import jax
import numpy as np
from bounds import Bound, Part, run, table
from slices_scenes import FLARED, MATERIALS, population, session
from solves import compiled_call

import jaxclay
from jaxclay import Clay, Material, Squash, Status, contour_error, deform


class Effort(NamedTuple):
    """How thoroughly to measure."""

    scenes: int
    sessions: int
    reference: int  # slices of the reference of sessions
    seconds: float  # of timed repeats that a scene gets


QUICK, THOROUGH = Effort(6, 1, 512, 0.02), Effort(100, 15, 1024, 0.2)
SIZES = (32, 64, 128, 256, 512)
FINE = 2048
SEED = 11


def accuracy(effort: Effort) -> Part:
    """Part a."""
    errors, orders, kinked = {n: [] for n in SIZES}, [], []
    for scene in population(effort.scenes, SEED):
        exact = deform(*scene[:3], slices=FINE)
        if exact.status is not Status.CONVERGED:
            continue
        row = [contour_error(deform(*scene[:3], slices=n).clay, exact.clay) for n in SIZES]
        for n, error in zip(SIZES, row, strict=True):
            errors[n].append(error)
        orders.append(-np.polyfit(np.log(SIZES), np.log(row), 1)[0])
        m = scene.material
        flat = Material(m.k, m.mu, m.alpha, 0.0)
        exact = deform(scene.clay, scene.squash, flat, slices=FINE)
        if exact.status is Status.CONVERGED:
            row = [deform(scene.clay, scene.squash, flat, slices=n).clay for n in SIZES]
            row = [contour_error(clay, exact.clay) for clay in row]
            kinked.append(-np.polyfit(np.log(SIZES), np.log(row), 1)[0])
    found = table(
        f"a. Contour error against n = {FINE}, {len(orders)} scenes", "n", "median", "90%"
    )
    bounds = []
    wanted = {64: (4e-4, 1.5e-3), 128: (1e-4, 3e-4), 256: (2.5e-5, 8e-5)}
    for n in SIZES:
        median, high = np.median(errors[n]), np.quantile(errors[n], 0.9)
        found.add_row(f"{n}", f"{median:.2g}", f"{high:.2g}")
        for what, value, most in zip(
            ("median", "90%"), (median, high), wanted.get(n, ()), strict=False
        ):
            bounds.append(
                Bound(f"error at {n}, {what}", f"{most:g}", f"{value:.2g}", value <= most)
            )
    for what, values, least in (("beta > 0", orders, 1.9), ("beta = 0", kinked, 1.6)):
        order = np.median(values)
        bounds.append(Bound(f"order, {what}", f"{least:g}", f"{order:.2f}", bool(order >= least)))
    return Part(found, bounds, [])


def sessions(effort: Effort) -> Part:
    """Part b."""
    sizes = (128, 256)
    found = table("b. After 20 squashes", "material", "n", "median", "90%", "flared lips, largest")
    even, refused, solves = {n: [] for n in sizes}, 0, 0
    for name, material in MATERIALS.items():
        errors, flared = {n: [] for n in sizes}, {n: [] for n in sizes}
        for seed in range(effort.sessions):
            clays, lost = session(seed, material, sizes, effort.reference)
            refused, solves = refused + sum(lost.values()), solves + 20 * len(lost)
            exact = clays[effort.reference]
            wide = exact.radii.max() > FLARED * 0.4
            for n in sizes:
                (flared if wide else errors)[n].append(contour_error(clays[n], exact))
        for n in sizes:
            even[n] += errors[n]
            some = errors[n] or [np.nan]
            lips = f"{max(flared[n]):.2g} of {len(flared[n])}" if flared[n] else "none"
            middle, high = np.median(some), np.quantile(some, 0.9)
            found.add_row(name, f"{n}", f"{middle:.2g}", f"{high:.2g}", lips)
    bounds = []
    for n, wanted in ((128, (2e-3, 5e-3)), (256, (5e-4, 1.2e-3))):
        values = np.median(even[n]), np.quantile(even[n], 0.9)
        for what, value, most in zip(("median", "90%"), values, wanted, strict=True):
            what = f"20 squashes at {n}, {what}"
            bounds.append(Bound(what, f"{most:g}", f"{value:.2g}", bool(value <= most)))
    share = 1 - refused / solves
    bounds.append(
        Bound("certified in sessions", "99.9%", f"{share:.2%} of {solves}", share >= 0.999)
    )
    return Part(found, bounds, [f"against n = {effort.reference} by the same method"])


def certified(effort: Effort) -> Part:
    """Part c."""
    found = table("c. Solves certified", "n", "solves", "certified")
    bounds = []
    for n in (*SIZES, 1024):
        ends = [deform(*s[:3], slices=n).status for s in population(effort.scenes, SEED + 1)]
        share = ends.count(Status.CONVERGED) / len(ends)
        least = 0.99 if n > 512 else 0.999
        found.add_row(f"{n}", f"{len(ends)}", f"{share:.1%}")
        bounds.append(Bound(f"certified at {n}", f"{least:.1%}", f"{share:.1%}", share >= least))
    return Part(found, bounds, [])


def dragging(effort: Effort) -> Part:
    """Part d."""
    del effort
    found = table("d. Dragging top by 50 steps of 4e-4: largest jump", "scene", "64", "128", "256")
    worst = {64: 0.0, 128: 0.0}
    for bottom, units in ((0.0, "snake"), (0.3, "snake"), (0.0, "printed"), (0.3, "printed")):
        material = Material.from_snake_units() if units == "snake" else Material()
        jumps = {}
        for n in (64, 128, 256):
            tools = [Squash(bottom, bottom + 0.3 + 4e-4 * i, 0.4) for i in range(51)]
            clays = [deform(Clay.cylinder(), tool, material, slices=n).clay for tool in tools]
            jumps[n] = np.array([contour_error(a, b) for a, b in itertools.pairwise(clays)])
        found.add_row(f"bottom {bottom:g}, {units}", *(f"{jumps[n].max():.2g}" for n in jumps))
        for n in worst:
            worst[n] = max(worst[n], float((jumps[n] - jumps[256]).max()))
    bounds = [
        Bound(f"excess over n = 256 at {n}", f"{most:g}", f"{worst[n]:.2g}", worst[n] <= most)
        for n, most in ((64, 5e-4), (128, 5e-5))
    ]
    return Part(found, bounds, [])


def speed(effort: Effort) -> Part:
    """Part e."""
    found = table(
        "e. Newton's compiled solve, us, median of scenes", "n", "paper", "slices", "ratio"
    )
    bounds = []
    scenes = list(population(min(effort.scenes, 20), SEED + 2))
    for n in (64, 128, 256):
        times = {"paper": [], "slices": []}
        for scene in scenes:
            calls = {}
            for scheme in times:
                try:
                    problem = jaxclay.pose(*scene[:3], scheme, slices=n)
                except ValueError:
                    break
                calls[scheme] = compiled_call(problem, None, "newton")
            if len(calls) == 2:
                for scheme, taken in _alternate(calls, effort.seconds).items():
                    times[scheme].append(taken)
        paper, slices = (1e6 * np.median(times[scheme]) for scheme in times)
        ratio = np.median(np.array(times["slices"]) / np.array(times["paper"]))
        found.add_row(f"{n}", f"{paper:.0f}", f"{slices:.0f}", f"{ratio:.2f}")
        bounds.append(
            Bound(f"newton over paper's at {n}", "1.3", f"{ratio:.2f}", bool(ratio <= 1.3))
        )
    return Part(found, bounds, ["from a posed problem to newton's end, both schemes in turn"])


def _alternate(calls: dict, seconds: float) -> dict[str, float]:
    taken: dict[str, list[float]] = {scheme: [] for scheme in calls}
    end = None
    while end is None or time.perf_counter() < end:
        for scheme, call in calls.items():
            begin = time.perf_counter()
            with jax.enable_x64(True):
                jax.block_until_ready(call())
            taken[scheme].append(time.perf_counter() - begin)
        end = time.perf_counter() + seconds if end is None else end
    return {scheme: float(np.median(some[1:])) for scheme, some in taken.items()}


PARTS = {"a": accuracy, "b": sessions, "c": certified, "d": dragging, "e": speed}

if __name__ == "__main__":
    raise SystemExit(run(PARTS, QUICK, THOROUGH, __doc__ or ""))
