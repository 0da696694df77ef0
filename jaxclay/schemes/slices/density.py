"""How closely nodes shall lie: the density that slices have equal shares of.

It is the square root of |X_uu| + |Y_uu| (in u) of a contour, smoothed, with a floor.  Before a
squash has been solved that contour is the rest shape's, with layers e^(-distance / 2 l) at the
band's edges, l the length over which smoothing rounds a step: the larger of (beta c / k)^(1/4)
and (alpha c / k)^(1/2).  Afterwards it is an answer's, with some more slices at the clay's ends.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxclay.arrays import namespace
from jaxclay.band import Band
from jaxclay.clay import Clay, Material

Array = Any

_SMOOTHED = 1
_FLOOR = 0.15  # of the mean density
_AT_ENDS, _END = 0.05, 0.02  # what the clay's ends get of the slices, and how far they reach
_UNDER = 0.1  # density under the tool before solving
_THINNEST_LAYER = 1e-3  # share of the clay
_STRAIGHT = 1e-2  # total of a density that is rounding, or matters to no contour


def bends(clay: Clay, edges: Array) -> tuple[Array, Array]:
    """Middles of slices (n,) and the density there, broken at edges (m,) of bands, nodes."""
    xp = namespace(clay, edges)
    middle = (clay.material[1:] + clay.material[:-1]) / 2
    X, Y_u = clay.radii, clay.thickness / (clay.material[1:] - clay.material[:-1])
    stretch = xp.cumsum(xp.any(clay.material[:, None] == edges, axis=1))[:-1]
    same = stretch[1:] == stretch[:-1]
    apart = middle[1:] - middle[:-1]
    X_u, Y_uu = ((v[1:] - v[:-1]) / apart for v in (X, Y_u))
    turn = (apart[1:] + apart[:-1]) / 2
    inner = same[1:] & same[:-1]
    bend = abs(X_u[1:] - X_u[:-1]) / turn + abs(Y_uu[1:] + Y_uu[:-1]) / 2
    bend = xp.where(inner, bend, 0.0) / clay.unit
    # Beside an edge and at the ends the next slice of the same stretch speaks.
    none = xp.zeros(1)
    bend = xp.concatenate([none, bend, none])
    seen = xp.concatenate([none > 0, inner, none > 0])
    for way in (1, -1):
        moved, there = xp.roll(bend, way), xp.roll(seen & True, way)
        fits = xp.concatenate([none > 0, same] if way == 1 else [same, none > 0])
        take = ~seen & there & fits
        bend, seen = xp.where(take, moved, bend), seen | take
    density = xp.sqrt(bend)
    for _ in range(_SMOOTHED):
        below = xp.concatenate([density[:1], xp.where(same, density[:-1], density[1:])])
        above = xp.concatenate([xp.where(same, density[1:], density[:-1]), density[-1:]])
        density = (below + 2 * density + above) / 4
    return middle, density


class Density(NamedTuple):
    """How closely nodes shall lie: even + straight lines + exponentials beside some places.

    Attributes
    ----------
    even : scalar
    middle, values : (n,) arrays
        The straight lines' corners, level beyond the first and the last.
    below : (n,) array
        Their integrals from 0 to the corners.
    at, length, amount : (m,) arrays
        amount / (2 length) e^(-|u - at| / length).
    under : scalar
        In place of all that, under the tool; negative where it is the same there.
    """

    even: Array
    middle: Array
    values: Array
    below: Array
    at: Array
    length: Array
    amount: Array
    under: float

    def value(self, u: Array) -> Array:
        """The density at u (m,)."""
        xp = namespace(self, u)
        near = xp.exp(-abs(u[:, None] - self.at) / self.length) * (self.amount / self.length / 2)
        return self.even + xp.interp(u, self.middle, self.values) + xp.sum(near, axis=1)

    def integral(self, u: Array) -> Array:
        """Its integral from some place to u (m,), exact: so that nodes move smoothly."""
        xp = namespace(self, u)
        last = self.middle.shape[0] - 1
        i = xp.sum(self.middle[1:last] <= u[:, None], axis=1)
        x, y = self.middle, self.values
        at = xp.clip(u, x[0], x[-1])
        slope = (y[i + 1] - y[i]) / (x[i + 1] - x[i])
        lines = self.below[i] + (at - x[i]) * (y[i] + slope * (at - x[i]) / 2)
        lines += xp.minimum(u - x[0], 0.0) * y[0] + xp.maximum(u - x[-1], 0.0) * y[-1]
        away = u[:, None] - self.at
        near = xp.sign(away) * (1 - xp.exp(-abs(away) / self.length)) * self.amount / 2
        return self.even * u + lines + xp.sum(near, axis=1)


def _density(even, middle: Array, values: Array, at, length, amount, under=-1.0) -> Density:
    """Of straight lines scaled to the integral ``amount[0]``, none where they are 0."""
    xp = namespace(middle, values, at, length)
    parts = (middle[1:] - middle[:-1]) * (values[1:] + values[:-1]) / 2
    below = xp.concatenate([middle[:1] * values[:1], xp.cumsum(parts) + middle[0] * values[0]])
    total = below[-1] + (1 - middle[-1]) * values[-1]
    bent = total > _STRAIGHT
    scale = xp.where(bent, amount[0] / xp.where(bent, total, 1.0), 0.0)
    return Density(
        even, middle, scale * values, scale * below, xp.stack(at), xp.stack(length),
        xp.stack(amount[1:]), under,
    )  # fmt: skip


def before_solving(clay: Clay, band: Band, material: Material) -> Density:
    """The density of the rest shape and of the layers that smoothing will make."""
    xp = namespace(clay, band, material)
    edges = [band.lower, band.upper]
    # A layer's sides decay over two lengths of it.
    length = [2 * layer(clay, edge, material) for edge in edges]
    half = [xp.where((edge > 0) & (edge < 1), 0.5, 0.0) for edge in edges]
    middle, values = bends(clay, clay.edges[:, 0])
    return _density(_FLOOR, middle, values, edges, length, [0.5, *half], _UNDER)


def layer(clay: Clay, edge: Array, material: Material) -> Array:
    """Share of the clay over which smoothing rounds a step at the band's edge."""
    unit = clay.unit
    return layer_of(clay.interpolant.slope(edge) / unit, clay.r0 / unit**1.5, material)


