"""Posing a squash on second-order slices: the band, the nodes, the problem on them.

On the host all of it is NumPy and nothing is compiled.  Inside a transformation the numbers of
slices below, under and above the tool are fixed by the call and the nodes move with the band's
edges, so that the contour can be differentiated by the tool's heights.
"""

from __future__ import annotations

import itertools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.clay.clay import Clay, on_nodes, unchecked_clay
from jaxclay.model.band import Band, Rest, Tool, imposed, sides, tool_of
from jaxclay.model.material import Material
from jaxclay.model.side import solve_sides
from jaxclay.model.squash import Squash
from jaxclay.numerics.arrays import Array, Float, namespace
from jaxclay.numerics.checks import check_whole
from jaxclay.numerics.host import as_compiled, as_float64, is_concrete
from jaxclay.numerics.interpolation import Interpolant
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.slices import density as densities
from jaxclay.schemes.slices import nodes as layout
from jaxclay.schemes.slices.locate import locate
from jaxclay.schemes.slices.weights import BandTerms, band_terms, sums_of

SPACINGS = ("placed", "equal")

_BEYOND = 0.25  # of the reach of the sliced cylinder model, beyond which clay is expected to rest
_LAYERS = 3.0  # and lengths over which smoothing rounds
_NOWHERE = (-1.0, 2.0)  # where clay rests below and above, if none is kept
_SHARES = (0.25, 0.125)  # of the slices, below and under the tool, where none can be counted


class Placed(NamedTuple):
    """A squash whose band has been found; ``clay`` is that before it, lengths inside over l.

    Attributes
    ----------
    rest : Interpolant
        Y0(u).
    layers : (2,) array
        Share of the clay over which smoothing rounds a step at each edge of the band.
    under : BandTerms
        What E_total has of the clay under the tool.
    """

    clay: Clay
    rest: Interpolant
    r0: Array
    tool: Tool
    material: Material
    band: Band
    layers: Float[Array, "2"]
    under: BandTerms


@as_compiled()
def place(clay: Clay, squash: Squash, material: Material, two_sided: Any = True) -> Placed:
    """Find the band; ``two_sided`` is False where it is known to begin at the bottom."""
    if is_concrete(clay, squash, material):
        squash, material = as_float64((squash, material))
        # As it is it knows its interpolant.
        clay = clay if namespace(clay) is np else as_float64(clay)
        two_sided = bool(squash.bottom > 0)
    else:
        clay, squash, material = jax.tree.map(jnp.asarray, (clay, squash, material))
    unit = clay.unit
    rest = clay.interpolant.over(unit)
    tool, r0 = tool_of(squash, unit), clay.r0 / unit**1.5
    band = locate(rest, r0, tool, material, two_sided)
    edges = namespace(band).stack([band.lower, band.upper])
    layers = densities.layer_of(rest.slope(edges), r0, material)
    return Placed(
        clay, rest, r0, tool, material, band, layers, band_terms(rest, r0, tool, material, band)
    )


def counted(slices: Any) -> tuple[int, tuple[int, int, int] | None]:
    """How many slices, and how many of them below, under and above the tool if that was said."""
    if isinstance(slices, tuple | list):
        if len(slices) != 3:
            raise ValueError(f"slices must be n, or (below, under, above) the tool, got {slices!r}")
        for count, name in zip(slices, ("below", "under", "above"), strict=True):
            # One slice between two prescribed nodes would have nothing free.
            none = count == 0 and name != "under" and not isinstance(count, bool)
            check_whole(f"slices {name} the tool", count, 0 if none else layout.IN_BAND)
        below, under, above = map(int, slices)
        return below + under + above, (below, under, above)
    check_whole("slices", slices, 3)
    return int(slices), None


@as_compiled()
def problem_of(found: Placed, nodes: Float[Array, "nodes"]) -> Problem:
    """The problem on nodes of which the band's edges are some."""
    clay, r0, band = found.clay, found.r0, found.band
    xp = namespace(found, nodes)
    unit = clay.unit
    on = on_nodes(clay, nodes)
    rest = Rest(on.thickness / unit, on.heights / unit, r0, nodes)
    held, fixed, shift = imposed(rest, found.tool, band)
    sums = sums_of(nodes, held)
    first, last = xp.argmax(held), held.shape[0] - 1 - xp.argmax(held[::-1])
    beside = xp.stack([sums.slices[first - 1], sums.slices[last - sums.slices.shape[0]]])
    there = xp.stack([first > 0, last < sums.slices.shape[0]])
    terms = found.under.with_half_cells(xp.where(there, beside, 0.0))
    bare = unchecked_clay(on.heights, on.thickness, clay.r0, unit, nodes)
    before = clay if xp is np or is_concrete(clay) else None
    return Problem(
        bare, rest, found.tool, found.material, band, fixed, shift, sums, terms,
        before=before, scheme="slices",
    )  # fmt: skip


