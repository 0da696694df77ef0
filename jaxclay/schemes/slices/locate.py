"""Which clay the tool's band holds, on the smooth rest shape: the band of least E_move."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from jaxclay.model.band import Band, Tool
from jaxclay.model.material import Material
from jaxclay.numerics.arrays import Array, Float, fixed, namespace
from jaxclay.numerics.interpolation import Interpolant
from jaxclay.numerics.roots import follow
from jaxclay.schemes.slices.moments import Moments, moments
from jaxclay.schemes.slices.sides import both_sides

_LEAST = 1e-5  # share of the clay below a band above the bottom, and above one below the top
_PLACES_AT_ONCE = 33  # of the search
_ROUNDS = 7  # of the search where it is compiled
_MOST_LOOKS = 20
_CLOSER = 10.0 ** -np.arange(14)  # places about a root, as shares of the way to it
_EXACT = 1e-13  # share of the clay


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
    one, other, thin, deep = rest.inverse(xp.clip(marks, 0.0, height))
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
        both = both_sides(table, tool, material, share, lower)
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
        closely = lambda u: slope(both_sides(*still, u, around=False))  # noqa: E731
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