def layer_of(slope: Array, r0: Array, material: Material) -> Array:
    """The same where Y0_u over l is ``slope``."""
    xp = namespace(slope, r0, material)
    c = (1 + r0**2 / (4 * slope**3)) * slope**2 / material.k
    # Guarded, since the square root has no derivative at 0.
    a, b = (xp.where(v > 0, v * c, 1.0) for v in (material.alpha, material.beta))
    la = xp.where(material.alpha > 0, a**0.5, 0.0)
    lb = xp.where(material.beta > 0, b**0.25, 0.0)
    return xp.clip(xp.maximum(la, lb), _THINNEST_LAYER, 1.0)


def after_solving(answer: Clay, band: Band) -> Density:
    """The density of an answer's contour; its ends are extrapolated over half a slice."""
    xp = namespace(answer, band)
    middle, values = bends(answer, xp.stack([band.lower, band.upper]))
    ends, length = [xp.zeros(()), xp.ones(())], [_END + xp.zeros(())] * 2
    amount = [1 - _FLOOR - _AT_ENDS, *[_AT_ENDS + xp.zeros(())] * 2]
    return _density(_FLOOR, middle, values, ends, length, amount)


def even(clay: Clay) -> Density:
    """The density of slices that are equal on each stretch."""
    xp = namespace(clay)
    none = xp.zeros(1)
    two = xp.asarray([0.0, 1.0])
    return Density(1.0, two, 0 * two, 0 * two, none, none + 1, none, -1.0)
