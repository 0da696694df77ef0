"""Where a solve begins: the rough shape, the caller's heights, or an answer close by."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay._host import compiled, in_float64, is_concrete, is_transformed
from jaxclay.certificate import Forces
from jaxclay.clay import Array
from jaxclay.loop import Start
from jaxclay.methods.base import lifted
from jaxclay.problem import Problem
from jaxclay.refine import refined_start
from jaxclay.schemes.sums import Point
from jaxclay.solution import Solution
from jaxclay.window import Piece

ROUGH, HEIGHTS, NEAR = range(3)


class Begin(NamedTuple):
    """Where a solve begins.

    Attributes
    ----------
    kind : int
        ROUGH: the rough shape.  HEIGHTS: the point.  NEAR: the rough shape moved
        by the point, by which a minimum close by differed from its own rough
        shape, with the forces there.
    point : Point
    forces : Forces
    """

    kind: Array
    point: Point
    forces: Forces


def begin_from(problem: Problem, start: Array | Point | Solution | None) -> Begin:
    """What the caller gave as start, checked."""
    forces = Forces(np.zeros(problem.slices + 1), np.zeros(problem.slices))
    if start is None:
        return Begin(np.array(ROUGH), Point(forces.floor, forces.friction), forces)
    if isinstance(start, Point):
        return Begin(np.array(HEIGHTS), start, forces)
    if not isinstance(start, Solution):
        return Begin(np.array(HEIGHTS), start_from(problem, start), forces)
    if start.problem.slices != problem.slices:
        raise ValueError(
            f"start is an answer on {start.problem.slices} slices, but this clay has "
            f"{problem.slices}: give heights, or squash a clay of as many slices"
        )
    moved = jax.tree.map(lambda a, b: a - b, start.point, start.rough.point)
    return Begin(np.array(NEAR), moved, start.forces)


def within(piece: Piece, begin: Begin) -> Begin:
    """A beginning cut to a window."""
    (lam, z), (thickness, shift) = begin.forces, begin.point
    return Begin(
        begin.kind,
        Point(piece.of(thickness), piece.of(shift, 1)),
        Forces(piece.of(lam, 1), piece.of(z)),
    )


def first_start(problem, rough, begin, settings, method) -> tuple[Start, Array]:
    """The method's start, and the iterations on the coarser grids."""
    from_rough = begin.kind == ROUGH
    point, levels = refined_start(problem, rough, settings, method, wanted=from_rough)
    moved = jax.tree.map(jnp.add, rough, begin.point)
    near = lifted(problem, problem.imposed(moved))
    is_near = begin.kind == NEAR
    other = jax.tree.map(lambda a, b: jnp.where(is_near, a, b), near, begin.point)
    point = jax.tree.map(lambda a, b: jnp.where(from_rough, a, b), point, other)
    return Start(point, begin.forces, is_near), levels


def start_from(problem: Problem, heights: Array) -> Point:
    """The caller's heights as a point that obeys the tool."""
    if is_concrete(heights):
        heights = np.asarray(heights, np.float64)
    if np.shape(heights) != np.shape(problem.clay.heights):
        raise ValueError(
            f"start must hold one height for each of {problem.slices + 1} nodes: got shape "
            f"{np.shape(heights)}"
        )
    point, room = in_float64("minimize", _imposed, problem, heights)
    if is_concrete(problem, heights) and not is_transformed(point):
        if not np.isfinite(heights).all() or (np.diff(heights) <= 0).any():
            raise ValueError("start must be finite and increase from node to node")
        if (room < -1e-9 * problem.rest.thickness).any():
            i = int(np.argmin(room / problem.rest.thickness))
            raise ValueError(
                f"start, with the band where the tool wants it, makes slice {i} "
                f"{point.thickness[i] / problem.rest.thickness[i]:.3g} times as thick as before: "
                f"at least {float(problem.material.floor):g} (material.floor) is allowed"
            )
    return point


@compiled()
def _imposed(problem: Problem, heights: Array) -> tuple[Point, Array]:
    point = problem.imposed(problem.point(heights))
    return point, problem.slack(point)
