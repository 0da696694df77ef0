"""A scene solved in one way: as users call it, and the compiled call alone, ready to be timed."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import jax
import numpy as np

from jaxclay._host import as_float64
from jaxclay.clay import Clay
from jaxclay.compare.population import RandomScene
from jaxclay.conversion import cut
from jaxclay.methods.choice import method_settings
from jaxclay.minimize import _PLACINGS, _answered, deform, minimize
from jaxclay.posing import pose
from jaxclay.problem import Problem
from jaxclay.resolution import resolvable_slices
from jaxclay.schemes.slices.ladder import carried
from jaxclay.schemes.slices.posing import located, pose_on_host
from jaxclay.schemes.spline import host
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.solve import answered
from jaxclay.smooth_clay import SmoothClay
from jaxclay.solution import Solution, Status
from jaxclay.start import begin_from

_LONG = 0.2  # seconds: runs longer than that are not repeated
_PARTS = 16  # slices to a piece of a rest shape that is a function, where slices are needed


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
    adaptive : bool
        Whether ``size`` is a tolerance.
    size : float
        Slices, spans on each side, or the tolerance.
    """

    scheme: str
    method: str
    degree: int
    adaptive: bool
    size: float


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
    if way.adaptive:
        return _adaptive(scene, way)
    if way.scheme in ("equal", "placed"):
        return _second_order(scene, way)
    clay, squash, material = scene.clay, scene.squash, scene.material
    settings = method_settings(way.method, {})
    if way.scheme == "spline":
        whole = {"scheme": "spline", "degree": way.degree, "elements": int(way.size)}
        problem = cast(SplineProblem, pose(clay, squash, material, **whole))
        values = problem, host._begin(problem, None), settings
        return _fixed(clay, scene, whole, way.method, answered, values)
    slices = cut(clay, int(way.size))
    try:
        problem = cast(Problem, pose(slices, squash, material, "paper"))
    except ValueError as error:
        raise Limit("band") from error
    if problem.slices > resolvable_slices(problem):
        raise Limit("rounding")
    values = problem, begin_from(problem, None), settings
    return _fixed(slices, scene, {"scheme": "paper"}, way.method, _answered, values)


def _second_order(scene: RandomScene, way: Way) -> Ready:
    """Slices of second order, which take the rest shape in slices of its own."""
    slices = int(way.size)
    clay = _in_pieces(scene.clay) if scene.worked else cut(scene.clay, slices)
    squash, material = scene.squash, scene.material
    posing = {"slices": slices, "spacing": way.scheme}
    try:
        solves = (_placed if way.scheme == "placed" else _equal)(clay, squash, material, slices)
    except ValueError as error:
        raise Limit("band") from error
    settings = method_settings(way.method, {})
    values = [on_device((*each, settings)) for each in solves]

    def call() -> Solution:
        return deform(clay, squash, material, way.method, **posing)

    def solve():
        with jax.enable_x64(True):
            for each in values:
                answer = jax.block_until_ready(_answered.whole(*each, method=way.method))
        return answer

    return Ready(call, solve)


def _in_pieces(smooth: SmoothClay) -> Clay:
    """The function in slices that break where its pieces do, to 1e-6 of the contour or better."""
    breaks = np.unique(smooth.breaks)
    share = np.arange(_PARTS) / _PARTS
    nodes = np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * share).ravel(), 1.0)
    heights, slope, *_ = smooth.derivatives(nodes)
    edges = np.stack([nodes, smooth.r0 / slope**0.5], axis=1)[_PARTS:-1:_PARTS]
    return Clay(heights, np.diff(heights), smooth.r0, smooth.unit, nodes, edges)


def _equal(clay: Clay, squash, material, slices: int) -> list[tuple[Problem, Any]]:
    problem = pose_on_host(located(clay, squash, material), slices, "equal")
    return [(problem, begin_from(problem, None))]


def _placed(clay: Clay, squash, material, slices: int) -> list[tuple[Problem, Any]]:
    """The problems that ``deform`` solves one after the other, and where each solve begins."""
    found, answer, solves = located(clay, squash, material), None, []
    for _ in range(_PLACINGS):
        problem = pose_on_host(found, slices // 2, "placed", answer)
        solves.append((problem, begin_from(problem, None)))
        answer = minimize(problem)
        if answer.status is not Status.CONVERGED:
            problem = pose_on_host(found, slices, "placed")
            return [*solves, (problem, begin_from(problem, None))]
    problem = pose_on_host(found, slices, "placed", answer)
    return [*solves, (problem, begin_from(problem, carried(problem, answer)))]


def _fixed(clay: Clay | SmoothClay, scene, posing, method: str, fun, values) -> Ready:
    values = on_device(values)

    def call() -> Solution:
        return minimize(pose(clay, scene.squash, scene.material, **posing), method)

    def solve():
        with jax.enable_x64(True):
            return jax.block_until_ready(fun.whole(*values, method=method))

    return Ready(call, solve)


def _adaptive(scene: RandomScene, way: Way) -> Ready:
    smooth = host.prepared(scene.clay)
    sides = host.sides_of(scene.squash, smooth)
    settings = method_settings(way.method, {})
    values = on_device((smooth, scene.squash, scene.material, way.size, settings))
    kinks, sizes = host.rooms(smooth, sides)
    fixed = {"degree": way.degree, "sides": sides, "kinks": kinks, "differentiable": False}

    def call() -> Solution:
        return deform(
            scene.clay, scene.squash, scene.material, tolerance=way.size, degree=way.degree
        )

    def solve():
        with jax.enable_x64(True):
            for spans in sizes:
                answer = host._adapted.whole(*values, spans=spans, **fixed)
                if not jax.block_until_ready(answer).full:
                    return answer
        return answer

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
