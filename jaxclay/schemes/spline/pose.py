"""Posing a squash: the band, the mesh, what is prescribed at its ends, the rest shape's samples."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp

from jaxclay import bernstein
from jaxclay.band import Band, Tool, locate_band, sides
from jaxclay.clay import Array, Material
from jaxclay.energy import Samples, Terms, everywhere, integrate
from jaxclay.schemes.spline import bspline, mesh
from jaxclay.schemes.spline.problem import Rest, SplineProblem
from jaxclay.schemes.spline.space import GAUSS, Space, space
from jaxclay.schemes.sums import Point
from jaxclay.scm import RoughShape
from jaxclay.side import slope_change, solve_sides
from jaxclay.smooth_clay import SmoothClay

_PARTS, _SLICES = 4, 32  # slices of a piece, and in all, for the sliced cylinder model at least
_LEAST = 1e-6  # share of the clay below a band above the bottom
_CELLS = 8  # of the band, for its energy


class Sliced(NamedTuple):
    """The rest shape in slices of unequal share, exact at their boundaries.

    It stands in for :class:`jaxclay.band.Rest` where the sliced cylinder model is asked.
    """

    places: Array
    heights: Array
    rest: Rest

    @property
    def smooth(self) -> bool:
        """Whether E_move is smooth in the band's place."""
        return True

    @property
    def r0(self) -> Array:
        """sqrt(volume / pi)."""
        return self.rest.r0

    def nodes(self) -> Array:
        """(m+1,) the slices' boundaries."""
        return self.places

    def slopes(self) -> Array:
        """(m,) Y0_u on each slice, 1 where it is empty."""
        width = jnp.diff(self.places)
        return jnp.where(width > 0, jnp.diff(self.heights) / jnp.where(width > 0, width, 1.0), 1.0)

    def material_at(self, height: Array) -> Array:
        """U0, the inverse of Y0."""
        height = jnp.clip(height, 0.0, self.heights[-1])
        return bernstein.solve(self.rest.breaks, self.rest.control, height)

    def height_at(self, material: Array) -> Array:
        """Y0(u)."""
        return bernstein.evaluate(self.rest.breaks, self.rest.control, material, 1)[0]

    def slope_at(self, material: Array) -> Array:
        """Y0_u."""
        return bernstein.evaluate(self.rest.breaks, self.rest.control, material, 2)[1]

    def least(self) -> Array:
        """Least share of the clay below a band above the bottom."""
        return jnp.asarray(_LEAST)

    def imposes(self, band: Band) -> Array:
        """Whether the band holds any clay."""
        return band.upper > band.lower


class Squashed(NamedTuple):
    """A squash before there is a mesh."""

    clay: SmoothClay
    rest: Rest
    tool: Tool
    material: Material
    band: Band
    band_terms: Terms
    rough: RoughShape


class OnMesh(NamedTuple):
    """What a mesh adds to a squash; see :class:`SplineProblem`."""

    space: Space
    fixed: Array
    shift: Array
    slopes: Array


def located(clay: SmoothClay, tool: Tool, material: Material, sides: int) -> Squashed:
    """Find the band and the rough shape; the tool's lengths are over l.

    ``sides`` is 1 where the band is known to begin at the bottom.
    """
    unit = clay.unit
    rest = Rest(clay.breaks, clay.control / unit, clay.r0 / unit**1.5)
    slices = _sliced(rest)
    band = locate_band(slices, tool, material, sides)
    terms = _band_terms(rest, tool, material, band)
    rough = _rough(slices, tool, material, band, unit)
    return Squashed(clay, rest, tool, material, band, terms, rough)


def meshed(
    squashed: Squashed, inner: Array, breaks: Array | None, degree: int, sides: int
) -> SplineProblem:
    """The problem on inner knots (K,).

    Friction's cells meet at ``breaks`` (S,), from 0 to 1 in each span, halfway if not given.
    """
    return on_knots(squashed, mesh.knots(inner, squashed.band, degree, sides), breaks, degree)


def on_knots(squashed: Squashed, knots: Array, breaks: Array | None, degree: int) -> SplineProblem:
    """The problem on all knots."""
    return joined(squashed, on_mesh(squashed, knots, breaks, degree))


def joined(squashed: Squashed, mesh: OnMesh) -> SplineProblem:
    """The problem of both."""
    clay, rest, tool, material, band, terms, rough = squashed
    return SplineProblem(clay, rest, tool, material, band, *mesh, terms, rough)


def on_mesh(squashed: Squashed, knots: Array, breaks: Array | None, degree: int) -> OnMesh:
    """What all knots add; friction's cells meet at ``breaks``, as in :func:`meshed`."""
    rest, tool, material, band = squashed.rest, squashed.tool, squashed.material, squashed.band
    count = jnp.where(material.beta > 0, 3, jnp.where(material.alpha > 0, 2, 1))
    density = (rest.r0 / tool.radius) ** 2
    below = _edge(rest, band.lower, band.bottom, density, "left")
    above = _edge(rest, band.upper, band.top, density, "right")
    fixed, shift = mesh.conditions(knots, degree, band, count, below, above, tool.top_fixed)
    if breaks is None:
        breaks = jnp.full(knots.shape[0] - 2 * degree - 1, 0.5)
    splines = space(knots, degree, breaks)
    u = mesh.material(knots, degree, splines.places, band).reshape(-1)
    slopes = jnp.stack(bernstein.evaluate(rest.breaks, rest.control, u)[1:], axis=1)
    return OnMesh(splines, fixed, shift, slopes)


