"""Which clay the tool's band holds: eqs. 10, 11, and for a band above the bottom.

The band [bottom, top] of radius x0 holds the volume fraction
w = (x0 / r0)^2 (top - bottom).  With bottom = 0 it is the material [0, w].
Above, the paper solves both sides "independently" and does not say which
material [ua, ua + w] it is; here the one that needs the least E_move on both
sides together.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxclay.clay import Array, Material
from jaxclay.side import Side, edge_tension, move_energy, solve_sides

_ON_NODE = 1e-9  # in slices: how far beyond the band's edge a node still counts as on it
_LEAST = 1e-3  # of a slice: least clay below a band above the bottom
_CUTS = 40
_BESIDE = 4  # kinks to either side of the least that are looked at closely
_SCANNED = 160  # places at once


class Rest(NamedTuple):
    """The shape before the squash, lengths over the unit l.

    Attributes
    ----------
    thickness : (n,) array
    heights : (n+1,) array
    r0 : scalar
    """

    thickness: Array
    heights: Array
    r0: Array

    @property
    def slices(self) -> int:
        """The number n of slices."""
        return self.thickness.shape[0]

    def material_at(self, height: Array) -> Array:
        """U0, the inverse of Y0."""
        return jnp.interp(height, self.heights, self.nodes())

    def height_at(self, material: Array) -> Array:
        """Y0(u)."""
        return jnp.interp(material, self.nodes(), self.heights)

    def slope_at(self, material: Array) -> Array:
        """Y0_u of the slice that holds u."""
        i = jnp.clip(jnp.floor(material * self.slices).astype(int), 0, self.slices - 1)
        return self.thickness[i] * self.slices

    def nodes(self) -> Array:
        """(n+1,) u_i = i h."""
        return jnp.arange(self.slices + 1) / self.slices


class Tool(NamedTuple):
    """The squash, lengths over the unit l."""

    bottom: Array
    top: Array
    radius: Array
    top_fixed: Array


class Band(NamedTuple):
    """The material [lower, upper] that ends between the heights bottom and top.

    ``feasible`` is False where a held end leaves less room than the floor needs,
    where the band lies above the clay, or where it holds fewer than two nodes.
    """

    lower: Array
    upper: Array
    bottom: Array
    top: Array
    feasible: Array

    def holds(self, slices: int) -> Array:
        """(n+1,) whether each node belongs to the band."""
        nodes = jnp.arange(slices + 1) / slices
        slack = _ON_NODE / slices
        return (nodes >= self.lower - slack) & (nodes <= self.upper + slack)


def sides(rest: Rest, tool: Tool, band: Band) -> tuple[Side, Side]:
    """The clay below and above the band, each seen from the band's edge."""
    nodes = rest.nodes()
    slope = rest.thickness * rest.slices
    down, up = jnp.minimum(nodes, band.lower), jnp.maximum(nodes, band.upper)
    below = Side(
        start=band.lower - down[1:],
        stop=band.lower - down[:-1],
        slope=slope,
        displacement=rest.height_at(band.lower) - band.bottom,
        held=jnp.asarray(True),
        graded=jnp.ones(()),
    )
    above = Side(
        start=up[:-1] - band.upper,
        stop=up[1:] - band.upper,
        slope=slope,
        displacement=band.top - rest.height_at(band.upper),
        held=jnp.asarray(tool.top_fixed),
        graded=jnp.ones(()),
    )
    return below, above


def locate_band(rest: Rest, tool: Tool, material: Material) -> Band:
    """The band of least E_move; ties go to the lower one.

    A free top that the band reaches is swallowed: the band takes all the clay
    above its lower edge and ends where that clay is used up.
    """
    height = rest.heights[-1]
    density = (tool.radius / rest.r0) ** 2
    # Below it no clay could fill the height under the band.
    at_bottom = tool.bottom <= _LEAST / rest.slices * height
    tool = tool._replace(bottom=jnp.where(at_bottom, 0.0, tool.bottom))
    share = density * (tool.top - tool.bottom)
    start = jnp.where(at_bottom, 0.0, rest.material_at(tool.bottom))
    swallows = (start + share >= 1) & ~tool.top_fixed
    low, high, feasible = _search_range(rest, tool, material, share)

    def place(lower):
        return Band(lower, lower + share, tool.bottom, tool.top, feasible)

    def search():
        return _cheapest(rest, tool, material, place, low, high)

    searches = ~at_bottom & ~swallows & feasible
    lower = jnp.where(searches, jax.lax.cond(searches, search, lambda: start), start)
    upper = jnp.where(swallows, 1.0, jnp.minimum(lower + share, 1.0))
    top = jnp.where(swallows, tool.bottom + (1 - lower) / density, tool.top)
    room = material.floor * (height - rest.height_at(upper)) <= height - tool.top
    feasible = jnp.where(at_bottom, ~tool.top_fixed | room, feasible)
    # On the host these are errors; inside a transformation nobody can raise them.
    possible = (tool.bottom < height) & (~tool.top_fixed | ((tool.top < height) & (share < 1)))
    band = Band(lower, upper, tool.bottom, top, feasible & possible)
    return band._replace(feasible=band.feasible & (jnp.sum(band.holds(rest.slices)) >= 2))


