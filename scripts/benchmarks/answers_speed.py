"""Parts c to f and j to l of the answers benchmark: warm calls, every ratio taken in this run."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from bounds import Part, at_least, at_most, table
from clocks import banded_solve, compilations, each, medians, spread
from slices_scenes import Scene, population
from solves import compiled_call

import jaxclay
from jaxclay import Clay, Material, Squash
from jaxclay.experiments.peers import prepare
from jaxclay.methods.loop import initial_guess
from jaxclay.methods.newton import NewtonSettings
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.slices.posing import place
from jaxclay.solve.certified_newton import packed, program

SEED = 21
K = banded_solve(512)
_SAME = 1e-7  # of E_free: energies nearer than that are of the same minimum
_SNAKE = Material.from_snake_units()
# What a squash of a batch took in K before there was one small program: posed problems of this
# population by lax.map in one compiled call without packing (on the paper's scheme 9.7), and
# cylinders to 1e-4 by adaptive splines, which are easier than this population.
_BEFORE = {"posed, n = 64": 13.0, "scenes to 1e-4": 83.0}


def kernel(problem: Problem) -> Callable[[], Any]:
    """The compiled solve with its certificate alone, warm, to be timed."""
    solve = compiled_call(problem, None, "newton")

    def call() -> Any:
        with jax.enable_x64(True):
            return jax.block_until_ready(solve())

    return call


def equations(problem: Problem) -> int:
    """How many equations the program of one solve with its certificate has, all levels counted."""
    rough = jaxclay.rough_shape(problem)
    start = initial_guess(problem, rough.point)
    values = packed(problem.system, start, NewtonSettings(), rough.feasible)
    with jax.enable_x64(True):
        return _equations(jax.make_jaxpr(program.traced)(values).jaxpr)


def _equations(jaxpr: Any) -> int:
    values = jax.tree.leaves(
        [list(equation.params.values()) for equation in jaxpr.eqns],
        is_leaf=lambda value: hasattr(value, "jaxpr") or hasattr(value, "eqns"),
    )
    inner = [getattr(value, "jaxpr", value) for value in values]
    return len(jaxpr.eqns) + sum(_equations(part) for part in inner if hasattr(part, "eqns"))


def batches(problems: list[Problem], scenes: list[Scene]) -> dict[str, Callable[[], Any]]:
    """One call for all posed problems, and one for all scenes to a tolerance."""
    whole = [scene[:3] for scene in scenes]
    return {
        "posed, n = 64": lambda: jaxclay.minimize_batch(problems),
        "scenes to 1e-4": lambda: jaxclay.deform_batch(whole, tolerance=1e-4),
    }


def posed(scene: Scene, n: int) -> Problem:
    """The scene on n slices."""
    return jaxclay.pose(*scene[:3], slices=n)


def program_size(effort) -> Part:
    """Part c."""
    del effort
    scene, found = next(population(1, SEED)), table("c. Equations of a solve", "n", "equations")
    counts = {n: equations(posed(scene, n)) for n in (64, 512)}
    for n, count in counts.items():
        found.add_row(str(n), str(count))
    return Part(found, [at_most("c. equations, any n", max(counts.values()), 900, "{}")], [])


def in_banded_solves(effort) -> Part:
    """Part d."""
    found = table(
        "d. The compiled solve, warm, in banded solves K",
        *("n", "scenes", "compiling s", "solve us", "K us", "solve in K"),
    )
    bounds, scenes = [], list(population(effort.scenes, SEED))
    for n, most in {64: 4, 128: 5, 256: 8, 512: 40}.items():
        jax.clear_caches()
        solves, before = [kernel(posed(scene, n)) for scene in scenes], sum(compilations)
        solves[0]()
        compiling = sum(compilations) - before
        taken = each(({"solve": solve, "K": K} for solve in solves), effort.seconds)
        ratios = taken["solve"] / taken["K"]
        cells = (spread(taken[name], scale=1e6) for name in taken)
        found.add_row(str(n), str(len(scenes)), f"{compiling:.2g}", *cells, spread(ratios))
        bounds.append(at_most(f"d. solve at {n}", np.median(ratios), most, unit=" K"))
    return Part(found, bounds, [])


def against_ipopt(effort) -> Part:
    """Part e."""
    found = table(
        "e. The public minimize call against IPOPT's own work, scenes of the same minimum",
        *("n", "scenes", "same", "minimize ms", "IPOPT ms", "IPOPT / minimize"),
    )
    bounds = []
    for n, least in {64: 15, 256: 30, 1024: 40}.items():
        pairs = []
        for problem in (posed(scene, n) for scene in population(effort.peers, SEED)):
            ipopt, ours = prepare("ipopt", problem), jaxclay.minimize(problem)
            theirs = ipopt.certify(ipopt.solve())
            gap = float((theirs.energy - ours.energy) / ours.certificate.energy_free)
            if ours.certificate.accepted and abs(gap) <= _SAME:
                call = lambda problem=problem: jaxclay.minimize(problem)  # noqa: E731
                pairs.append({"ours": call, "theirs": ipopt.solve})
        taken = each(pairs, effort.seconds)
        ratios = taken["theirs"] / taken["ours"]
        cells = (spread(taken[name], scale=1e3) for name in taken)
        found.add_row(str(n), str(effort.peers), str(len(pairs)), *cells, spread(ratios))
        bounds.append(at_least(f"e. IPOPT's time at {n}", np.median(ratios), least, unit=" times"))
    note = "e. IPOPT through CasADi: exact sparse derivatives, adaptive barrier, tol 1e-12, MUMPS"
    return Part(found, bounds, [note])


def public_calls(effort) -> Part:
    """Part f."""
    found = table(
        "f. Public deform(slices=64), placing included, in solves at n = 64",
        *("band", "scenes", "deform ms", "solve ms", "deform / solve"),
    )
    bounds, scenes = [], list(population(2 * effort.scenes, SEED))
    for name, middle, most in (("at the bottom", False, 4), ("in the middle", True, 8)):
        some = [scene for scene in scenes if (float(scene.squash.bottom) > 0) == middle]
        calls = (
            {"deform": lambda s=s: jaxclay.deform(*s[:3], slices=64), "solve": kernel(posed(s, 64))}
            for s in some
        )
        taken = each(calls, effort.seconds)
        ratios = taken["deform"] / taken["solve"]
        cells = (spread(taken[name], scale=1e3) for name in taken)
        found.add_row(name, str(len(some)), *cells, spread(ratios))
        what = f"f. deform, band {name}, in solves at 64"
        bounds.append(at_most(what, np.median(ratios), most))
    return Part(found, bounds, [])


def locating(effort) -> Part:
    """Part j."""
    found = table("j. Locating a middle band", "n", "interpolating us", "locating us", "K us", "K")
    bounds, squash = [], Squash(0.35, 0.6, 0.4)
    worked = jaxclay.deform(Clay.cylinder(), Squash(0.2, 0.5, 0.45), _SNAKE, slices=128).clay
    for n, most in {64: 15, 4096: 60}.items():
        clay = worked.resliced(n).clay
        fresh = lambda c=clay: Clay(c.heights, c.thickness, c.r0, c.unit, c.material)  # noqa: E731
        calls = {
            "interpolating": lambda fresh=fresh: fresh().interpolant,
            "locating": lambda clay=clay: place(clay, squash, _SNAKE),
            "K": K,
        }
        taken = medians(calls, 5 * effort.seconds)
        ratio = taken["locating"] / taken["K"]
        cells = (f"{1e6 * seconds:.3g}" for seconds in taken.values())
        found.add_row(str(n), *cells, f"{ratio:.3g}")
        bounds.append(at_most(f"j. locating at {n}", ratio, most, unit=" K"))
    return Part(
        found, bounds, ["j. a new piece is interpolated once, however many squashes follow"]
    )


def batched(effort) -> Part:
    """Part k."""
    scenes = list(population(effort.batch, SEED))
    calls = batches([posed(scene, 64) for scene in scenes], scenes)
    found = table("k. Batches, one core", "what", "compiling s", "a second", "K each", "0.1.0's K")
    bounds = []
    for (name, call), least in zip(calls.items(), (2.5, 5.0), strict=True):
        before = sum(compilations)
        call()
        compiling = sum(compilations) - before
        taken = medians({"batch": call, "K": K}, effort.seconds)
        one = taken["batch"] / len(scenes)
        cells = f"{compiling:.2g}", f"{1 / one:.0f}", f"{one / taken['K']:.3g}"
        found.add_row(name, *cells, f"{_BEFORE[name]:.3g}")
        ratio = _BEFORE[name] * taken["K"] / one
        bounds.append(at_least(f"k. {name}, times 0.1.0's rate", ratio, least))
    return Part(found, bounds, [])


_DRAGS: dict[str, Callable[[int], Squash]] = {
    "radius": lambda i: Squash(0.0, 0.3, 0.45 - 0.001 * i),
    "top": lambda i: Squash(0.0, 0.25 + 0.001 * i, 0.4),
    "middle": lambda i: Squash(0.3 + 0.001 * i, 0.5 + 0.001 * i, 0.4),
}


def dragged(effort) -> Part:
    """Part l."""
    del effort
    found = table(
        "l. Drag at n = 256, 60 steps, each from the last answer",
        *("tool", "median ms", "p99 ms", "p99 / median", "certified", "compiled"),
    )
    worst, made, clay = 0.0, 0, Clay.cylinder(slices=256)
    for units, material in (("snake", _SNAKE), ("printed", Material())):
        for name, squash in _DRAGS.items():
            answer = jaxclay.minimize(jaxclay.pose(clay, squash(0), material, slices=256))
            jaxclay.minimize(answer.problem, start=answer)
            before, taken, certified = len(compilations), [], 0
            for i in range(1, 61):
                problem = jaxclay.pose(clay, squash(i), material, slices=256)
                start, times = answer, [time.perf_counter()]
                for _ in range(3):
                    answer = jaxclay.minimize(problem, start=start)
                    times.append(time.perf_counter())
                taken.append(np.median(np.diff(times)))
                certified += bool(answer.certificate.accepted)
            median, p99 = np.percentile(taken, (50, 99))
            new = len(compilations) - before
            worst, made = max(worst, p99 / median), made + new
            cells = f"{1e3 * median:.3g}", f"{1e3 * p99:.3g}", f"{p99 / median:.3g}"
            found.add_row(f"{name} {units}", *cells, f"{certified}/60", str(new))
    bounds = [
        at_most("l. p99 over median, worst drag", worst, 2),
        at_most("l. compilations after the first step", made, 0, "{}"),
    ]
    return Part(found, bounds, ["l. of each step the median of three calls"])
