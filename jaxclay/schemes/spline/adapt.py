"""As few unknowns as a tolerance needs: spans where the answer needs them.

From the first mesh on, spans are cut where the estimate is large, and the solve
starts from the estimate's answer, until it is small enough.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxclay import bernstein
from jaxclay._host import compiled
from jaxclay.band import Tool
from jaxclay.clay import Array, Material
from jaxclay.implicit import attached
from jaxclay.loop import Outcome, Start, cold, run
from jaxclay.schemes.spline import bspline, mesh
from jaxclay.schemes.spline.estimate import estimate, near
from jaxclay.schemes.spline.first_mesh import first_mesh
from jaxclay.schemes.spline.pose import OnMesh, Squashed, joined, located, meshed, on_mesh
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.shape import crossings, displaced, displaced_on, projected
from jaxclay.schemes.spline.solve import judged
from jaxclay.smooth_clay import SmoothClay
from jaxclay.solution import Verdict

LEVELS = 10
_ROOM, _SHARE = 0.5, 0.3  # a span is cut above so much of the tolerance, or of the worst error
_FAR = 40.0  # over the tolerance: from there on it is cut in four
_LOOSE = 0.1  # energy left, relative to E_free, over the tolerance squared
_SMOOTH = 1e-2  # friction's smoothing over the tolerance, before the last level
_MISPLACED = 0.5  # strain by friction of the wrong sign, over the tolerance, that is let be
_PATIENCE = 60  # iterations on a mesh before the last
_TRIALS = 2  # meshes that may go unsolved
_EPS = 1e-6  # friction's smoothing at the start of a level, over l


class Adapted(NamedTuple):
    """The answer on the last mesh, and how it was found.

    Attributes
    ----------
    problem, outcome, verdict
    error : scalar
        Estimate of the contour's error, over l.
    levels : (10,) int array
        Iterations on each mesh, the estimate's included; 0 for those not needed.
    full : bool
        Whether more spans were needed than there is room for.
    """

    problem: SplineProblem
    outcome: Outcome
    verdict: Verdict
    error: Array
    levels: Array
    full: Array


class _Level(NamedTuple):
    inner: Array
    mesh: OnMesh
    outcome: Outcome
    function: tuple[Array, Array]  # the displacement of the estimate, to start from
    number: Array
    again: Array  # whether this level's mesh has been solved on before
    levels: Array
    error: Array
    full: Array
    polishes: Array  # the mesh is fine enough, the answer not yet exact
    done: Array


@compiled("degree", "sides", "spans", "kinks", "differentiable")
def adapted(
    clay: SmoothClay,
    tool: Tool,
    material: Material,
    tolerance: Array,
    settings: Any,
    *,
    degree: int,
    sides: int,
    spans: int,
    kinks: int,
    differentiable: bool,
) -> Adapted:
    """Solve to a tolerance with about ``spans`` spans at most: one compiled call.

    Up to ``kinks`` breaks of the rest shape get knots at which the displacement may have a kink.
    """
    squashed = located(clay, tool, material, sides)
    last = _levels(
        *jax.lax.stop_gradient((squashed, tolerance, settings)), degree, sides, spans, kinks
    )
    total = last.outcome._replace(iterations=jnp.sum(last.levels))
    problem = joined(squashed, last.mesh)
    if differentiable:  # derivatives do not come out of the loop: its mesh is made again
        breaks = crossings(displaced(problem.space, total.point.coefficients)[1])
        problem = meshed(squashed, last.inner, breaks, degree, sides)
        total = attached(problem, total)
    verdict = judged(problem, total)
    return Adapted(problem, total, verdict, last.error, last.levels, last.full)


def _levels(squashed, tolerance, settings, degree, sides, spans, kinks) -> _Level:
    """Meshes, each refined from the one before, until the estimate is below the tolerance."""
    loose = dataclasses.replace(
        settings,
        max_iterations=jnp.minimum(settings.max_iterations, _PATIENCE),
        tolerance=_LOOSE * tolerance**2,
        smoothing=_SMOOTH * tolerance,
    )

    feasible = squashed.rough.feasible

    def level(now: _Level) -> _Level:
        found, start = jax.lax.cond(
            now.polishes,
            lambda: (now.mesh, Start(*now.outcome[:2], jnp.asarray(True))),
            lambda: _begun(squashed, now, degree, sides),
        )
        problem = joined(squashed, found)
        chosen = jax.tree.map(lambda a, b: jnp.where(now.polishes, a, b), settings, loose)
        outcome = run(problem, start, chosen, feasible, "newton")
        now = now._replace(
            mesh=found,
            outcome=outcome,
            levels=now.levels.at[now.number].add(outcome.iterations),
        )
        function = displaced(problem.space, outcome.point.coefficients)
        repeats = ~now.again & _misplaced(problem, function, tolerance)
        repeated = now._replace(function=_longer(*function), again=jnp.asarray(True))
        ends = now.polishes | ~feasible
        ended = now._replace(done=jnp.asarray(True))
        return jax.lax.cond(
            ends | repeats,
            lambda: jax.tree.map(lambda a, b: jnp.where(ends, a, b), ended, repeated),
            lambda: _judged(squashed, now, tolerance, loose),
        )

    inner = first_mesh(squashed, tolerance, degree, sides, spans, kinks)
    return jax.lax.while_loop(lambda now: ~now.done, level, _first(squashed, inner, degree, sides))


def _first(squashed: Squashed, inner: Array, degree: int, sides: int) -> _Level:
    """Before the first level: no mesh and no displacement."""

    def begun():
        knots = mesh.knots(inner, squashed.band, degree, sides)
        found = on_mesh(squashed, knots, None, degree)
        problem = joined(squashed, found)
        return found, cold(problem, problem.point(problem.even()))

    shapes = jax.eval_shape(begun)
    empty, state = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)
    none, no = jnp.asarray(0), jnp.asarray(False)
    outcome = Outcome(state.point, state.forces, none, no, jnp.asarray(True))
    spans = 2 * empty.space.spans
    v = jnp.linspace(0.0, 1.0, spans + 1) * mesh.free_length(squashed.band)
    function = v, jnp.zeros((spans, bernstein.DEGREE + 1))
    levels = jnp.zeros(LEVELS, int)
    error = jnp.asarray(jnp.inf)
    return _Level(inner, empty, outcome, function, none, no, levels, error, no, no, no)


def _begun(squashed: Squashed, now: _Level, degree: int, sides: int):
    """The problem on the level's mesh, and a start near the last level's answer.

    For the first level, or where that answer makes no shape, any shape.
    """
    knots = mesh.knots(now.inner, squashed.band, degree, sides)
    carried = projected(knots, degree, *now.function)
    breaks = crossings(displaced_on(knots, bspline.extraction(knots, degree), carried)[1])
    found = on_mesh(squashed, knots, breaks, degree)
    problem = joined(squashed, found)
    point = problem.point(jnp.where(problem.fixed, problem.shift, carried))
    above = jnp.all(jnp.where(problem.loose, problem.slack(point) > 0, True))
    usable = above & ((now.number > 0) | now.again)
    point = problem.point(jnp.where(usable, point.coefficients, problem.even()))
    start = near(problem, point, jnp.asarray(_EPS))
    anew = cold(problem, point)
    start = jax.tree.map(lambda a, b: jnp.where(usable, a, b), start, anew)
    return found, start


def _longer(v: Array, control: Array) -> tuple[Array, Array]:
    """The same function with as many empty spans at the end."""
    end = jnp.broadcast_to(v[-1], control.shape[0])
    return jnp.append(v, end), jnp.concatenate([control, jnp.zeros_like(control)])


def _misplaced(problem: SplineProblem, function, tolerance: Array) -> Array:
    """Whether friction's cells meet so far from where the displacement changes sign that it shows.

    Between them friction has the wrong sign, which strains the clay by 2 mu / k of the way.
    """
    v, control = function
    broken = crossings(control)
    cells = problem.space.friction_weight.reshape(broken.shape[0], -1)
    first = jnp.sum(cells[:, : cells.shape[1] // 2], axis=1)
    way = jnp.abs(broken * jnp.diff(v) - first)
    moves = jnp.max(jnp.abs(control), axis=1) > _SMOOTH * tolerance
    shows = 2 * problem.material.mu * way > _MISPLACED * tolerance * problem.material.k
    return jnp.any((broken != 0.5) & moves & shows)


def _judged(squashed: Squashed, now: _Level, tolerance: Array, settings: Any) -> _Level:
    """What the estimate says of a level: a finer mesh, or an end."""
    problem, outcome = joined(squashed, now.mesh), now.outcome
    found = estimate(squashed, problem, outcome.point, tolerance, settings)
    # Beside no minimum the estimate means nothing.
    solved = outcome.finite & outcome.finished
    error, errors = (jnp.where(solved, e, jnp.inf) for e in (found.error, found.spans))
    end = mesh.free_length(squashed.band)
    inner, full = _refined(problem, now.inner, errors / tolerance, end)
    hopeless = ~outcome.finished & (now.number >= _TRIALS)
    polishes = (error <= tolerance) | full | hopeless | (now.number + 1 >= LEVELS)
    return now._replace(
        inner=jnp.where(polishes, now.inner, inner),
        function=found.function,
        number=jnp.where(polishes, now.number, now.number + 1),
        again=jnp.asarray(False),
        levels=now.levels.at[now.number].add(found.iterations),
        error=error,
        full=full & (error > tolerance),
        polishes=polishes,
    )


def _refined(problem: SplineProblem, inner: Array, errors: Array, end: Array):
    """Inner knots with spans cut in two, or four, and whether there is no room for all of them."""
    left, length = bspline.spans(problem.space.knots, problem.space.degree)
    worst = jnp.max(jnp.where(length > 0, errors, 0.0))
    cut = (errors > jnp.minimum(_ROOM, _SHARE * worst)) & (length > 0)
    four = cut & (errors > _FAR) & jnp.isfinite(errors)
    quarters = [
        jnp.where(four if share != 0.5 else cut, left + share * length, end)
        for share in (0.25, 0.5, 0.75)
    ]
    knots = jnp.sort(jnp.concatenate([inner, *quarters]))
    count = inner.shape[0]
    return knots[:count], jnp.sum(knots < end) > count
