"""Methods around a minimiser of smooth functions: stages, coordinates and stopping.

A minimiser knows one iteration.  Around it each stage of
:mod:`jaxclay.methods.stages`, or on splines of :mod:`jaxclay.methods.penalties`, is
minimised in coordinates of its own (:mod:`jaxclay.methods.coordinates`); what lies
below the lower bound is lifted onto it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxclay.methods.base import Method, State, check_setting
from jaxclay.methods.coordinates import AnyStage, Bounds, Chart, Coordinates
from jaxclay.methods.penalties import Penalties, first_penalties, next_penalties
from jaxclay.methods.stages import first_stage, next_stage
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.host import is_concrete, pytree
from jaxclay.schemes.base import AnyDisplaced, AnyProblem, lifted, no_forces
from jaxclay.schemes.spline.problem import SplineProblem

# Smoothing of friction, over the unit l.  In Y the kinks soon stop L-BFGS; scaled coordinates
# take them up.
PLAIN_EPS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
SCALED_EPS = (*PLAIN_EPS, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)


@pytree
@dataclasses.dataclass(frozen=True)
class DescentSettings:
    """tolerance: energy to be gained, relative to E_free, at which a stage ends."""

    max_iterations: Array = 2000
    tolerance: Array = 1e-12

    def __post_init__(self):
        if is_concrete(self):
            check_setting("max_iterations", self.max_iterations, 1)
            check_setting("tolerance", self.tolerance, 1e-15, 1e-2)


class Task(NamedTuple):
    """A stage as the minimiser sees it.

    Attributes
    ----------
    energy : x -> scalar
    curvature : scalar
    bounds : Bounds
        See :class:`Coordinates`.
    settings : Any
        The method's.
    """

    energy: Callable[[Array], Array]
    curvature: Array
    bounds: Bounds
    settings: Any


class Descent(NamedTuple):
    """A minimiser, one iteration at a time.

    Attributes
    ----------
    init : (task, x) -> state
    advance : (task, x, state) -> (x, state, size, failed)
        ``size`` is the gradient's norm, projected where there are bounds,
        ``failed`` whether the line search gave up.
    """

    init: Callable[[Task, Array], Any]
    advance: Callable[[Task, Array, Any], tuple[Array, Any, Array, Array]]


class _Memory(NamedTuple):
    stage: AnyStage
    coordinates: Coordinates
    x: Array
    descent: Any


def method(
    descent: Descent,
    coordinates: Chart,
    ladder: tuple[float, ...],
    summary: str,
    settings: type = DescentSettings,
    on_splines: Chart | None = None,
) -> Method:
    """The staged method around a minimiser, in the coordinates given.

    ``on_splines`` are those for splines, where it knows them.
    """

    def begun(problem: AnyProblem, stage: AnyStage, settings: Any) -> _Memory:
        chosen = on_splines if on_splines and isinstance(stage, Penalties) else coordinates
        chart = chosen(problem, stage)
        inner = descent.init(_task(problem, stage, chart, settings), chart.start)
        return _Memory(stage, chart, chart.start, inner)

    def init(problem: AnyProblem, start: AnyDisplaced, settings: Any) -> State:
        memory = begun(problem, _first(problem, start, ladder), settings)
        nothing = ~jnp.any(problem.free)
        return State(start, no_forces(problem), jnp.asarray(0), nothing, memory)

    def step(problem: AnyProblem, state: State, settings: Any) -> State:
        stage, chart, x, _ = state.memory
        task = _task(problem, stage, chart, settings)
        new, inner, size, failed = descent.advance(task, x, state.memory.descent)
        # A line search that gives up may leave the shape anywhere.
        x = jnp.where(failed & ~(task.energy(new) < task.energy(x)), x, new)
        point = chart.point(problem, stage, x)
        forces = stage.forces(problem, point)
        # The gradient's norm at which about that much is left to gain.
        target = jnp.sqrt(2 * chart.curvature * stage.left(problem, point, settings.tolerance))
        ends = failed | (size <= target)

        def turned():
            following, agrees = _next(problem, point, stage)
            return begun(problem, following, settings), agrees | following.last

        def stayed():
            return _Memory(stage, chart, x, inner), jnp.asarray(False)

        memory, finished = jax.lax.cond(ends, turned, stayed)
        point = jax.tree.map(lambda a, b: jnp.where(ends, a, b), memory.stage.base, point)
        return State(lifted(problem, point), forces, state.iterations + 1, finished, memory)

    return Method(settings, init, step, summary, splines=on_splines is not None)


def _first(problem: AnyProblem, start: AnyDisplaced, ladder: tuple[float, ...]) -> AnyStage:
    if isinstance(problem, SplineProblem):
        return first_penalties(problem, start)
    return first_stage(start, ladder)


def _next(problem: Any, point: AnyDisplaced, stage: AnyStage) -> tuple[AnyStage, Array]:
    if isinstance(stage, Penalties):
        return next_penalties(problem, point, stage)
    return next_stage(problem, point, stage)


def _task(problem: AnyProblem, stage: AnyStage, chart: Coordinates, settings: Any) -> Task:
    return Task(chart.energy(problem, stage), chart.curvature, chart.bounds, settings)
