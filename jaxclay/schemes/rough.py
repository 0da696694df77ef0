"""Sliced cylinder model: the rough shape, E_move's minimum in closed form (eqs. 12-19)."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from jaxclay.clay import text
from jaxclay.clay.clay import Clay, unchecked_clay
from jaxclay.model.band import Band, sides
from jaxclay.model.side import Push, slope_change, solve_sides
from jaxclay.numerics.arrays import Array, Bool, Float, Int, namespace
from jaxclay.numerics.host import (
    as_compiled,
    as_float64,
    check_float64,
    is_concrete,
    is_transformed,
    promoting,
    pytree,
)
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.slices.edges import with_jumps
from jaxclay.schemes.sums import Displaced

_CASES = ("none", "I", "II", "III")


@pytree
@dataclasses.dataclass(frozen=True, eq=False)
class RoughShape:
    """The rough shape and what the closed form says of it (eqs. 10 to 19).

    Attributes
    ----------
    heights : (n+1,) array, length
        Y_i of the rough shape.
    nodes : (n+1,) array
        Material coordinates u_i of these heights; with the scheme "spline" the nodes of the
        answer's clay.
    point : Displaced
        The same over l, as solvers hold it.
    reach : float
        u1, the material coordinate beyond which the clay above the band rests
        (eq. 14); 1 where all of it moves.
    reach_below : float
        The same below the band, mirrored: clay at u < reach_below rests.
    sigma, sigma_below : float
        The push at the band's edges, no unit: beside an edge Y_u = (1 -+ sigma Y0_u) Y0_u.
    band : (2,) array
        The material [ua, ub] under the tool.
    bottom, top : float, length
        The effective band: heights of its first and last fixed node, since the
        tool's edges are quantised to nodes.
    floored : bool
        Whether the lower bound of thickness is active.
    feasible : bool
        False where a held end leaves less room than the lower bound needs.
    """

    heights: Float[Array, "nodes"]
    nodes: Float[Array, "nodes"]
    point: Displaced
    reach: Float[Array, ""]
    reach_below: Float[Array, ""]
    sigma: Float[Array, ""]
    sigma_below: Float[Array, ""]
    band: Float[Array, "2"]
    bottom: Float[Array, ""]
    top: Float[Array, ""]
    floored: Bool[Array, ""]
    feasible: Bool[Array, ""]
    case_code: Int[Array, ""]
    case_below_code: Int[Array, ""]

    def clay(self, before: Clay) -> Clay:
        """The rough shape as clay, given the clay before the squash."""
        thickness = self.point.thickness * before.unit
        shape = unchecked_clay(self.heights, thickness, before.r0, before.unit, self.nodes)
        exact = is_concrete(shape, self.band) and np.isin(self.band, shape.material).all()
        return with_jumps(shape, np.asarray(self.band)) if exact and not shape.equal else shape

    def __repr__(self) -> str:
        say = text.figure
        above, below = (text.named(c, _CASES) for c in (self.case_code, self.case_below_code))
        return text.lines(
            f"RoughShape: {text.size(self.point.thickness)}, "
            f"{text.flag(self.feasible, 'feasible', 'infeasible')}",
            f"band: bottom {say(self.bottom)}, top {say(self.top)}",
            f"above it: case {above}, reach u1 {say(self.reach, '.4g')}, "
            f"push {say(self.sigma, '.4g')}",
            f"below it: case {below}, reach u1 {say(self.reach_below, '.4g')}, "
            f"push {say(self.sigma_below, '.4g')}",
            f"lower bound active: {text.flag(self.floored)}",
        )

    @property
    def case(self) -> str:
        """The paper's case above the band: "I", "II", "III", or "none" without clay there."""
        return _CASES[int(self.case_code)]

    @property
    def case_below(self) -> str:
        """The same below the band, whose far end is always held."""
        return _CASES[int(self.case_below_code)]