def pose_traced(
    clay: Clay, squash: Squash, material: Material, slices: Any, spacing: str
) -> Problem:
    """The problem inside a transformation, its numbers of slices fixed by the call."""
    total, counts = counted(slices)
    plain = is_concrete(squash.bottom) and float(squash.bottom) == 0
    if counts is None:
        below = 0 if plain else max(layout.BESIDE, round(_SHARES[0] * total))
        under = max(layout.IN_BAND, round(_SHARES[1] * total))
        counts = (below, under, total - below - under)
    if counts[0] and plain:
        raise ValueError(f"slices={slices!r}: there is no clay below the tool, got {counts[0]}")
    if counts[2] < 1 or (not plain and counts[0] < 1):
        raise ValueError(
            f"slices={slices!r} leaves a side of the tool without slices: inside a transformation "
            f"use at least {layout.IN_BAND + 2 * layout.BESIDE}"
        )
    found = place(clay, squash, material, two_sided=counts[0] > 0)
    xp = namespace(found)
    band = found.band
    lower, upper = band.lower, band.upper
    # Without clay above the tool, or below it, the slices meant for that lie under it.
    share = counts[1] / (counts[1] + counts[2])
    end = xp.where(upper >= 1, lower + (1 - lower) * share, upper)
    begin = xp.where(lower <= 0, end * counts[0] / (counts[0] + counts[1]), lower)
    cuts = [0.0 * end, *([begin] if counts[0] else []), end, 1.0 + 0.0 * end]
    some = [count for count in counts if count]
    pieces = [layout.Stretch(*pair, 1) for pair in itertools.pairwise(cuts)]
    tool = len(some) - 2
    nodes = layout.spread(pieces, tool, some, total, _density(found, spacing), np.zeros(0))
    return problem_of(found, nodes)


def _density(found: Placed, spacing: str) -> densities.Density:
    if spacing == "equal":
        return densities.even()
    edges = found.clay.edges[:, 0]
    return densities.before_solving(
        found.rest, found.r0, edges, found.band, found.layers, found.material
    )


def pose_on_host(found: Placed, slices: Any, spacing: str, answer: Any = None) -> Problem:
    """The problem with nodes by the rest shape, or by an answer on fewer slices.

    Raises
    ------
    ValueError
        Too few slices for the sides that the band has, or counts that do not fit them.
    """
    total, counts = counted(slices)
    band = found.band
    least = layout.least_slices(band)
    if total < least:
        raise ValueError(
            f"{total} slices are too few: this squash needs {least}, {layout.IN_BAND} under the "
            f"tool and {layout.BESIDE} on each side that it has"
        )
    if counts is not None:
        return problem_of(found, _by_counts(found, counts, spacing))
    if spacing == "equal":
        density, rests, marks = densities.even(), _NOWHERE, np.zeros(0)
    elif answer is None:
        density, rests = _density(found, spacing), expected_rest(found)
        marks = _jumps(found.clay)
    else:
        nodes, thickness = answer.problem.rest.material, answer.point.thickness
        density = densities.after_solving(
            nodes, thickness, found.r0, band, answer.problem.rest.thickness, found.material
        )
        rests = found_rest(found, answer)
        marks = np.concatenate([_jumps(found.clay), _turns(answer)])
    pieces, tool = layout.stretches(found.clay, band, rests)
    if sum(piece.least for piece in pieces) > total:
        pieces, tool = layout.stretches(found.clay, band, _NOWHERE)
    return problem_of(found, layout.spread(pieces, tool, None, total, density, marks))


def _by_counts(found: Placed, counts: tuple[int, int, int], spacing: str) -> np.ndarray:
    pieces, tool = layout.stretches(found.clay, found.band, _NOWHERE)
    sides = (found.band.lower > 0, True, found.band.upper < 1)
    for count, there, name in zip(counts, sides, ("below", "under", "above"), strict=True):
        if bool(there) != (count > 0):
            has = "some" if there else "no"
            raise ValueError(f"slices={counts}: there is {has} clay {name} the tool, got {count}")
    wanted = [count for count in counts if count]
    density = _density(found, spacing)
    return layout.spread(pieces, tool, wanted, sum(counts), density, np.zeros(0))


def expected_rest(found: Placed) -> tuple[float, float]:
    """Material below and above which clay should rest, by the sliced cylinder model."""
    rest, band = found.rest, found.band
    slices = Rest(rest.thickness, rest.heights, found.r0, rest.nodes)
    below, above = solve_sides(sides(slices, found.tool, band), found.material)
    spare = (1 + _BEYOND) * np.array([below.reach, above.reach]) + _LAYERS * found.layers
    return float(band.lower - spare[0]), float(band.upper + spare[1])


def found_rest(found: Placed, answer: Any) -> tuple[float, float]:
    """Material below and above which clay rests in an answer, with a slice to spare."""
    u, moves = answer.problem.rest.material, np.asarray(answer.point.shift) != 0
    moving = np.flatnonzero(moves)
    if not len(moving):
        return float(found.band.lower), float(found.band.upper)
    low, high = max(moving[0] - 2, 0), min(moving[-1] + 2, len(u) - 1)
    return float(u[low]), float(u[high])


def _jumps(clay: Clay) -> np.ndarray:
    """Material where the radius jumps: edges of tools on clay without smoothing."""
    u, radius = clay.edges.T
    return u[:-1][(np.diff(u) == 0) & (np.diff(radius) != 0)]


def _turns(answer: Any) -> np.ndarray:
    """Material where the displacement of free clay changes sign, a lone resting node between."""
    u, d = answer.problem.rest.material, np.asarray(answer.point.shift)
    moving = np.flatnonzero(d)
    i, j = moving[:-1], moving[1:]
    free = ~np.asarray(answer.problem.fixed)
    turns = (d[i] * d[j] < 0) & (j - i <= 2) & free[i] & free[j]
    i, j = i[turns], j[turns]
    return u[i] + (u[j] - u[i]) * d[i] / (d[i] - d[j])
