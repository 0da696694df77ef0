"""As many slices as a tolerance needs: the paper's scheme on finer and finer grids.

The scheme is of first order in h = 1/n (Richardson 1911: the difference between
two grids tells the error), but the error jumps from grid to grid because nodes
hold the band.  On a free side the contour meets the tool not at the band's edge
u_e but at

    s = (a + theta) h

before it, theta h being the way from u_e back to the last node that the band
holds.  Differences of X across the band's edge impose X = x0 half a slice early
(a = 1/2) and, where there is bending, X_u = 0 too, a whole slice early (a = 1).
The error is in proportion to s, not to h: measured over the random scenes, the
ratio of estimate to error so has the median 1.0, where in proportion to h
differences between grids may vanish.  On grids that are multiples of each other
s falls by h/2 at least.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np

from jaxclay._host import is_transformed
from jaxclay.band import Band
from jaxclay.clay import Clay, Material
from jaxclay.contour import contour_error
from jaxclay.conversion import as_smooth, cut
from jaxclay.minimize import minimize
from jaxclay.posing import pose
from jaxclay.problem import Problem
from jaxclay.resolution import resolvable_slices
from jaxclay.smooth_clay import SmoothClay
from jaxclay.solution import Solution, Status
from jaxclay.squash import Squash

_COARSEST = 64
_IN_BAND = 4  # slices in the band that a first grid should have
_MOST = 65_536
_MOST_BY_OTHERS = 1024  # methods that do not go from coarse to fine
_STRIDES = (2, 4)  # powers of two, so that one compilation serves many scenes
_SAFETY = 1.5  # estimates over what the differences say
_ON_NODE = 1e-9  # in slices, as in the band


class _Grid(NamedTuple):
    """An answer and the estimate of its contour's error over l."""

    problem: Problem
    solution: Solution
    error: float

    @property
    def slices(self) -> int:
        return self.problem.slices


def deform_on_slices(
    clay: Clay | SmoothClay,
    squash: Squash,
    material: Material,
    method: str,
    tolerance: float,
    settings: dict[str, Any],
) -> Solution:
    """Squash the clay on as many slices as bring the contour within ``tolerance``.

    Parameters
    ----------
    clay : Clay or SmoothClay
        Slices are cut anew from the function through their heights.
    squash, material, method, settings
        As :func:`jaxclay.pose` and :func:`jaxclay.minimize` take them.
    tolerance : float
        Of the contour's distance from that of infinitely many slices, over l.

    Returns
    -------
    Solution
        The finest grid's, with ``error_estimate`` and, in ``levels``, the iterations
        on each grid before.  Where the tolerance would take more slices than float64
        resolves, than 65,536 (1024 for methods other than ``newton``) or than the
        method converges on, the grid of the least estimate, with status UNRESOLVED.
        Where the method converges on no two grids, its answer as it ended, without
        an estimate.

    Raises
    ------
    ValueError
        What :func:`jaxclay.pose` and :func:`jaxclay.minimize` raise.
    TypeError
        Inside a JAX transformation, where values cannot choose a size.
    """
    if is_transformed(clay, squash, material):
        raise TypeError(
            'slices="auto" chooses a size by values, which jit, grad, vmap and scan do not allow: '
            "give a number of slices there"
        )
    smooth = as_smooth(clay) if isinstance(clay, Clay) else clay

    def posed(slices: int) -> Problem:
        problem = pose(cut(smooth, slices), squash, material, "paper")
        assert isinstance(problem, Problem)
        return problem

    slices, limit = _first_grid(posed, smooth, squash, method)
    grids: list[_Grid] = []
    while True:
        problem = posed(slices)
        solution = minimize(problem, method, **settings)
        if solution.status is Status.CONVERGED:
            grids.append(_Grid(problem, solution, _estimated(grids, problem, solution.clay)))
        elif len(grids) < 2:
            return solution
        else:
            limit = slices // 2  # a shorter stride may do
        if grids[-1].error <= tolerance:
            return _answer(grids, grids[-1])
        slices = _next_slices(grids, tolerance, limit)
        if slices is None:
            best = _answer(grids, min(grids, key=lambda grid: grid.error))
            return dataclasses.replace(best, status_code=np.array(Status.UNRESOLVED.value))


def _first_grid(posed, clay: SmoothClay, squash: Squash, method: str) -> tuple[int, int]:
    """Slices of the first grid, of which the band has some, and the most there may be."""
    share = float(squash.radius) ** 2 * float(squash.top - squash.bottom) / float(clay.r0) ** 2
    if squash.bottom < clay.height:
        share = min(share, 1 - float(clay.material_at(squash.bottom)))
    doublings = math.ceil(math.log2(max(_IN_BAND / max(share, 1 / _MOST) / _COARSEST, 1.0)))
    most = _MOST if method == "newton" else _MOST_BY_OTHERS
    slices = min(_COARSEST * 2**doublings, most // 2)
    limit = min(most, resolvable_slices(posed(slices)))
    return min(slices, max(limit // 2, 3)), limit


def _estimated(grids: list[_Grid], problem: Problem, clay: Clay | SmoothClay) -> float:
    """The error by the difference from the finest grid before of which this is a multiple."""
    coarser = [grid for grid in grids if problem.slices % grid.slices == 0]
    if not coarser:
        return math.inf
    near, far = _early(problem, problem.slices), _early(problem, coarser[-1].slices)
    difference = contour_error(coarser[-1].solution.clay, clay)
    return _SAFETY * difference * float(np.max(near / (far - near), initial=0.0))


def _early(problem: Problem, slices: int) -> np.ndarray:
    """s of each free side: how much clay before the band's edge the contour meets the tool."""
    band: Band = problem.band
    lower, upper = float(band.lower) * slices, float(band.upper) * slices
    before = []
    if lower > 0:
        before.append(math.ceil(lower - _ON_NODE) - lower)
    if upper < slices:
        before.append(upper - math.floor(upper + _ON_NODE))
    a = 1.0 if problem.material.beta > 0 else 0.5
    return (a + np.array(before)) / slices


def _next_slices(grids: list[_Grid], tolerance: float, limit: int) -> int | None:
    """The next grid: where the tolerance should be met, or a long stride nearer to that."""
    last = grids[-1]
    slices = None
    for stride in _STRIDES:
        if stride * last.slices > limit:
            break
        slices = stride * last.slices
        now, then = (_early(last.problem, n) for n in (last.slices, slices))
        if math.isinf(last.error) or last.error * np.max(then / now, initial=0.0) <= tolerance:
            break
    if slices is None and len(grids) > 1:
        # The last grid before the limit is a multiple of the last but one.
        step = grids[-2].slices
        slices = limit // step * step
    return slices if slices is not None and slices > last.slices else None


def _answer(grids: list[_Grid], chosen: _Grid) -> Solution:
    """The chosen grid's answer, with its estimate and the iterations on the grids before."""
    before = [grid.solution for grid in grids if grid.slices < chosen.slices]
    levels = [int(s.levels.sum() + s.iterations) for s in before]
    return dataclasses.replace(
        chosen.solution,
        error_estimate=np.array(chosen.error),
        levels=np.concatenate([np.array(levels, int), chosen.solution.levels]),
    )
