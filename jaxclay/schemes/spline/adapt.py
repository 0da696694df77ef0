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
from jaxclay.implicit import attached
from jaxclay.loop import Outcome, Start, cold, run
from jaxclay.schemes.spline import bspline, mesh
from jaxclay.schemes.spline.estimate import estimate, near
from jaxclay.schemes.spline.pose import PARTS, Squashed, located, meshed, on_knots
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.shape import crossings, displaced, displaced_on, projected
from jaxclay.schemes.spline.solve import judged
from jaxclay.smooth_clay import SmoothClay
from jaxclay.solution import Verdict

LEVELS = 10
_COUNT = 16  # knots at most on each stretch of the first mesh
_USUAL = 1e-4  # the tolerance that the lengths below are for
_EDGE, _REACH, _SAG = 0.8, 0.8, 0.5  # first spans, over the layer's thickness and the sag's depth
_SHARP = 3.0  # reaches over the layer's thickness from which a kink is worth a knot
_VISIBLE = 0.2  # sag of the radius over the tolerance that is worth spans
_STILL = 0.1  # displacement over the tolerance from which the rest shape's breaks are knots
_KINK = 0.5  # effect on the radius of a kink of the rest shape over the tolerance, worth knots
_ROOM = 0.5  # error of a span over the tolerance that is left alone
_FAR = 40.0  # the same from which a span is cut in four
_LOOSE = 0.1  # energy left, relative to E_free, over the tolerance squared
_SMOOTH = 1e-2  # friction's smoothing over the tolerance, before the last level
_PATIENCE = 60  # iterations on a mesh before the last
_TRIALS = 2  # meshes that may go unsolved
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
    problem: SplineProblem
    outcome: Outcome
    function: tuple[Array, Array]  # the displacement of the estimate, to start from
    number: Array
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
    problem = last.problem
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

    def level(now: _Level) -> _Level:
        problem, start = jax.lax.cond(
            now.polishes,
            lambda: (now.problem, Start(*now.outcome[:2], jnp.asarray(True))),
            lambda: _begun(squashed, now, degree, sides),
        )
        chosen = jax.tree.map(lambda a, b: jnp.where(now.polishes, a, b), settings, loose)
        outcome = run(problem, start, chosen, jnp.asarray(True), "newton")
        now = now._replace(
            problem=problem,
            outcome=outcome,
            levels=now.levels.at[now.number].add(outcome.iterations),
        )
        polished = now._replace(done=jnp.asarray(True))
        return jax.lax.cond(
            now.polishes, lambda: polished, lambda: _judged(squashed, now, tolerance, loose)
        )

    inner = _first_mesh(squashed, tolerance, degree, sides, spans, kinks)
    return jax.lax.while_loop(
        lambda now: ~now.done, level, _first(squashed, inner, loose, degree, sides)
    )


def _first(squashed: Squashed, inner: Array, settings: Any, degree: int, sides: int) -> _Level:
    """Before the first level: no displacement."""
    problem = meshed(squashed, inner, None, degree, sides)
    state = cold(problem, problem.point(problem.even()))
    none, no = jnp.asarray(0), jnp.asarray(False)
    outcome = Outcome(state.point, state.forces, none, no, jnp.asarray(True))
    spans = 2 * problem.space.spans
    v = jnp.linspace(0.0, 1.0, spans + 1) * mesh.free_length(squashed.band)
    function = v, jnp.zeros((spans, bernstein.DEGREE + 1))
    done = ~squashed.rough.feasible
    levels = jnp.zeros(LEVELS, int)
    return _Level(
        inner, problem, outcome, function, none, levels, jnp.asarray(jnp.inf), no, no, done
    )


def _begun(squashed: Squashed, now: _Level, degree: int, sides: int):
    """The problem on the level's mesh, and a start near the last level's answer.

    For the first level, or where that answer makes no shape, any shape.
    """
    knots = mesh.knots(now.inner, squashed.band, degree, sides)
    carried = projected(knots, degree, *now.function)
    breaks = crossings(displaced_on(knots, degree, carried)[1])
    problem = on_knots(squashed, knots, breaks, degree)
    point = problem.point(jnp.where(problem.fixed, problem.shift, carried))
    above = jnp.all(jnp.where(problem.loose, problem.slack(point) > 0, True))
    usable = above & (now.number > 0)
    point = problem.point(jnp.where(usable, point.coefficients, problem.even()))
    start = near(problem, point, jnp.asarray(_EPS))
    anew = cold(problem, point)
    return problem, jax.tree.map(lambda a, b: jnp.where(usable, a, b), start, anew)