def _search_range(rest: Rest, tool: Tool, material: Material, share: Array):
    """Lower edges that push both sides the same way and leave both sides room."""
    height = rest.heights[-1]
    one = rest.material_at(tool.bottom)
    other = rest.material_at(jnp.minimum(tool.top, height)) - share
    other = jnp.minimum(other, 1 - share)
    low, high = jnp.minimum(one, other), jnp.maximum(one, other)
    thinnest = tool.bottom / material.floor
    high = jnp.minimum(high, jnp.where(thinnest < height, rest.material_at(thinnest), 1.0))
    deepest = height - (height - tool.top) / material.floor
    held_low = rest.material_at(deepest) - share
    low = jnp.where(tool.top_fixed & (deepest > 0), jnp.maximum(low, held_low), low)
    low = jnp.maximum(low, _LEAST / rest.slices)
    feasible = (low <= high) | ~tool.top_fixed
    return low, jnp.maximum(high, low), feasible


def _cheapest(rest, tool, material, place, low, high):
    """Scan the kinks of the summed E_move, then follow its slope beside the best one."""

    def solved(lower):
        pair = sides(rest, tool, place(lower))
        return list(zip(pair, solve_sides(pair, material), strict=True))

    def energy(lower):
        return sum(move_energy(side, material, push) for side, push in solved(lower))

    def slope(lower):
        (below, push_below), (above, push_above) = solved(lower)
        # Clay that joins one side leaves the other.
        tension_below = edge_tension(below, material, push_below, rest.slope_at(lower))
        upper = jnp.clip(place(lower).upper, 0.0, 1.0)
        tension_above = edge_tension(above, material, push_above, rest.slope_at(upper))
        return tension_above - tension_below

    nodes = rest.nodes()
    share = place(low).upper - low
    kinks = jnp.sort(jnp.concatenate([nodes, nodes - share, low[None], high[None]]))
    energies = jax.vmap(energy)
    around = jax.lax.stop_gradient(_around_least(energies, kinks, low, high))
    # A minimum may lie on a kink or beside it, and the best kink beside another than the least.
    beside = jax.vmap(lambda left, right: _sign_change(slope, left, right))(around[:-1], around[1:])
    found = jnp.sort(jnp.concatenate([beside, around]))
    return _follow(slope, jax.lax.stop_gradient(found[jnp.argmin(energies(found))]))


def _around_least(energies, places: Array, low: Array, high: Array) -> Array:
    """The place of least energy between low and high, and some before and after it.

    Many places are scanned in rounds, each between the neighbours of the last
    round's best: neighbouring kinks differ little where there are many.
    """
    first = jnp.searchsorted(places, low, side="left")
    last = jnp.searchsorted(places, high, side="right") - 1
    best, most = first, places.shape[0]
    while most > 1:
        index = first + jnp.arange(_SCANNED) * (last - first) // (_SCANNED - 1)
        best = index[jnp.argmin(energies(places[index]))]
        apart = -(-(last - first) // (_SCANNED - 1))
        first, last = jnp.maximum(first, best - apart), jnp.minimum(last, best + apart)
        most = 2 * -(-most // (_SCANNED - 1)) if most > _SCANNED else 1
    before = jnp.searchsorted(places, places[best], side="left") - jnp.arange(_BESIDE, 0, -1)
    after = jnp.searchsorted(places, places[best], side="right") + jnp.arange(_BESIDE)
    at = jnp.concatenate([before, best[None], after])
    return jnp.clip(places[jnp.clip(at, 0, places.shape[0] - 1)], low, high)


def _sign_change(slope, left: Array, right: Array) -> Array:
    """Where a rising function passes 0: false position, whose stale end is halved (Illinois)."""

    def cut(_, state):
        left, right, low, high, _ = state
        share = jnp.where(high > low, low / jnp.where(high > low, low - high, -1.0), 0.5)
        middle = left + jnp.where((share > 0) & (share < 1), share, 0.5) * (right - left)
        value = slope(middle)
        falls = value < 0
        return (
            jnp.where(falls, middle, left),
            jnp.where(falls, right, middle),
            jnp.where(falls, value, low / 2),
            jnp.where(falls, high / 2, value),
            middle,
        )

    state = left, right, slope(left), slope(right), left
    return jax.lax.fori_loop(0, _CUTS, cut, state)[-1]


def _follow(slope, root: Array) -> Array:
    """The root with its derivative, from the implicit function theorem; at a kink it stays."""
    value, rate = jax.jvp(slope, (root,), (jnp.ones_like(root),))
    rises = jax.lax.stop_gradient(rate) > 0
    steepness = jnp.where(rises, jax.lax.stop_gradient(rate), 1.0)
    change = (value - jax.lax.stop_gradient(value)) / steepness
    return root - jnp.where(rises, change, 0.0)
