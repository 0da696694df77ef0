"""As few unknowns as a tolerance needs: spans where the answer needs them.

The first mesh follows from the energy's own lengths: how thick the layer at the
band's edge is, where the sliced cylinder model says that clay begins to rest, how
deep tension pulls a free top down.  Then spans are cut where the estimate is
large, and the solve starts from the estimate's answer, until it is small enough.
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
from jaxclay.implicit import solve_implicitly
from jaxclay.loop import Outcome, Start, cold, run
from jaxclay.schemes.spline import bspline, mesh
from jaxclay.schemes.spline.estimate import estimate, near
from jaxclay.schemes.spline.pose import Squashed, located, meshed
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.shape import crossings, projected
from jaxclay.schemes.spline.solve import judged
from jaxclay.smooth_clay import SmoothClay
from jaxclay.solution import Verdict

LEVELS = 10
_COUNT = 16  # knots at most on each stretch of the first mesh
_USUAL = 1e-4  # the tolerance that the lengths below are for
_EDGE, _REACH, _SAG = 0.8, 0.8, 0.5  # first spans, over the layer's thickness and the sag's depth
_SHARP = 3.0  # reaches over the layer's thickness from which a kink is worth a knot
_VISIBLE = 0.2  # sag of the radius over the tolerance that is worth spans
_ROOM = 0.5  # error of a span over the tolerance that is left alone
_FAR = 40.0  # the same from which a span is cut in four
_LOOSE = 0.1  # energy left, relative to E_free, over the tolerance squared
_SMOOTH = 1e-2  # friction's smoothing over the tolerance, before the last level
_EPS = 1e-6  # the same at the start of a level, over l


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
    function: tuple[Array, Array]
    number: Array
    levels: Array
    error: Array
    full: Array
    done: Array
    coefficients: Array
    friction: Array
    breaks: Array


@compiled("degree", "sides", "spans")
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
) -> Adapted:
    """Solve to a tolerance with at most about ``spans`` spans: one compiled call."""
    squashed = located(clay, tool, material)
    last = _levels(*jax.lax.stop_gradient((squashed, tolerance, settings)), degree, sides, spans)
    problem = meshed(squashed, last.inner, last.breaks, degree, sides)
    point = problem.point(jnp.where(problem.fixed, problem.shift, last.coefficients))
    forces = near(problem, point, jnp.asarray(_EPS)).forces._replace(friction=last.friction)
    start = jax.lax.stop_gradient(Start(point, forces, jnp.asarray(True)))
    outcome = solve_implicitly(problem, start, settings, squashed.rough.feasible, "newton")
    levels = last.levels.at[jnp.maximum(last.number - 1, 0)].add(outcome.iterations)
    total = outcome._replace(iterations=jnp.sum(levels))
    verdict = judged(problem, total)
    return Adapted(problem, total, verdict, last.error, levels, last.full)


def _levels(squashed, tolerance, settings, degree, sides, spans) -> _Level:
    """Meshes, each refined from the one before, until the estimate is below the tolerance."""
    loose = dataclasses.replace(
        settings, tolerance=_LOOSE * tolerance**2, smoothing=_SMOOTH * tolerance
    )
    length = mesh.free_length(squashed.band)

    def level(now: _Level) -> _Level:
        knots = mesh.knots(now.inner, squashed.band, degree, sides)
        breaks = crossings(knots, degree, *now.function)
        problem = meshed(squashed, now.inner, breaks, degree, sides)
        start = _start(problem, now.function, now.number)
        outcome = run(problem, start, loose, jnp.asarray(True), "newton")
        found = estimate(squashed, problem, outcome.point, tolerance, loose)
        errors = jnp.where(outcome.finite, found.spans, jnp.inf)
        error = jnp.max(errors)
        inner, full = _refined(problem, now.inner, errors / tolerance, length)
        done = (error <= tolerance) | full | (now.number + 1 >= LEVELS)
        used = outcome.iterations + found.iterations
        return _Level(
            inner=jnp.where(done, now.inner, inner),
            function=found.function,
            number=now.number + 1,
            levels=now.levels.at[now.number].set(used),
            error=error,
            full=full & (error > tolerance),
            done=done,
            coefficients=outcome.point.coefficients,
            friction=outcome.forces.friction,
            breaks=breaks,
        )

    inner = _first_mesh(squashed, tolerance, sides, spans)
    shapes = jax.eval_shape(lambda: level(_nothing(squashed, inner, degree, sides)))
    first = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)
    v = jnp.linspace(0.0, 1.0, first.function[0].shape[0]) * length
    first = first._replace(inner=inner, function=(v, first.function[1]), error=jnp.asarray(jnp.inf))
    first = first._replace(done=~squashed.rough.feasible)
    return jax.lax.while_loop(lambda now: ~now.done, level, first)


def _nothing(squashed: Squashed, inner: Array, degree: int, sides: int) -> _Level:
    """A level whose displacement is zero, to learn the shapes from."""
    function = jnp.stack([0.0, mesh.free_length(squashed.band)]), jnp.zeros((1, 6))
    none, no = jnp.zeros(()), jnp.asarray(False)
    levels = jnp.zeros(LEVELS, int)
    return _Level(inner, function, jnp.asarray(0), levels, none, no, no, none, none, none)


def _start(problem: SplineProblem, function: tuple[Array, Array], number: Array) -> Start:
    """Near the last level's answer; for the first, or where that makes no shape, any shape."""
    knots, degree = problem.space.knots, problem.space.degree
    carried = jnp.where(problem.fixed, problem.shift, projected(knots, degree, *function))
    point = problem.point(carried)
    usable = jnp.all(jnp.where(problem.loose, problem.slack(point) > 0, True)) & (number > 0)
    point = jax.tree.map(lambda a, b: jnp.where(usable, a, b), point, problem.point(problem.even()))
    start = near(problem, point, jnp.asarray(_EPS))
    anew = cold(problem, point)
    return jax.tree.map(lambda a, b: jnp.where(usable, a, b), start, anew)