def _judged(squashed: Squashed, now: _Level, tolerance: Array, settings: Any) -> _Level:
    """What the estimate says of a level: a finer mesh, or an end."""
    problem, outcome = now.problem, now.outcome
    found = estimate(squashed, problem, outcome.point, tolerance, settings)
    errors = jnp.where(outcome.finite, found.spans, jnp.inf)
    error = jnp.max(errors)
    end = mesh.free_length(squashed.band)
    inner, full = _refined(problem, now.inner, errors / tolerance, end)
    hopeless = ~outcome.finished & (now.number >= _TRIALS)
    polishes = (error <= tolerance) | full | hopeless | (now.number + 1 >= LEVELS)
    return now._replace(
        inner=jnp.where(polishes, now.inner, inner),
        function=found.function,
        number=jnp.where(polishes, now.number, now.number + 1),
        levels=now.levels.at[now.number].add(found.iterations),
        error=error,
        full=full & (error > tolerance),
        polishes=polishes,
    )


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


def _first_mesh(
    squashed: Squashed, tolerance: Array, degree: int, sides: int, spans: int, kinks: int
) -> Array:
    """(spans,) inner knots."""
    band = squashed.band
    end = mesh.free_length(band)
    inner = mesh.graded(band, _density(squashed, tolerance), _COUNT, sides)
    if kinks:
        inner = jnp.concatenate([inner, _inherited(squashed, tolerance, degree, kinks)])
    return jnp.sort(jnp.concatenate([inner, jnp.broadcast_to(end, spans)]))[:spans]


def _inherited(squashed: Squashed, tolerance: Array, degree: int, count: int) -> Array:
    """Knots at the rest shape's breaks where its details matter.

    Once where the sliced cylinder model moves clay: a squeeze of a shape with details has
    details at the same places.  Bending smooths a jump of Y0_uuu, as old bands leave it,
    wherever clay moves, so that w has it too: at the ``count`` worst breaks knots repeated
    p - 2 times let it, p - 1 times without bending and p times without any smoothing.
    """
    rest, band = squashed.rest, squashed.band
    at = rest.breaks[1:-1]
    outside = (at < 1) & ((at <= band.lower) | (at >= band.upper))
    place = at - jnp.where(at >= band.upper, band.upper - band.lower, 0.0)
    end = mesh.free_length(band)
    shift = jnp.abs(squashed.rough.point.shift[::PARTS])
    moves = jnp.maximum(shift[:-2], shift[2:]) > _STILL * tolerance
    effect = jnp.where(outside, _kinked(squashed), 0.0)
    effect, worst = jax.lax.top_k(effect, min(count, at.shape[0]))
    strong = effect > _KINK * tolerance
    material = squashed.material
    times = degree - 2 + jnp.where(material.beta > 0, 0, jnp.where(material.alpha > 0, 1, 2))
    wanted = strong[:, None] & (jnp.arange(degree) < times)
    repeated = jnp.where(wanted, place[worst][:, None], end)
    # A kink's knots are counted once: one more would let the curvature jump.
    index = jnp.arange(at.shape[0])
    taken = jnp.any((index[:, None] == worst) & strong, axis=1)
    single = jnp.where(moves & outside & ~taken, place, end)
    return jnp.concatenate([single, repeated.reshape(-1)])


def _kinked(squashed: Squashed) -> Array:
    """(m-1,) about how far the radius is off where a jump at a break is smoothed over a layer."""
    rest = squashed.rest
    width = jnp.diff(rest.breaks)
    width = jnp.where(width > 0, width, 1.0)
    begin = bernstein.in_piece(rest.control, width, jnp.zeros_like(width))
    end = bernstein.in_piece(rest.control, width, jnp.ones_like(width))
    filled = rest.breaks[1:-1] < 1
    jump = [
        jnp.where(filled, jnp.abs(b[1:] - e[:-1]), 0.0) for b, e in zip(begin, end, strict=True)
    ]
    slope = jnp.where(filled, begin[1][1:], 1.0)
    layer = _layer(slope, rest.r0, squashed.material)
    of_slope = jump[1] + jump[2] * layer / 8 + jump[3] * layer**2 / 32
    return rest.r0 / 2 * slope**-1.5 * of_slope


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
