"""A scene solved in one way: as users call it, and the compiled call alone, ready to be timed."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np

from jaxclay.experiments.compare.population import RandomScene
from jaxclay.methods import loop
from jaxclay.methods.choice import method_settings, spline_settings
from jaxclay.numerics.host import as_float64
from jaxclay.schemes.posing import pose
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.resolution import resolvable_slices
from jaxclay.schemes.rough import rough_shape
from jaxclay.schemes.slices.posing import place, pose_on_host
from jaxclay.solve import on_spans
from jaxclay.solve.certified_newton import packed, program
from jaxclay.solve.minimize import deform, minimize
from jaxclay.solve.refining import Wanted, followed, on_slices
from jaxclay.solve.solution import Solution
from jaxclay.solve.start import start_of

_LONG = 0.2  # seconds: runs longer than that are not repeated


class Way(NamedTuple):
    """How a scene is solved.

    Attributes
    ----------
    scheme : str
        "paper", slices of the paper's sums; "equal" or "placed", slices of second order, equal
        beside the band or where the contour bends; "spline".
    method : str
    degree : int
        Of splines, 0 on slices.
    size : int
        Slices, or spans on each side.
    """

    scheme: str
    method: str
    degree: int
    size: int


class Ready(NamedTuple):
    """A solve to be timed: as users call it, and the compiled call alone."""

    call: Callable[[], Solution]
    solve: Callable[[], Any]


class Limit(Exception):
    """Why a scene cannot be solved in this way; a word for the table."""


def prepared(scene: RandomScene, way: Way) -> Ready:
    """The solve, ready to be timed.

    Raises
    ------
    Limit
        "rounding" where float64 resolves fewer slices, "band" where so few hold no band.
    """
    if way.scheme in ("equal", "placed"):
        return _second_order(scene, way)
    if way.scheme == "spline":
        posing = {"scheme": "spline", "degree": way.degree, "elements": way.size}
        problem = pose(scene.clay, scene.squash, scene.material, **posing)
        values = on_device((problem, on_spans.begin_from(problem, None)))
        settings = on_device(spline_settings(way.method, {}))
        return _posed(scene, posing, way.method, lambda: spans(values, settings, way.method))
    posing = {"scheme": "paper", "slices": way.size}
    try:
        problem = pose(scene.clay, scene.squash, scene.material, **posing)
    except ValueError as error:
        raise Limit("band") from error
    if problem.slices > resolvable_slices(problem):
        raise Limit("rounding")
    return _posed(scene, posing, way.method, compiled_call(problem, None, way.method))


def _second_order(scene: RandomScene, way: Way) -> Ready:
    clay, squash, material = scene.clay, scene.squash, scene.material
    posing = {"slices": way.size, "spacing": way.scheme}
    try:
        solves = (_placed if way.scheme == "placed" else _equal)(scene, way)
    except ValueError as error:
        raise Limit("band") from error
    calls = [compiled_call(*each) for each in solves]

    def call() -> Solution:
        return deform(clay, squash, material, way.method, **posing)

    def solve():
        with jax.enable_x64(True):
            return [jax.block_until_ready(each()) for each in calls][-1]

    return Ready(call, solve)


def _equal(scene: RandomScene, way: Way) -> list[tuple[Problem, Any, str]]:
    found = place(scene.clay, scene.squash, scene.material)
    return [(pose_on_host(found, way.size, "equal"), None, way.method)]


def _placed(scene: RandomScene, way: Way) -> list[tuple[Problem, Any, str]]:
    """The problems that ``deform`` solves one after the other, and where each solve begins."""
    asked = []

    def solve(wanted: Wanted) -> Solution:
        asked.append((*wanted, "newton"))
        return minimize(wanted.problem, start=wanted.start)

    found = place(scene.clay, scene.squash, scene.material)
    last = followed(on_slices(found, way.size), solve).problem
    return asked if way.method == "newton" else [*asked, (last, None, way.method)]


def compiled_call(problem: Problem, start: Any, method: str) -> Callable[[], Any]:
    """The compiled call of :func:`jaxclay.minimize` alone, its arguments ready on the device."""
    rough, settings = rough_shape(problem), method_settings(method, {})
    begin = start_of(problem, rough.point, start, method)
    if method == "newton":
        values = on_device(packed(problem.system, begin, settings, rough.feasible))
        return lambda: program.whole(values)
    values = on_device((problem, begin, settings, rough.feasible))
    return lambda: loop.solve.whole(*values, method=method)


def spans(values: tuple, settings: Any, method: str) -> Any:
    """Compiled code alone of a solve on splines, given its problem and its start."""

    def solve(problem, start):
        return on_spans.answered.whole(problem, start, settings, method=method)

    return on_spans.solved(solve, *values)[1]


def _posed(scene: RandomScene, posing, method: str, run: Callable[[], Any]) -> Ready:
    def call() -> Solution:
        return minimize(pose(scene.clay, scene.squash, scene.material, **posing), method)

    def solve():
        with jax.enable_x64(True):
            return jax.block_until_ready(run())

    return Ready(call, solve)


def on_device(values: Any) -> Any:
    """The same as float64 arrays of JAX's."""
    with jax.enable_x64(True):
        return jax.device_put(as_float64(values))


def seconds_of(call: Callable[[], Any], seconds: float) -> float:
    """Median of warm calls, at least three unless they are long."""
    call()
    taken, end = [], time.perf_counter() + seconds
    while len(taken) < (1 if taken and taken[0] > _LONG else 3) or time.perf_counter() < end:
        begin = time.perf_counter()
        call()
        taken.append(time.perf_counter() - begin)
    return float(np.median(taken))
