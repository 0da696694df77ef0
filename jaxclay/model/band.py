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

from jaxclay.model.material import Material
from jaxclay.model.side import Side, edge_tension, move_energy, solve_sides
from jaxclay.model.squash import Squash
from jaxclay.numerics.arrays import Array, Bool, Float, Scalar, namespace
from jaxclay.numerics.roots import around_least, follow, sign_change

_ON_NODE = 1e-9  # in slices: how far beyond the band's edge a node still counts as on it
_LEAST = 1e-3  # of a slice: least clay below a band above the bottom


class Rest(NamedTuple):
    """The shape before the squash, lengths over the unit l.

    Attributes
    ----------
    thickness : (n,) array
    heights : (n+1,) array
    r0 : scalar
    material : (n+1,) array
        Nodes u_i; i/n on the paper's scheme.
    """

    thickness: Float[Array, "n"]
    heights: Float[Array, "n+1"]
    r0: Scalar
    material: Float[Array, "n+1"]

    @property
    def slices(self) -> int:
        """The number n of slices."""
        return self.thickness.shape[0]

    def material_at(self, height: Float[Array, "*at"]) -> Float[Array, "*at"]:
        """U0, the inverse of Y0."""
        return namespace(self, height).interp(height, self.heights, self.nodes())

    def height_at(self, material: Float[Array, "*at"]) -> Float[Array, "*at"]:
        """Y0(u)."""
        return namespace(self, material).interp(material, self.nodes(), self.heights)

    def slope_at(self, material: Float[Array, "*at"]) -> Float[Array, "*at"]:
        """Y0_u of the slice that holds u."""
        i = jnp.clip(jnp.floor(material * self.slices).astype(int), 0, self.slices - 1)
        return self.thickness[i] * self.slices

    def nodes(self) -> Float[Array, "{self.slices}+1"]:
        """(n+1,) u_i."""
        return self.material

    def slopes(self) -> Float[Array, "{self.slices}"]:
        """(n,) Y0_u on each slice."""
        return self.thickness / (self.material[1:] - self.material[:-1])

    def held(self, band: Band) -> Bool[Array, "{self.slices}+1"]:
        """(n+1,) whether each node belongs to the band."""
        margin = _ON_NODE / self.slices
        return (self.material >= band.lower - margin) & (self.material <= band.upper + margin)

    def least(self) -> Array:
        """Least share of the clay below a band above the bottom."""
        return _LEAST / self.slices

    def kinks(self, share: Array, low: Array, high: Array) -> Array:
        """Lower edges between which E_move of both sides is smooth, in order."""
        nodes = self.nodes()
        return jnp.sort(jnp.concatenate([nodes, nodes - share, low[None], high[None]]))

    def imposes(self, band: Band) -> Bool[Array, ""]:
        """Whether the band fixes two nodes, and so a radius."""
        return jnp.sum(self.held(band)) >= 2


class Tool(NamedTuple):
    """The squash, lengths over the unit l."""

    bottom: Scalar
    top: Scalar
    radius: Scalar
    top_fixed: Scalar


class Band(NamedTuple):
    """The material [lower, upper] that ends between the heights bottom and top.

    ``feasible`` is False where a held end leaves less room than the lower bound needs,
    where the band lies above the clay, or where it holds fewer than two nodes.
    """

    lower: Scalar
    upper: Scalar
    bottom: Scalar
    top: Scalar
    feasible: Scalar


def tool_of(squash: Squash, unit: Scalar) -> Tool:
    """The squash over l."""
    return Tool(squash.bottom / unit, squash.top / unit, squash.radius / unit, squash.top_fixed)


def sides(rest, tool: Tool, band: Band) -> tuple[Side, Side]:
    """The clay below and above the band, each seen from the band's edge."""
    xp = namespace(rest, tool, band)
    nodes = rest.nodes()
    slope = rest.slopes()
    down, up = xp.minimum(nodes, band.lower), xp.maximum(nodes, band.upper)
    below = Side(
        start=band.lower - down[1:],
        stop=band.lower - down[:-1],
        slope=slope,
        displacement=rest.height_at(band.lower) - band.bottom,
        held=xp.asarray(True),
        graded=xp.ones(()),
    )
    above = Side(
        start=up[:-1] - band.upper,
        stop=up[1:] - band.upper,
        slope=slope,
        displacement=band.top - rest.height_at(band.upper),
        held=xp.asarray(tool.top_fixed),
        graded=xp.ones(()),
    )
    return below, above


