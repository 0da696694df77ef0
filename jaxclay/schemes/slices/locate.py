"""Which clay the tool's band holds, on the smooth rest shape: the band of least E_move.

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

from jaxclay.model.band import Band, Tool
from jaxclay.model.material import Material
from jaxclay.model.side import Side, edge_tension, move_energy, solve_side
from jaxclay.numerics.arrays import Array, Float, clip, fixed, namespace, repeat
from jaxclay.numerics.interpolation import Interpolant
from jaxclay.numerics.roots import follow
from jaxclay.schemes.slices.moments import Moments, moments

_WAY = np.array([[-1.0], [1.0]])  # that the sides reach, below and above
_LEAST = 1e-5  # share of the clay below a band above the bottom, and above one below the top
_PLACES_AT_ONCE = 33  # of the search
_ROUNDS = 7  # of the search where it is compiled
_MOST_LOOKS = 20
_CLOSER = 10.0 ** -np.arange(14)  # places about a root, as shares of the way to it
_MARKS = 65  # nodes that a first guess is told from, at most
_NEWTON = 40
_NEARLY = 1e-7  # of the reach, that the last but one of the steps changes
_ROUGHLY = 1e-4  # the same where the search only looks around
_SHORT = 1e-3  # of the clay: a shorter reach is as exact as this one, since D is rounded
_EXACT = 1e-13  # share of the clay


class _Sides(NamedTuple):
    """Both sides for bands at many places, leading axis below and above."""

    energy: Array  # None where it was not asked for
    tension: Array


def _solve(
    table: Moments, tool: Tool, material: Material, share: Array, lower: Array, around: bool = True
) -> _Sides:
    """E_move and edge tension of both sides for lower edges (m,).

    On the host the tension is exact, without the energy, where it is not for looking ``around``.
    """
    xp = namespace(table, tool, material, lower, share)
    k, mu = material.k, material.mu
    upper = xp.minimum(lower + share, 1.0)
    edge = xp.stack([lower, upper])
    span = xp.stack([lower, 1 - upper])
    held = xp.stack([lower >= 0, xp.asarray(tool.top_fixed) & (upper <= 1)])
    height = table.rest.height(edge)
    d = xp.stack([height[0] - tool.bottom, tool.top - height[1]])
    size, sign, rate = abs(d), xp.sign(d), mu / k
    base = table.upto(edge)

    def integrals(upto):
        c = upto - base
        first = c[1] - edge * c[0]
        return _WAY * c[0], first, _WAY * (c[2] - 2 * edge * c[1] + edge**2 * c[0])

    def reached(reach):
        return table.upto(xp.minimum(xp.maximum(edge + _WAY * reach, 0.0), 1.0))

    def displaced(reach):
        c = reached(reach) - base
        m0, m1 = _WAY * c[0], c[1] - edge * c[0]
        return rate * (reach * m0 - m1), rate * m0

    # The integrals to the ends of the clay.
    whole = integrals(xp.stack([0 * table.sums[:, -1], table.sums[:, -1]], axis=1)[:, :, None])
    most = rate * (span * whole[0] - whole[1])
    inside = (size < most) & (size > 0)
    slope = xp.stack([table.rest.slope(lower, "below"), table.rest.slope(upper)])

    def newton(reach):
        value, growth = displaced(reach)
        step = (value - size) / xp.where(inside & (growth > 0), growth, 1.0)
        return xp.where(inside, xp.minimum(xp.maximum(reach - step, 0.0), span), reach)

    def changes(reach, new, share):
        return abs(new - reach) > share * (new + _SHORT)

    def nearly(reach):
        new = newton(reach)
        return xp.where(changes(reach, new, _NEARLY), new, reach)

    ends = span, whole[0], span * whole[0] - whole[1]
    guess = _guess(table, edge, base, size / xp.where(rate > 0, rate, 1.0), ends)
    reach = xp.where(inside, guess, span)
    if xp is np:
        for _ in range(_NEWTON):
            before, reach = reach, newton(reach)
            if not changes(before, reach, _ROUGHLY if around else _NEARLY).any():
                break
    else:
        # One step makes it exact, two carry its derivatives.
        reach = newton(fixed(newton(fixed(repeat(_NEWTON, nearly, fixed(reach))))))
    more = (size - most) / xp.where(whole[0] > 0, whole[0], 1.0)
    sigma = xp.where(inside, rate * reach, rate * span + xp.where(held, more, 0.0))
    sigma = xp.where((size > 0) & (span > 0), sigma, 0.0)
    stretch = 1 - sign * sigma * slope
    tension = -stretch * slope * sign * k * sigma
    tension -= k / 2 * (stretch - 1) ** 2 + mu * size
    energy: Any = None
    if around:
        m0, m1, m2 = integrals(reached(reach))
        moved = sigma * m0 - rate * m1
        energy = k / 2 * (sigma**2 * m0 - 2 * sigma * rate * m1 + rate**2 * m2)
        energy += mu * (xp.maximum(size - moved, 0.0) * span + sigma * m1 - rate * m2)
    return _floored(table.rest, material, _Sides(energy, tension), edge, d, held, sigma)


def _guess(table: Moments, edge, base, wanted, ends) -> Array:
    """The reach r where D = r m_0 - m_1 is ``wanted``, told from some of the nodes.

    Between two of them D is taken as quadratic; ``ends`` are r, m_0 and D at the end of the clay.
    """
    xp = namespace(table, edge, wanted)
    every = -(-table.rest.nodes.shape[0] // _MARKS)
    span, _, most = ends
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


def _floored(rest, material: Material, free: _Sides, edge, d, held, sigma) -> _Sides:
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

    return _Sides(*jax.lax.cond(xp.any(binds), every, lambda: tuple(free)))


def locate(rest: Interpolant, r0, tool: Tool, material: Material, two_sided: Any = True) -> Band:
    """The band of least E_move; ties go to the lower one.

    ``two_sided`` is False where the band is known to begin at the bottom.  A free top that the
    band reaches is swallowed: the band takes all the clay above its lower edge.
    """
    xp = namespace(rest, r0, tool, material)
    height = rest.heights[-1]
    density = (tool.radius / r0) ** 2
    at_bottom = tool.bottom <= rest.height(xp.asarray(_LEAST)) * two_sided
    tool = tool._replace(bottom=xp.where(at_bottom, 0.0, tool.bottom))
    share = density * (tool.top - tool.bottom)
    may_search = two_sided if xp is not np else not at_bottom
    lower, feasible = xp.zeros(()), xp.asarray(True)
    if may_search:
        lower, low, high, feasible = _range(rest, tool, material, share)
    swallows = (lower + share > 1 - _LEAST) & xp.logical_not(tool.top_fixed)
    if may_search:
        searches = xp.logical_not(at_bottom | swallows) & feasible & (tool.bottom < height)
        if xp is not np:
            found = _cheapest(moments(rest), tool, material, low, high, share)
            lower = xp.where(searches, found, lower)
        elif searches:
            lower = _cheapest(moments(rest), tool, material, low, high, share)
    upper = xp.where(swallows, 1.0, xp.minimum(lower + share, 1.0))
    top = xp.where(swallows, tool.bottom + (1 - lower) / density, tool.top)
    room = material.floor * (height - rest.height(upper)) <= height - tool.top
    feasible = xp.where(at_bottom, xp.logical_not(tool.top_fixed) | room, feasible)
    # On the host these are errors; inside a transformation nobody can raise them.
    possible = (tool.bottom < height) & (
        xp.logical_not(tool.top_fixed) | ((tool.top < height) & (share < 1))
    )
    return Band(lower, upper, tool.bottom, top, feasible & possible & (upper > lower))


def _range(rest: Interpolant, tool: Tool, material: Material, share):
    """The clay below the tool's bottom, and from where to where the band may begin.

    There it pushes both sides the same way and leaves both sides room, if that is feasible.
    """
    xp = namespace(rest, tool, material, share)
    height = rest.heights[-1]
    thinnest = tool.bottom / material.floor
    deepest = height - (height - tool.top) / material.floor
    marks = xp.stack([tool.bottom, xp.minimum(tool.top, height), thinnest, deepest])
    one, other, thin, deep = rest.inverse(clip(marks, 0.0, height))
    other = xp.minimum(other, 1 - _LEAST) - share
    low, high = xp.minimum(one, other), xp.maximum(one, other)
    high = xp.minimum(high, xp.where(thinnest < height, thin, 1.0))
    low = xp.where(tool.top_fixed & (deepest > 0), xp.maximum(low, deep - share), low)
    low = xp.maximum(low, _LEAST)
    feasible = (low <= high) | xp.logical_not(tool.top_fixed)
    return one, low, xp.maximum(high, low), feasible


def _cheapest(table: Moments, tool: Tool, material: Material, low, high, share):
    """The lower edge between low and high that takes the least E_move on both sides together.

    The first round goes by the energies, since there may be two minima, the others by the
    slopes, which locate a minimum more sharply: clay that joins one side leaves the other.
    """
    xp = namespace(table, tool, material, low, high, share)
    known = table, tool, material, share
    still = fixed(known)

    def look(lower, known=still):
        table, tool, material, share = known
        both = _solve(table, tool, material, share, lower)
        return both.energy[0] + both.energy[1], slope(both)

    def slope(both):
        return both.tension[1] - both.tension[0]

    last = _PLACES_AT_ONCE - 1
    lowest, highest = fixed((low, high))

    def spread(left, right):
        return left + (right - left) * xp.arange(last + 1) / last

    if xp is np:
        places = spread(low, high)
        energies, slopes = look(places)
        best = int(np.argmin(energies))
        closely = lambda u: slope(_solve(*still, u, around=False))  # noqa: E731
        return _sign_change(closely, places, slopes, max(best - 1, 0), best + 1)

    def narrow(turn, ends):
        left, right, _, _ = ends
        places = spread(left, right)
        energies, slopes = look(places)
        best = xp.argmin(energies)
        rising = xp.sum(xp.cumprod(slopes < 0))  # of the first place where energy rises
        first = xp.where(turn == 0, xp.maximum(best - 1, 0), xp.maximum(rising - 1, 0))
        after = xp.where(turn == 0, xp.minimum(best + 1, last), xp.minimum(rising, last))
        return places[first], places[after], slopes[first], slopes[after]

    # Compiled, the search is one loop, and Newton's steps finish it.
    ends = jax.lax.fori_loop(0, _ROUNDS, narrow, (lowest, highest, 0 * lowest, 0 * highest))
    left, right, falls, rises = fixed(ends)
    root = xp.where(falls >= 0, left, xp.where(rises <= 0, right, (left + right) / 2))
    found = follow(lambda u: look(u[None], known)[1][0], root, exactly=True)
    found = xp.where((falls <= 0) & (rises >= 0), found, root)
    found = xp.where((left == lowest) & (falls > 0), low, found)
    return xp.where((right == highest) & (rises < 0), high, found)


def _sign_change(
    slope, places: Float[Array, "m"], slopes: Float[Array, "m"], first: int, last: int
) -> Float[Array, ""]:
    """Where a rising function passes 0 from the first to the last of the places, else that end.

    The slopes given are rough.  What the four places nearest say is looked at along with places
    closer and closer to it: so one look brackets the root as narrowly as the one before told it.
    """
    for _ in range(_MOST_LOOKS):
        i = first + int(np.cumprod(slopes[first : last + 1] < 0).sum())  # where it rises
        if i == first or i > min(last, len(places) - 1):
            return places[min(i, len(places) - 1)]
        left, right = places[i - 1], places[i]
        root, error = _told(slopes[max(i - 2, 0) : i + 2], places[max(i - 2, 0) : i + 2])
        if not left <= root <= right:
            root, error = (
                (slopes[i] * left - slopes[i - 1] * right) / (slopes[i] - slopes[i - 1]),
                np.inf,
            )
        if min(error, right - left) <= _EXACT:
            break
        near = [root - (root - left) * _CLOSER, root + (right - root) * _CLOSER[::-1]]
        places = np.concatenate(near)
        slopes, first, last = slope(places), 0, len(places) - 1
    return np.asarray(root)


def _told(values: Float[Array, "k"], places: Float[Array, "k"]) -> tuple[float, float]:
    """Where values pass 0 by inverse interpolation (Neville), and how far lower degrees differ."""
    if not (np.diff(values) > 0).all():
        return np.nan, np.inf
    x, told, before = values.tolist(), places.tolist(), []
    for k in range(1, len(x)):
        before = told
        told = [
            (x[i + k] * told[i] - x[i] * told[i + 1]) / (x[i + k] - x[i]) for i in range(len(x) - k)
        ]
    return told[0], max(abs(told[0] - each) for each in before)
