"""Both sides of a band on the smooth rest shape, for bands at many places at once.

The sliced cylinder model of :mod:`jaxclay.model.side` with integrals of u^j Y0_u^2 over cubic
pieces, exact, in place of sums over slices of constant slope: a side displaced by d is pushed by
sigma at the band's edge and to the reach r, where with m_j the integral of x^j Y0_u^2 from the edge
to r

    D = sigma m_0 - mu/k m_1 = |d|,    sigma = mu/k r while r lies within the side.

D is convex in r, so Newton's method from beyond its root comes down to it.  Where the thickness
floor binds on a side, :mod:`jaxclay.model.side` answers for it on the slices' own slopes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import numpy as np

from jaxclay.model.band import Tool
from jaxclay.model.material import Material
from jaxclay.model.side import Side, edge_tension, move_energy, solve_side
from jaxclay.numerics.arrays import Array, Float, fixed, namespace, repeat
from jaxclay.numerics.interpolation import Interpolant
from jaxclay.schemes.slices.moments import Moments

_WAY = np.array([[-1.0], [1.0]])  # that the sides reach, below and above
_MARKS = 65  # nodes that a first guess is told from, at most
_NEWTON = 40
_NEARLY = 1e-7  # of the reach, that the last but one of the steps changes
_ROUGHLY = 1e-4  # the same where the search only looks around
_SHORT = 1e-3  # of the clay: a shorter reach is as exact as this one, since D is rounded


class Sides(NamedTuple):
    """Both sides for bands at m places, leading axis below and above.

    Attributes
    ----------
    energy : (2, m) array or None
        E_move, None where it was not asked for.
    tension : (2, m) array
        What E_move falls by as the edge passes clay on to the side, its height staying put.
    """

    energy: Any
    tension: Float[Array, "2 m"]


class _FromEdge(NamedTuple):
    """Integrals of x^j Y0_u^2, x the distance from the edges (2, m); ``base``: those from 0."""

    table: Moments
    edge: Array
    base: Array

    def integrals(self, upto: Array) -> tuple[Array, Array, Array]:
        """j = 0, 1 and 2, given the integrals of u^j Y0_u^2 from 0."""
        c, edge = upto - self.base, self.edge
        return _WAY * c[0], c[1] - edge * c[0], _WAY * (c[2] - 2 * edge * c[1] + edge**2 * c[0])

    def whole(self) -> tuple[Array, Array, Array]:
        """To the ends of the clay."""
        last = self.table.sums[:, -1]
        return self.integrals(namespace(last).stack([0 * last, last], axis=1)[:, :, None])

    def upto(self, reach: Array) -> Array:
        """The integrals of u^j Y0_u^2 from 0 to where clay moves."""
        xp = namespace(self.edge, reach)
        return self.table.upto(xp.clip(self.edge + _WAY * reach, 0.0, 1.0))

    def displaced(self, reach: Array) -> tuple[Array, Array]:
        """D over mu/k where the push falls to 0 at the reach, and its derivative."""
        c = self.upto(reach) - self.base
        m0 = _WAY * c[0]
        return reach * m0 - (c[1] - self.edge * c[0]), m0


def both_sides(
    table: Moments, tool: Tool, material: Material, share: Array, lower: Array, around: bool = True
) -> Sides:
    """E_move and edge tension of both sides for lower edges (m,), the band ``share`` of the clay.

    On the host the tension is exact, without the energy, where it is not for looking ``around``.
    """
    xp = namespace(table, tool, material, lower, share)
    rest, k, mu, rate = table.rest, material.k, material.mu, material.mu / material.k
    upper = xp.minimum(lower + share, 1.0)
    edge, span = xp.stack([lower, upper]), xp.stack([lower, 1 - upper])
    held = xp.stack([lower >= 0, xp.asarray(tool.top_fixed) & (upper <= 1)])
    height = rest.height(edge)
    d = xp.stack([height[0] - tool.bottom, tool.top - height[1]])
    size, sign = abs(d), xp.sign(d)
    beside = _FromEdge(table, edge, table.upto(edge))
    m0, m1, _ = beside.whole()
    most = rate * (span * m0 - m1)
    inside = (size < most) & (size > 0)
    wanted = size / xp.where(rate > 0, rate, 1.0)
    reach = _reach(beside, wanted, inside, (span, span * m0 - m1), _ROUGHLY if around else _NEARLY)
    more = (size - most) / xp.where(m0 > 0, m0, 1.0)
    sigma = xp.where(inside, rate * reach, rate * span + xp.where(held, more, 0.0))
    sigma = xp.where((size > 0) & (span > 0), sigma, 0.0)
    slope = xp.stack([rest.slope(lower, "below"), rest.slope(upper)])
    stretch = 1 - sign * sigma * slope
    tension = -stretch * slope * sign * k * sigma
    tension -= k / 2 * (stretch - 1) ** 2 + mu * size
    energy = None
    if around:
        m0, m1, m2 = beside.integrals(beside.upto(reach))
        moved = sigma * m0 - rate * m1
        energy = k / 2 * (sigma**2 * m0 - 2 * sigma * rate * m1 + rate**2 * m2)
        energy += mu * (xp.maximum(size - moved, 0.0) * span + sigma * m1 - rate * m2)
    return _floored(rest, material, Sides(energy, tension), edge, d, held, sigma)


def _reach(beside: _FromEdge, wanted: Array, inside: Array, end: tuple[Array, Array], near: float):
    """The reach r where D over mu/k is ``wanted``, ``inside`` the side, else all of it.

    ``end``: r and D over mu/k at the end of the clay.
    """
    xp, span = namespace(beside, wanted), end[0]
    reach = xp.where(inside, _guess(beside, wanted, end), span)

    def newton(reach):
        value, growth = beside.displaced(reach)
        step = (value - wanted) / xp.where(inside & (growth > 0), growth, 1.0)
        return xp.where(inside, xp.clip(reach - step, 0.0, span), reach)

    def changes(reach, new, share):
        return abs(new - reach) > share * (new + _SHORT)

    def nearly(reach):
        new = newton(reach)
        return xp.where(changes(reach, new, _NEARLY), new, reach)

    if xp is not np:
        # One step makes it exact, two carry its derivatives.
        return newton(fixed(newton(fixed(repeat(_NEWTON, nearly, fixed(reach))))))
    for _ in range(_NEWTON):
        before, reach = reach, newton(reach)
        if not changes(before, reach, near).any():
            break
    return reach


def _guess(beside: _FromEdge, wanted: Array, end: tuple[Array, Array]) -> Array:
    """The same, told from some of the nodes: between two of them D is taken as quadratic."""
    table, edge, base = beside
    xp = namespace(table, edge, wanted)
    every = -(-table.rest.nodes.shape[0] // _MARKS)
    span, most = end
    at, base, sought = edge[..., None], base[..., None], wanted[..., None]
    reach = _WAY[..., None] * (table.rest.nodes[::every] - at)
    first = table.sums[:2, None, None, ::every] - base[:2]
    grown = _WAY[..., None] * first[0]
    value = reach * grown - first[1] + at * first[0]
    under, over = ((reach > 0) & side for side in (value < sought, value >= sought))
    r, m, low = (xp.max(xp.where(under, each, 0.0), axis=-1) for each in (reach, grown, value))
    end = xp.min(xp.where(over, reach, span[..., None]), axis=-1)
    high = xp.min(xp.where(over, value, most[..., None]), axis=-1)
    width = xp.where(end > r, end - r, 1.0)
    bend = 2 * xp.maximum(high - low - m * width, 0.0) / width**2
    left = xp.maximum(wanted - low, 0.0)
    root = m + xp.sqrt(m**2 + 2 * bend * left)
    return xp.minimum(r + 2 * left / xp.where(root > 0, root, 1.0), end)


def _floored(rest: Interpolant, material: Material, free: Sides, edge, d, held, sigma) -> Sides:
    """The same where no slice may be thinner than the floor allows."""
    xp = namespace(rest, material, free.tension, edge, d, held, sigma)
    binds = (d > 0) & (sigma * rest.steepest > 1 - material.floor)
    if xp is np and not binds.any():
        return free
    mean = rest.thickness / (rest.nodes[1:] - rest.nodes[:-1])

    def answer(way, at, d, held):
        away = xp.maximum(way[..., None] * (rest.nodes - at[..., None]), 0.0)
        low, high = away[..., :-1], away[..., 1:]
        side = Side(xp.minimum(low, high), xp.maximum(low, high), mean, d, held, xp.ones(()))
        push = solve_side(side, material)
        return move_energy(side, material, push), edge_tension(side, material, push, rest.slope(at))

    way, held = (xp.broadcast_to(each, d.shape) for each in (_WAY, held))
    if xp is np:
        floored = answer(way[binds], edge[binds], d[binds], held[binds])
        for all_of_them, new in zip(free, floored, strict=True):
            if all_of_them is not None:
                all_of_them[binds] = new
        return free

    def every():
        floored = answer(way, edge, d, held)
        return tuple(xp.where(binds, a, b) for a, b in zip(floored, free, strict=True))

    return Sides(*jax.lax.cond(xp.any(binds), every, lambda: tuple(free)))
