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
_NARROW = 0.05  # of a layer: spans of the first mesh are longer
_KINK = 0.5  # effect on the radius of a kink of the rest shape over the tolerance, worth knots


def first_mesh(
    squashed: Squashed, tolerance: Array, degree: int, sides: int, spans: int, kinks: int
) -> Array:
    """(spans,) inner knots."""
    band = squashed.band
    end = mesh.free_length(band)
    inner = mesh.graded(band, _density(squashed, tolerance), _COUNT, sides)
    if kinks:
        inner = jnp.concatenate([inner, _inherited(squashed, tolerance, degree, kinks)])
        inner = _apart(inner, band, _NARROW * jnp.min(_layers(squashed)))
    return jnp.sort(jnp.concatenate([inner, jnp.broadcast_to(end, spans)]))[:spans]


def _apart(inner: Array, band: Band, least: Array) -> Array:
    """The knots without those that lie by less than ``least`` beside another or an end.

    Spans far shorter than all others would drown them in rounding.
    """
    end = mesh.free_length(band)
    ends = jnp.stack([jnp.zeros(()), band.lower, end])
    beside = jnp.any(jnp.abs(inner[:, None] - ends) < least, axis=1)
    inner = jnp.sort(jnp.where(beside, end, inner))
    gap = jnp.append(jnp.inf, jnp.diff(inner))
    return jnp.where((gap > 0) & (gap < least), end, inner)


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