def parts(rest: Rest) -> int:
    """How many slices each piece of the rest shape is cut into for the sliced cylinder model."""
    return max(_PARTS, _SLICES // rest.control.shape[0])


def _sliced(rest: Rest) -> Sliced:
    """The rest shape, each piece cut into a few slices of equal share."""
    count = parts(rest)
    s = jnp.arange(count) / count
    width = jnp.diff(rest.breaks)
    places = (rest.breaks[:-1, None] + width[:, None] * s).reshape(-1)
    (heights,) = bernstein.in_piece(rest.control[:, None], width[:, None], s[None], 1)
    heights = jnp.concatenate([heights.reshape(-1), rest.control[-1:, -1]])
    return Sliced(jnp.concatenate([places, rest.breaks[-1:]]), heights, rest)


def _rough(slices: Sliced, tool: Tool, material: Material, band: Band, unit: Array) -> RoughShape:
    """E_move's minimum at the slices' boundaries."""
    below, above = sides(slices, tool, band)
    push_below, push_above = solve_sides((below, above), material)
    change_below = slope_change(below, material, push_below.sigma)
    change_above = slope_change(above, material, push_above.sigma)
    rises = jnp.where(push_above.case == 2, above.displacement + jnp.sum(change_above), 0.0)
    from_bottom = jnp.append(0.0, jnp.cumsum(change_below))
    from_top = rises - jnp.append(jnp.cumsum(change_above[::-1])[::-1], 0.0)
    shift = jnp.where(slices.places <= band.lower, from_bottom, from_top)
    density = (slices.r0 / tool.radius) ** 2
    held = (slices.places > band.lower) & (slices.places < band.upper)
    squashed = band.bottom + density * (slices.places - band.lower)
    shift = jnp.where(held, squashed - slices.heights, shift)
    return RoughShape(
        heights=(slices.heights + shift) * unit,
        nodes=slices.places,
        point=Point(jnp.diff(slices.heights + shift), shift),
        reach=band.upper + push_above.reach,
        reach_below=band.lower - push_below.reach,
        sigma=push_above.sigma,
        sigma_below=push_below.sigma,
        band=jnp.stack([band.lower, band.upper]),
        bottom=band.bottom * unit,
        top=band.top * unit,
        floored=push_below.floored | push_above.floored,
        feasible=band.feasible & push_below.feasible & push_above.feasible,
        case_code=push_above.case,
        case_below_code=push_below.case,
    )


def _edge(rest: Rest, at: Array, height: Array, density: Array, side: str) -> tuple[Array, ...]:
    """(w, w_u, w_uu) at an edge of the band, Y0 taken from outside the band."""
    breaks = rest.breaks
    i = jnp.searchsorted(breaks, at, side=side) - 1
    i = jnp.clip(i, 0, jnp.searchsorted(breaks, breaks[-1], side="left") - 1)
    width = breaks[i + 1] - breaks[i]
    y, y_u, y_uu = bernstein.in_piece(rest.control[i], width, (at - breaks[i]) / width, 3)
    return height - y, density - y_u, -y_uu


def _band_terms(rest: Rest, tool: Tool, material: Material, band: Band) -> Terms:
    """Energies of the clay under the tool, a cylinder of slope (r0/x0)^2, by Gauss points.

    Cells meet where the clay under the tool does not move, at which friction has a kink.
    """
    density = (rest.r0 / tool.radius) ** 2

    def shift(u):
        y = bernstein.evaluate(rest.breaks, rest.control, u, 1)[0]
        return band.bottom + density * (u - band.lower) - y

    edges = band.lower + (band.upper - band.lower) * jnp.arange(_CELLS + 1) / _CELLS
    d = shift(edges)
    turns = d[:-1] * d[1:] < 0
    root = edges[:-1] + jnp.diff(edges) * d[:-1] / jnp.where(turns, d[:-1] - d[1:], 1.0)
    edges = jnp.sort(jnp.concatenate([edges, jnp.where(turns, root, edges[:-1])]))
    s, weight = bspline.gauss_points(GAUSS)
    width = jnp.diff(edges)[:, None]
    u = (edges[:-1, None] + width * s).reshape(-1)
    slope = bernstein.evaluate(rest.breaks, rest.control, u, 2)[1]
    none = jnp.zeros_like(u)
    samples = Samples(
        density / slope, shift(u), density + none, none, none, none,
        everywhere((width * weight).reshape(-1)),
    )  # fmt: skip
    return integrate(samples, material)