def imposed(rest, tool: Tool, band: Band) -> tuple[Array, Array, Array]:
    """(n+1,) nodes of the band, nodes whose height is prescribed, and their displacements."""
    xp = namespace(rest, tool, band)
    nodes, held = rest.nodes(), rest.held(band)
    index = xp.arange(nodes.shape[0])
    in_band = band.bottom + (rest.r0 / tool.radius) ** 2 * (nodes - band.lower)
    shift = xp.where(held & (index > 0), in_band - rest.heights, 0.0)
    ends = (index == 0) | ((index == index[-1]) & tool.top_fixed)
    return held, held | ends, shift


def locate_band(rest, tool: Tool, material: Material) -> Band:
    """The band of least E_move; ties go to the lower one.

    A free top that the band reaches is swallowed: the band takes all the clay
    above its lower edge and ends where that clay is used up.
    """
    height = rest.heights[-1]
    density = (tool.radius / rest.r0) ** 2
    # Below it no clay could fill the height under the band.
    at_bottom = tool.bottom <= rest.least() * height
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
    fits = material.floor * (height - rest.height_at(upper)) <= height - tool.top
    feasible = jnp.where(at_bottom, ~tool.top_fixed | fits, feasible)
    # On the host these are errors; inside a transformation nobody can raise them.
    possible = (tool.bottom < height) & (~tool.top_fixed | ((tool.top < height) & (share < 1)))
    band = Band(lower, upper, tool.bottom, top, feasible & possible)
    return band._replace(feasible=band.feasible & rest.imposes(band))


def _search_range(rest: Rest, tool: Tool, material: Material, share: Array):
    """Lower edges that push both sides the same way and leave both sides room."""
    height = rest.heights[-1]
    thinnest = tool.bottom / material.floor
    deepest = height - (height - tool.top) / material.floor
    marks = jnp.stack([tool.bottom, jnp.minimum(tool.top, height), thinnest, deepest])
    one, other, thin, deep = rest.material_at(marks)
    other = jnp.minimum(other - share, 1 - share)
    low, high = jnp.minimum(one, other), jnp.maximum(one, other)
    high = jnp.minimum(high, jnp.where(thinnest < height, thin, 1.0))
    held_low = deep - share
    low = jnp.where(tool.top_fixed & (deepest > 0), jnp.maximum(low, held_low), low)
    low = jnp.maximum(low, rest.least())
    feasible = (low <= high) | ~tool.top_fixed
    return low, jnp.maximum(high, low), feasible


def _cheapest(rest, tool, material, place, low, high):
    """The lower edge between low and high that takes the least E_move on both sides together."""

    def solved(lower):
        pair = sides(rest, tool, place(lower))
        return list(zip(pair, solve_sides(pair, material), strict=True))

    def energy(lower):
        return sum(move_energy(side, material, push) for side, push in solved(lower))

    def slope(lower):
        return _slope(rest, material, place, lower, solved(lower))

    kinks = rest.kinks(place(low).upper - low, low, high)
    energies = jax.vmap(energy)
    around = jax.lax.stop_gradient(around_least(energies, kinks, low, high))
    # A minimum may lie on a kink or beside it, and the best kink beside another than the least.
    beside = jax.vmap(lambda left, right: sign_change(slope, left, right))(around[:-1], around[1:])
    found = jnp.sort(jnp.concatenate([beside, around]))
    return follow(slope, jax.lax.stop_gradient(found[jnp.argmin(energies(found))]))


def _slope(rest, material, place, lower, pair) -> Array:
    """dE_move/d(lower edge): clay that joins one side leaves the other."""
    (below, push_below), (above, push_above) = pair
    tension_below = edge_tension(below, material, push_below, rest.slope_at(lower))
    upper = jnp.clip(place(lower).upper, 0.0, 1.0)
    tension_above = edge_tension(above, material, push_above, rest.slope_at(upper))
    return tension_above - tension_below
