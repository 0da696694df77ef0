"""The mesh to begin with, from the energy's own lengths and the rest shape's details.

How thick the layer at the band's edge is, where the sliced cylinder model says that
clay begins to rest, how deep tension pulls a free top down; and where the rest
shape has breaks.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxclay import bernstein
from jaxclay.band import Band
from jaxclay.clay import Array, Material
from jaxclay.schemes.spline import mesh
from jaxclay.schemes.spline.pose import PARTS, Squashed

_COUNT = 16  # knots at most on each stretch of the first mesh
_USUAL = 1e-4  # the tolerance that the lengths below are for
_EDGE, _REACH, _SAG = 0.8, 0.8, 0.5  # first spans, over the layer's thickness and the sag's depth
_SHARP = 3.0  # reaches over the layer's thickness from which a kink is worth a knot
_VISIBLE = 0.2  # sag of the radius over the tolerance that is worth spans
_STILL = 0.1  # displacement over the tolerance from which the rest shape's breaks are knots
_NARROW = 0.05  # of a layer: spans of the first mesh are no shorter
_MOST = 5  # knots at one place
_FELT = 0.02  # effect on the contour of a kink of the rest shape over the tolerance, worth a knot
_KINK = 0.5  # and worth knots at which the displacement may have a kink


def first_mesh(
    squashed: Squashed, tolerance: Array, degree: int, sides: int, spans: int, kinks: int
) -> Array:
    """(spans,) inner knots."""
    band = squashed.band
    end = mesh.free_length(band)
    inner = mesh.graded(band, _density(squashed, tolerance), _COUNT, sides)
    if kinks:
        least = _NARROW * jnp.min(_layers(squashed))
        single, strong = _inherited(squashed, tolerance, kinks)
        inner = jnp.concatenate([inner, single])
        inner = _apart(inner, strong, band, least, _times(squashed.material, degree))
    return jnp.sort(jnp.concatenate([inner, jnp.broadcast_to(end, spans)]))[:spans]


def _inherited(squashed: Squashed, tolerance: Array, count: int) -> tuple[Array, Array]:
    """Places of knots at the rest shape's breaks where its details matter, L for none.

    (m-1,) where the sliced cylinder model moves clay, as a squeeze of a shape with details has
    details at the same places, and where a jump of Y0_uuu within a span would spoil its
    quadrature.  (count,) the worst of those at which the displacement needs to have a kink,
    worst first.
    """
    rest, band = squashed.rest, squashed.band
    at = rest.breaks[1:-1]
    outside = (at < 1) & ((at <= band.lower) | (at >= band.upper))
    place = at - jnp.where(at >= band.upper, band.upper - band.lower, 0.0)
    end = mesh.free_length(band)
    shift = jnp.abs(squashed.rough.point.shift[::PARTS])
    moves = jnp.maximum(shift[:-2], shift[2:]) > _STILL * tolerance
    kinked = _kinked(squashed)
    effect, worst = jax.lax.top_k(jnp.where(outside, kinked, 0.0), min(count, at.shape[0]))
    strong = jnp.where(effect > _KINK * tolerance, place[worst], end)
    felt = jnp.where(outside, kinked, 0.0) > _FELT * tolerance
    return jnp.where((moves | felt) & outside, place, end), strong


def _times(material: Material, degree: int) -> Array:
    """How often a knot is repeated for a kink of w as the energy leaves it at a kink of Y0.

    Bending smooths a jump of Y0_uuu, as old bands leave it, wherever clay moves, so that w
    has it too; without bending a jump of Y0_uu, and without any smoothing of Y0_u.
    """
    return degree - 2 + jnp.where(material.beta > 0, 0, jnp.where(material.alpha > 0, 1, 2))


def _apart(inner: Array, strong: Array, band: Band, least: Array, times: Array) -> Array:
    """Knots at distances of at least ``least``, ``strong`` ones repeated and before others.

    Spans far shorter than all others would drown them in rounding, and repeated knots
    beside another act as if repeated once more.
    """
    end = mesh.free_length(band)
    ends = jnp.stack([jnp.zeros(()), band.lower, end])

    def near(places, others):
        return jnp.abs(places[:, None] - others) < least

    worse = jnp.tril(jnp.ones((strong.shape[0],) * 2, bool), -1)
    beside = jnp.any(near(strong, ends), axis=1) | jnp.any(near(strong, strong) & worse, axis=1)
    strong = jnp.where(beside, end, strong)
    beside = jnp.any(near(inner, jnp.concatenate([ends, strong])), axis=1)
    inner = jnp.sort(jnp.where(beside, end, inner))
    # Of cells as wide as ``least`` every second one keeps its first knot, the others theirs
    # if it is far enough from those: long rows of near knots are thinned, not lost.
    cell = jnp.floor(inner / least)
    first = jnp.diff(cell, prepend=-1.0) > 0
    kept = first & (cell % 2 == 0)
    kept |= first & ~jnp.any(near(inner, inner) & kept, axis=1)
    repeated = jnp.where(jnp.arange(_MOST) < times, strong[:, None], end)
    return jnp.concatenate([jnp.where(kept, inner, end), repeated.reshape(-1)])


def _kinked(squashed: Squashed) -> Array:
    """(m-1,) how far the contour is off, about, where a jump at a break is smoothed over a layer.

    Its radius there, or in a thin neck the height of all above.
    """
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
    return jnp.maximum(rest.r0 / 2 * slope**-1.5, layer) * of_slope


def _density(squashed: Squashed, tolerance: Array) -> mesh.Density:
    _, rest, tool, material, band, rough = squashed
    top = bernstein.evaluate(rest.breaks, rest.control, jnp.ones(()), 2)[1]
    layer = _layers(squashed)
    finer = (tolerance / _USUAL) ** 0.2  # the radius is of order 5 in the spans
    reach = jnp.stack([band.lower - rough.reach_below, rough.reach - band.upper])
    span = jnp.stack([band.lower, 1 - band.upper])
    case = jnp.stack([rough.case_below_code, rough.case_code])
    sharp = (case == 1) & (reach > _SHARP * layer)
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


def _layers(squashed: Squashed) -> Array:
    """(2,) thickness of the layers at the band's edges."""
    rest, band = squashed.rest, squashed.band
    at = jnp.stack([band.lower, band.upper])
    slope = bernstein.evaluate(rest.breaks, rest.control, at, 2)[1]
    return _layer(slope, rest.r0, squashed.material)


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
