"""Coarse to fine: each grid starts from the answer on a grid half as fine.

What smoothing has to do takes many steps on a fine grid and few on a coarse
one; started from there, Newton's steps do not grow in number with the grid.
"""

from __future__ import annotations

import itertools
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.band import Band, Rest
from jaxclay.clay import Array, unchecked_clay
from jaxclay.loop import cold, run
from jaxclay.methods import METHODS
from jaxclay.methods.base import lifted
from jaxclay.posing import placed
from jaxclay.problem import Problem
from jaxclay.schemes.sums import Point
from jaxclay.scm import rough_shape

_ON_NODE = 1e-6  # in slices: how far beyond a node the band's edge still counts as on it
DIRECT = 256  # slices up to which the rough shape is near enough


def grids(slices: int) -> list[int]:
    """The grids before this one, coarse to fine; none up to DIRECT slices."""
    before: list[int] = []
    while slices > DIRECT:
        slices = -(-slices // 2)
        before.insert(0, slices)
    return before


def refined_start(problem: Problem, rough: Point, settings: Any, method: str, wanted: Array):
    """Where the coarser grids lead to, and the iterations on each of them (g,).

    The rough shape and zeros if it is not wanted; and where the rough shape is
    near enough, or the method gains nothing from a start close by.
    """
    direct = problem.scheme == "slices" or METHODS[method].resume is None
    sizes = [] if direct else grids(problem.slices)
    none = rough, jnp.zeros(len(sizes), int)

    def climb():
        chain = [problem]
        for slices in sizes[::-1]:
            chain.insert(0, coarsened(chain[0], slices))
        point, iterations = rough_shape(chain[0]).point, []
        for coarse, fine in itertools.pairwise(chain):
            outcome = run(coarse, cold(coarse, point), settings, jnp.asarray(True), method)
            point = prolonged(fine, coarse, outcome.point)
            iterations.append(outcome.iterations)
        usable = jnp.all(jnp.isfinite(point.thickness)) & jnp.all(jnp.isfinite(point.shift))
        return jax.tree.map(lambda a, b: jnp.where(usable, a, b), point, rough), iterations

    if not sizes:
        return none
    point, iterations = jax.lax.cond(wanted, climb, lambda: (rough, list(none[1])))
    return point, jnp.stack(iterations)


def coarsened(problem: Problem, slices: int) -> Problem:
    """The same squash on fewer slices, its band widened to the nodes around it."""
    rest, clay, band = problem.rest, problem.clay, problem.band
    heights = rest.height_at(jnp.arange(slices + 1) / slices)
    coarse = Rest(jnp.diff(heights), heights, rest.r0, jnp.arange(slices + 1) / slices)
    lower = jnp.floor(band.lower * slices + _ON_NODE) / slices
    upper = jnp.ceil(band.upper * slices - _ON_NODE) / slices
    density = (rest.r0 / problem.tool.radius) ** 2
    wider = Band(
        lower,
        upper,
        band.bottom + density * (lower - band.lower),
        band.top + density * (upper - band.upper),
        band.feasible,
    )
    scaled = unchecked_clay(heights * clay.unit, jnp.diff(heights) * clay.unit, clay.r0, clay.unit)
    return placed(scaled, coarse, problem.tool, problem.material, wider)


def prolonged(problem: Problem, coarse: Problem, point: Point) -> Point:
    """A coarse grid's answer on the problem's own grid: displacements by cubic interpolation."""
    n, m = problem.slices, coarse.slices
    place = np.arange(n + 1) * m / n
    cell = np.minimum(place.astype(int), m - 1)
    x = place - cell
    change = point.thickness - coarse.rest.thickness
    at_nodes = (jnp.pad(change, (1, 0), mode="edge") + jnp.pad(change, (0, 1), mode="edge")) / 2
    d, rise = point.shift[cell], change[cell]
    bend = x * (1 - x)
    shift = (
        d + x * rise + bend * ((1 - x) * (at_nodes[cell] - rise) - x * (at_nodes[cell + 1] - rise))
    )
    rests = (d == 0) & (point.shift[cell + 1] == 0)
    shift = jnp.where(rests, 0.0, shift)
    fine = Point(problem.rest.thickness + jnp.diff(shift), shift)
    return lifted(problem, problem.imposed(fine))
