"""How closely nodes shall lie: the density that slices have equal shares of.

It is the square root of |X_uu| + |Y_uu| (in u) of a contour, smoothed, with a floor.  Before a
squash has been solved that contour is the rest shape's, with layers e^(-distance / 2 l) at the
band's edges, l the length over which smoothing rounds a step: the larger of (beta c / k)^(1/4)
and (alpha c / k)^(1/2).  Afterwards it is an answer's, with some more slices at the clay's ends.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxclay.model.band import Band
from jaxclay.model.material import Material
from jaxclay.numerics.arrays import Array, namespace
from jaxclay.numerics.interpolation import Interpolant, last_before

_SMOOTHED = 1
_FLOOR = 0.15  # of the mean density
_AT_ENDS, _END = 0.05, 0.02  # what the clay's ends get of the slices, and how far they reach
_OF_SIDE = 0.1  # and at most of a side
_STRAINED, _MUCH = 0.1, 4.0  # share for changes of slope, where they add up to e^4
_UNDER = 0.1  # density under the tool before solving
_THINNEST_LAYER = 1e-3  # share of the clay
_STRAIGHT = 1e-2  # total of a density that is rounding, or matters to no contour


def bends(nodes: Array, thickness: Array, r0: Array, edges: Array) -> tuple[Array, Array]:
    """Middles of slices (n,) and the density there, broken at edges (m,) of bands, nodes.

    Lengths over l.
    """
    xp = namespace(nodes, thickness, r0, edges)
    middle = (nodes[1:] + nodes[:-1]) / 2
    Y_u = thickness / (nodes[1:] - nodes[:-1])
    X = r0 / Y_u**0.5
    stretch = xp.cumsum((nodes[:, None] == edges).any(axis=1))[:-1]
    same = stretch[1:] == stretch[:-1]
    apart = middle[1:] - middle[:-1]
    X_u, Y_uu = (X[1:] - X[:-1]) / apart, (Y_u[1:] - Y_u[:-1]) / apart
    turn = (apart[1:] + apart[:-1]) / 2
    inner = same[1:] & same[:-1]
    bend = inner * (abs(X_u[1:] - X_u[:-1]) / turn + abs(Y_uu[1:] + Y_uu[:-1]) / 2)
    # Beside an edge and at the ends the next slice of the same stretch speaks.
    none = xp.zeros(1)
    bend, seen = xp.concatenate([none, bend, none]), xp.concatenate([none > 0, inner, none > 0])
    take = same & seen[:-1] & ~seen[1:]
    bend = xp.concatenate([bend[:1], xp.where(take, bend[:-1], bend[1:])])
    seen = xp.concatenate([seen[:1], seen[1:] | take])
    take = same & seen[1:] & ~seen[:-1]
    bend = xp.concatenate([xp.where(take, bend[1:], bend[:-1]), bend[-1:]])
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
        near = xp.exp(-abs(u[:, None] - self.at) / self.length) @ (self.amount / self.length / 2)
        return self.even + xp.interp(u, self.middle, self.values) + near

    def integral(self, u: Array) -> Array:
        """Its integral from some place to u (m,), exact: so that nodes move smoothly."""
        xp = namespace(self, u)
        i = last_before(xp, self.middle[1:-1], u)
        x, y = self.middle, self.values
        at = xp.minimum(xp.maximum(u, x[0]), x[-1])
        slope = (y[1:] - y[:-1]) / (x[1:] - x[:-1])
        along = at - x[i]
        lines = self.below[i] + along * (y[i] + slope[i] * along / 2)
        beyond = xp.minimum(u - x[0], 0.0) * y[0] + xp.maximum(u - x[-1], 0.0) * y[-1]
        away = u[:, None] - self.at
        near = (xp.sign(away) * (1 - xp.exp(-abs(away) / self.length))) @ (self.amount / 2)
        return self.even * u + lines + beyond + near


def _density(even, middle, values, bent: float, at, length, amount, under=-1.0) -> Density:
    """Of straight lines scaled to the integral ``bent``, none where they are 0."""
    xp = namespace(middle, values, at, length, amount)
    parts = (middle[1:] - middle[:-1]) * (values[1:] + values[:-1]) / 2
    first = middle[:1] * values[:1]
    below = xp.concatenate([first, xp.cumsum(parts) + first])
    total = below[-1] + (1 - middle[-1]) * values[-1]
    matters = total > _STRAIGHT
    scale = xp.where(matters, bent / xp.where(matters, total, 1.0), 0.0)
    return Density(even, middle, scale * values, scale * below, at, length, amount, under)


def before_solving(
    rest: Interpolant, r0: Array, edges: Array, band: Band, layers: Array, material: Material
) -> Density:
    """The density of the rest shape, broken at its edges, and of ``layers`` (2,) at the band's."""
    xp = namespace(rest, r0, edges, band, layers, material)
    at = xp.stack([band.lower, band.upper])
    # A layer's sides decay over two lengths of it.
    half = xp.where((at > 0) & (at < 1), 0.5, 0.0)
    middle, values = bends(rest.nodes, rest.thickness, r0, edges)
    width = rest.nodes[1:] - rest.nodes[:-1]
    values = _kept(values, width, layer_of(rest.thickness / width, r0, material))
    return _density(_FLOOR, middle, values, 0.5, at, 2 * layers, half, _UNDER)