def _refined(problem: SplineProblem, inner: Array, errors: Array, end: Array):
    """Inner knots with spans cut in two, or four, and whether there is no room for all of them."""
    left, length = bspline.spans(problem.space.knots, problem.space.degree)
    cut = (errors > _ROOM) & (length > 0)
    four = cut & (errors > _FAR) & jnp.isfinite(errors)
    quarters = [
        jnp.where(four if share != 0.5 else cut, left + share * length, end)
        for share in (0.25, 0.5, 0.75)
    ]
    knots = jnp.sort(jnp.concatenate([inner, *quarters]))
    count = inner.shape[0]
    return knots[:count], jnp.sum(knots < end) > count


def _first_mesh(squashed: Squashed, tolerance: Array, sides: int, spans: int) -> Array:
    """(spans,) inner knots."""
    band = squashed.band
    inner = mesh.graded(band, _density(squashed, tolerance), _COUNT, sides)
    end = mesh.free_length(band)
    return jnp.sort(jnp.concatenate([inner, jnp.broadcast_to(end, spans)]))[:spans]


def _density(squashed: Squashed, tolerance: Array) -> mesh.Density:
    _, rest, tool, material, band, rough = squashed
    at = jnp.stack([band.lower, band.upper, jnp.ones(())])
    slope = bernstein.evaluate(rest.breaks, rest.control, at, 2)[1]
    layer = _layer(slope[:2], rest.r0, material)
    finer = (tolerance / _USUAL) ** 0.2  # the radius is of order 5 in the spans
    reach = jnp.stack([band.lower - rough.reach_below, rough.reach - band.upper])
    span = jnp.stack([band.lower, 1 - band.upper])
    case = jnp.stack([rough.case_below_code, rough.case_code])
    sharp = (case == 1) & (reach > _SHARP * layer)
    top = slope[2]
    sag = material.alpha * top**1.5 / material.k * rest.r0
    depth = 2 * material.alpha * top / jnp.maximum(material.mu, 1e-9)
    sags = ~tool.top_fixed & (sag > _VISIBLE * tolerance)
    last = jnp.where(sags, finer * jnp.maximum(_EDGE * layer[1], _SAG * depth), jnp.inf)
    return mesh.Density(
        edge=finer * _EDGE * layer,
        reach=jnp.where(sharp, reach, 2 * span + 1),
        at_reach=finer * _REACH * layer,
        end=jnp.stack([jnp.asarray(jnp.inf), last]),
    )


def _layer(slope: Array, r0: Array, material: Material) -> Array:
    """Over what share of the clay a disturbance of Y_u decays at least, at rest slopes Y0_u.

    1/|q| of the steepest solution exp(q u) of the linearised equation
    k/s^2 y - (alpha r0^2/(2 s^3) + 2 beta) y'' + beta r0^2/(2 s^3) y'''' = 0; without
    smoothing a tenth of the clay.
    """
    bend = r0**2 / (2 * slope**3)
    a, c = material.k / slope**2, material.beta * bend
    b = material.alpha * bend + 2 * material.beta
    root = jnp.sqrt(jnp.maximum(b**2 - 4 * a * c, 0.0))
    steepest = jnp.where(root > 0, (b + root) / jnp.maximum(2 * c, 1e-300), jnp.sqrt(a / c))
    layer = 1 / jnp.sqrt(steepest)
    tension = jnp.sqrt(material.alpha * bend / a)
    return jnp.where(material.beta > 0, layer, jnp.where(material.alpha > 0, tension, 0.1))