@promoting
def rough_shape(problem: Any, discrete: bool = False) -> RoughShape:
    """The rough shape of a posed squash: E_move's minimum (eqs. 6, 12 to 19).

    Parameters
    ----------
    problem : Problem or SplineProblem
        From :func:`jaxclay.pose`.
    discrete : bool
        False: the continuum's minimiser at the nodes, as the paper has it, O(h)
        off the minimum of the sums.  True: the exact minimiser of the discrete
        E_move (eq. 6 by the sums of eq. 21) above the lower bound, on the paper's scheme only.

    Returns
    -------
    RoughShape
        Heights in the clay's length unit, case and reach.

    Raises
    ------
    ValueError
        ``discrete`` with the scheme "spline".
    TypeError
        Inside a JAX transformation while float64 is off.
    """
    if not isinstance(problem, Problem):
        if discrete:
            raise ValueError('discrete=True belongs to scheme "paper", not to "spline"')
        return problem.rough
    if is_transformed(problem):
        check_float64("rough_shape")
        return _describe(problem, *_solve(problem, discrete))
    with as_compiled():
        problem = as_float64(problem)
        return _describe(problem, *_solve(problem, discrete))


def rough_start(problem: Problem) -> tuple[Displaced, Bool[Array, ""]]:
    """Where solves start, and whether the squash is feasible: the rough shape, not described."""
    point, (below, above) = _solve(problem, discrete=False)
    return point, problem.band.feasible & below.feasible & above.feasible


def _solve(problem: Problem, discrete: bool) -> tuple[Displaced, tuple[Push, Push]]:
    xp = namespace(problem.shift, problem.band.lower)
    band = _node_band(problem) if discrete else problem.band
    below, above = sides(problem.rest, problem.tool, band)
    if discrete:
        below, above = (
            below._replace(graded=0.0 * below.graded),
            above._replace(graded=0.0 * above.graded),
        )
    push_below, push_above = solve_sides((below, above), problem.material)
    change_below = slope_change(below, problem.material, push_below.sigma)
    change_above = slope_change(above, problem.material, push_above.sigma)

    outside = below.width + above.width
    outside = outside / problem.sums.width
    inside = xp.maximum(1 - outside, 0.0) * problem.band_thickness
    rest_thickness = problem.rest.thickness * outside
    thickness = rest_thickness + change_below + change_above + inside
    # Displacements add up from the far ends, so that clay beyond the reach rests exactly.
    rises = xp.where(push_above.case == 2, above.displacement + xp.sum(change_above), 0.0)
    from_bottom = xp.concatenate([xp.zeros(1), xp.cumsum(change_below)])
    from_top = rises - xp.concatenate([xp.cumsum(change_above[::-1])[::-1], xp.zeros(1)])
    shift = xp.where(problem.rest.nodes() <= band.lower, from_bottom, from_top)
    shift = xp.where(problem.fixed, problem.shift, shift)
    # A node that counts as on the band's edge may lie a hair beside it.
    edge = problem.fixed[1:] != problem.fixed[:-1]
    thickness = xp.where(edge, problem.rest.thickness + xp.diff(shift), thickness)
    point = Displaced(xp.where(problem.banded, problem.band_thickness, thickness), shift)
    return point, (push_below, push_above)


def _node_band(problem: Problem) -> Band:
    """The band from its first to its last fixed node."""
    held = problem.rest.held(problem.band)
    first = held.argmax()
    last = problem.slices - held[::-1].argmax()
    nodes, heights = problem.rest.nodes(), problem.rest.heights + problem.shift
    return problem.band._replace(
        lower=nodes[first], upper=nodes[last], bottom=heights[first], top=heights[last]
    )


def _describe(problem: Problem, point: Displaced, pushes: tuple[Push, Push]) -> RoughShape:
    below, above = pushes
    band, nodes, unit = problem.band, _node_band(problem), problem.clay.unit
    return RoughShape(
        heights=problem.shape(point).heights,
        nodes=problem.rest.nodes(),
        point=point,
        reach=band.upper + above.reach,
        reach_below=band.lower - below.reach,
        sigma=above.sigma,
        sigma_below=below.sigma,
        band=namespace(band.lower).stack([band.lower, band.upper]),
        bottom=nodes.bottom * unit,
        top=nodes.top * unit,
        floored=below.floored | above.floored,
        feasible=band.feasible & below.feasible & above.feasible,
        case_code=above.case,
        case_below_code=below.case,
    )
