"""How far an answer's contour is from the continuum's: a hierarchical estimate.

A few Newton steps in the splines on a mesh twice as fine, from the answer, tell
where it would go.  Splines of degree 5 gain a factor of 20 and more from that, so
the way there is the error, about.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxclay import bernstein
from jaxclay.certificate import Forces
from jaxclay.clay import Array
from jaxclay.loop import Start
from jaxclay.methods import newton
from jaxclay.schemes.spline import bspline, mesh
from jaxclay.schemes.spline.pose import Squashed, on_knots
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.shape import crossings, displaced, displaced_on, projected
from jaxclay.schemes.spline.space import Point

_SAFETY = 2.0
_STEPS = 6
_SETTLED = 0.2  # last step over the way so far, or
_SMALL = 0.05  # over the tolerance
_EPS = 1e-2  # friction's smoothing over the tolerance
_PLACES = 6  # in a span at which contours are compared


class Estimate(NamedTuple):
    """What the finer mesh says.

    Attributes
    ----------
    error : scalar
        Of the contour, over l.
    spans : (S,) array
        What each span adds to it, over l: its radius' own, and by how much clay above is shifted.
    function : ((2S+1,), (2S, 6)) arrays
        The displacement on the finer mesh, as in :func:`displaced`.
    iterations : int
        Steps taken there.
    """

    error: Array
    spans: Array
    function: tuple[Array, Array]
    iterations: Array


def estimate(
    squashed: Squashed, problem: SplineProblem, point: Point, tolerance: Array, settings
) -> Estimate:
    """The error of a point that is the minimum on its mesh, at least to within the tolerance."""
    degree, knots = problem.space.degree, problem.space.knots
    left, length = bspline.spans(knots, degree)
    middle = jnp.where(length > 0, left + length / 2, knots[-1])
    finer = jnp.sort(jnp.concatenate([knots, middle]))
    function = displaced(problem.space, point.coefficients)
    carried = projected(finer, degree, *function)
    breaks = crossings(displaced_on(finer, bspline.extraction(finer, degree), carried)[1])
    fine = on_knots(squashed, finer, breaks, degree)
    coefficients = jnp.where(fine.fixed, fine.shift, carried)
    start = fine.point(coefficients)
    end, steps = _stepped(fine, start, tolerance, settings)
    change = end.coefficients - start.coefficients
    errors, added = _apart(fine, end.coefficients, change)
    begins, _ = bspline.spans(finer, degree)
    owner = jnp.sum(begins[:, None] >= left, axis=1) - 1
    # Of spans that begin at one place the last has a length.
    mine = owner[None] == jnp.arange(left.shape[0])[:, None]
    spans = _SAFETY * jnp.max(jnp.where(mine, added, 0.0), axis=1)
    error = _SAFETY * jnp.max(errors)
    return Estimate(error, spans, displaced(fine.space, end.coefficients), steps)


def near(problem: SplineProblem, point: Point, eps: Array) -> Start:
    """A start near a minimum, with friction's forces as if smoothed by eps."""
    shift = point.shift
    friction = problem.friction_limit * shift / jnp.sqrt(shift**2 + eps**2)
    return Start(point, Forces(friction, jnp.zeros_like(problem.floor)), jnp.asarray(True))


def _stepped(fine: SplineProblem, start: Point, tolerance: Array, settings):
    """Newton's steps until they hardly move the contour, and how many."""
    eps = _EPS * tolerance
    state = newton.resume(fine, *near(fine, start, eps), settings)
    state = state._replace(memory=state.memory._replace(eps=eps, failures=jnp.asarray(0)))
    settings = dataclasses.replace(settings, smoothing=eps)

    def distance(a: Point, b: Point) -> Array:
        X = [fine.rest.r0 / jnp.sqrt(p.thickness) for p in (a, b)]
        return jnp.max(jnp.where(fine.loose, jnp.abs(X[0] - X[1]), 0.0))

    def go_on(carry):
        return carry[1] & (carry[0].iterations < _STEPS)

    def step(carry):
        new = newton.step(fine, carry[0], settings)
        moved, way = distance(new.point, carry[0].point), distance(new.point, start)
        settled = (moved <= _SETTLED * way) | (moved <= _SMALL * tolerance)
        return new, ~(settled & (new.memory.failures == 0))

    state, unsettled = jax.lax.while_loop(go_on, step, (state, jnp.asarray(True)))
    broken = ~jnp.all(jnp.isfinite(state.point.coefficients))
    bad = broken | (unsettled & (state.memory.failures > 0))
    coefficients = jnp.where(bad, jnp.nan, state.point.coefficients)
    return state.point._replace(coefficients=coefficients), state.iterations


def _apart(fine: SplineProblem, coefficients: Array, change: Array) -> tuple[Array, Array]:
    """(S,) largest distance normal to the contour, over l, that a change of w makes in each span.

    And what of it comes from the span itself: a squeeze that is off shifts all clay beyond,
    where the mesh may be as fine as it likes.  inf where they are not finite.
    """
    degree, knots = fine.space.degree, fine.space.knots
    left, length = bspline.spans(knots, degree)
    s = jnp.arange(_PLACES) / (_PLACES - 1)
    basis = bspline.basis(fine.space.extraction, length, degree, s, (0, 1, 2))
    w, dw = (
        jnp.einsum("sgoa,sa->sgo", basis, bspline.local(c, degree)) for c in (coefficients, change)
    )
    u = mesh.material(knots, degree, left[:, None] + length[:, None] * s, fine.band)
    rest = bernstein.evaluate(fine.rest.breaks, fine.rest.control, u, 3)
    Y_u, Y_uu = rest[1] + w[..., 1], rest[2] + w[..., 2]
    r0 = fine.rest.r0
    X_u = -r0 / 2 * Y_u**-1.5 * Y_uu
    dX = r0 / jnp.sqrt(Y_u) - r0 / jnp.sqrt(Y_u - dw[..., 1])
    normal = jnp.hypot(X_u, Y_u)
    across = jnp.abs(dX * Y_u - dw[..., 0] * X_u) / normal
    top = jnp.where(left + length >= knots[-1], jnp.abs(dw[:, -1, 0]), 0.0)
    error = jnp.maximum(jnp.max(across, axis=1), top)
    own = jnp.max(jnp.abs(dX * Y_u) / normal, axis=1)
    added = jnp.maximum(own, jnp.abs(dw[:, -1, 0] - dw[:, 0, 0]))

    def finite(values):
        return jnp.where(length > 0, jnp.where(jnp.isfinite(values), values, jnp.inf), 0.0)

    return finite(error), finite(added)