def _kept(values: Array, width: Array, layers: Array) -> Array:
    """The density (n,) of a rest shape, no closer than all its slices in one layer.

    What is closer will be smoothed away, and rounding would hide how soft such slices are.
    """
    return namespace(values, width, layers).minimum(values, (values * width).sum() / layers)


def layer_of(slope: Array, r0: Array, material: Material) -> Array:
    """Share of the clay over which smoothing rounds a step where Y0_u over l is ``slope``."""
    xp = namespace(slope, r0, material)
    c = (1 + r0**2 / (4 * slope**3)) * slope**2 / material.k
    # Guarded, since the square root has no derivative at 0.
    a, b = (xp.where(v > 0, v * c, 1.0) for v in (material.alpha, material.beta))
    la = xp.where(material.alpha > 0, a**0.5, 0.0)
    lb = xp.where(material.beta > 0, b**0.25, 0.0)
    return xp.clip(xp.maximum(la, lb), _THINNEST_LAYER, 1.0)


def after_solving(
    nodes: Array, thickness: Array, r0: Array, band: Band, rest_thickness: Array, material: Material
) -> Density:
    """The density of an answer's contour, and of the changes of slope that its strain comes from.

    The clay's ends are extrapolated over half a slice.
    """
    xp = namespace(nodes, thickness, r0, band, rest_thickness, material)
    width = nodes[1:] - nodes[:-1]
    middle, values = bends(nodes, thickness, r0, xp.stack([band.lower, band.upper]))
    changes = _changes(rest_thickness / width, width, r0, material)
    share = _STRAINED * (values * width).sum() / xp.maximum((changes * width).sum(), _MUCH)
    values = values + share * changes
    sides = xp.stack([band.lower, 1 - band.upper])
    reach = xp.where(sides > 0, xp.minimum(_END, _OF_SIDE * sides), _END)
    total, ends = 1 - _FLOOR - _AT_ENDS, xp.arange(2.0)
    return _density(_FLOOR, middle, values, total, ends, reach, _AT_ENDS * xp.ones(2))


def _changes(slope: Array, width: Array, r0: Array, material: Material) -> Array:
    """(n,) how fast the logarithm of the rest shape's slope changes, as far as a layer keeps it."""
    xp = namespace(slope, width, r0, material)
    change, none = abs(xp.diff(xp.log(slope))), xp.zeros(1)
    rate = xp.concatenate([none, change]) + xp.concatenate([change, none])
    return _kept(rate / (2 * width), width, layer_of(slope, r0, material))


def even() -> Density:
    """The density of slices that are equal on each stretch."""
    none, two = np.zeros(1), np.arange(2.0)
    return Density(1.0, two, 0 * two, 0 * two, none, none + 1, none, -1.0)
