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
from jaxclay.schemes.spline.pose import Squashed, parts
from jaxclay.schemes.spline.problem import Rest

_COUNT = 32  # knots at most on each stretch of the first mesh
# First spans over a layer's length, were it as high as the tolerance.
_EDGE, _REACH, _SAG, _END = 2.7, 3.0, 8.0, 4.5
_FADE, _FALL = 8.0, 4.0  # distance in which spans grow by e over the layer's length
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
    inner = mesh.graded(band, _features(squashed, tolerance), _COUNT, sides)
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
    shift = jnp.abs(squashed.rough.point.shift[:: parts(rest)])
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
    layer, _ = _lengths(slope, rest.r0, squashed.material)
    of_slope = jump[1] + jump[2] * layer / 8 + jump[3] * layer**2 / 32
    return jnp.maximum(rest.r0 / 2 * slope**-1.5, layer) * of_slope


def _features(squashed: Squashed, tolerance: Array) -> mesh.Features:
    """The layers at the band's edges, at the ends of the reach, and at a free top that sags.

    The error of a layer's function A exp(-x / d) is even over spans of
    c d (tolerance / A)^(1/5) exp(x / (5 d)); they grow by e over ``_FADE`` d, somewhat slower.
    """
    rest, tool, material, band = squashed.rest, squashed.tool, squashed.material, squashed.band
    rough = squashed.rough
    slope = _edge_slopes(rest, band)
    fast, slow = _lengths(slope, rest.r0, material)
    radius = rest.r0 * slope**-0.5
    jump = jnp.abs(tool.radius - radius)
    reach = jnp.stack([band.lower - rough.reach_below, rough.reach - band.upper])
    span = jnp.stack([band.lower, 1 - band.upper])
    ends = (reach < 0.999 * span) & (reach > 0)
    bend = radius * material.mu / (2 * material.k) * jnp.minimum(slow, span)
    top = bernstein.evaluate(rest.breaks, rest.control, jnp.ones(()), 2)[1]
    sag = material.alpha * top**1.5 / material.k * rest.r0
    depth = jnp.maximum(2 * material.alpha * top / jnp.maximum(material.mu, 1e-9), fast[1])
    sags = jnp.stack([jnp.asarray(False), ~tool.top_fixed & (sag > _VISIBLE * tolerance)])

    def length(scale, size, share, order=5):
        """Of the first span."""
        finer = jnp.minimum(tolerance / jnp.maximum(size, tolerance), 1.0) ** (1 / order)
        return jnp.where(size > tolerance, share * scale * finer, jnp.inf)

    none = jnp.inf
    first = [
        length(fast, jump * fast / slow, _EDGE),
        length(slow, jump * (1 - fast / slow), _EDGE),
        jnp.where(ends, length(jnp.minimum(slow, span), bend, _REACH, 3), none),
        jnp.where(sags, length(depth, sag, _SAG), none),
        jnp.where(
            sags,
            length(fast, sag * fast / slow, _SAG),
            jnp.where(ends, none, length(fast, bend, _END)),
        ),
    ]
    fade = [_FADE * fast, _FADE * slow, _FALL * slow, _FADE * jnp.full(2, depth), _FADE * fast]
    nothing = jnp.zeros(2)
    distance = [nothing, nothing, jnp.where(ends, reach, 0.0), span, span]
    return mesh.Features(*(jnp.stack(leaf, axis=1) for leaf in (distance, first, fade)))


def _layers(squashed: Squashed) -> Array:
    """(2,) thickness of the layers at the band's edges."""
    rest = squashed.rest
    return _lengths(_edge_slopes(rest, squashed.band), rest.r0, squashed.material)[0]


def _edge_slopes(rest: Rest, band: Band) -> Array:
    """(2,) Y0_u at the band's edges."""
    at = jnp.stack([band.lower, band.upper])
    return bernstein.evaluate(rest.breaks, rest.control, at, 2)[1]


def _lengths(slope: Array, r0: Array, material: Material) -> tuple[Array, Array]:
    """Over what shares of the clay disturbances of Y_u decay, at rest slopes Y0_u: least, most.

    1/|q| of the solutions exp(q u) of the linearised equation
    k/s^2 y - (alpha r0^2/(2 s^3) + 2 beta) y'' + beta r0^2/(2 s^3) y'''' = 0; without
    smoothing a tenth of the clay.
    """
    bend = r0**2 / (2 * slope**3)
    a, c = material.k / slope**2, material.beta * bend
    b = material.alpha * bend + 2 * material.beta
    root = jnp.sqrt(jnp.maximum(b**2 - 4 * a * c, 0.0))
    twice = jnp.where(root > 0, b + root, 2 * jnp.sqrt(a * c))
    fast, slow = jnp.sqrt(2 * c / jnp.maximum(twice, 1e-300)), jnp.sqrt(twice / (2 * a))
    tension = jnp.sqrt(material.alpha * bend / a)
    without, bends = jnp.where(material.alpha > 0, tension, 0.1), material.beta > 0
    return jnp.where(bends, fast, without), jnp.where(bends, slow, without)
