"""Where a solve begins: the rough shape, the caller's heights, or an answer close by."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from jaxclay._host import is_transformed
from jaxclay.clay import Array
from jaxclay.loop import Start, cold
from jaxclay.methods.base import lifted
from jaxclay.problem import Problem
from jaxclay.schemes.sums import Point
from jaxclay.solution import Solution


def start_of(problem: Problem, rough: Point, start: Any) -> Start:
    """What the caller gave as start, checked; the rough shape's point if that is None."""
    if start is None:
        return cold(problem, rough)
    if isinstance(start, Point):
        return cold(problem, start)
    if not isinstance(start, Solution):
        return cold(problem, start_from(problem, start))
    if start.problem.slices != problem.slices:
        raise ValueError(
            f"start is an answer on {start.problem.slices} slices, but this clay has "
            f"{problem.slices}: give heights, or squash a clay of as many slices"
        )
    moved = jax.tree.map(lambda a, b, c: a + b - c, rough, start.point, start.rough.point)
    near = lifted(problem, problem.imposed(moved))
    return Start(near, start.forces, np.asarray(True))


def start_from(problem: Problem, heights: Array) -> Point:
    """The caller's heights as a point that obeys the tool."""
    if not is_transformed(problem, heights):
        heights = np.asarray(heights, np.float64)
    if np.shape(heights) != np.shape(problem.clay.heights):
        raise ValueError(
            f"start must hold one height for each of {problem.slices + 1} nodes: got shape "
            f"{np.shape(heights)}"
        )
    point = problem.imposed(problem.point(heights))
    if not is_transformed(problem, heights):
        if not np.isfinite(heights).all() or (np.diff(heights) <= 0).any():
            raise ValueError("start must be finite and increase from node to node")
        room = problem.slack(point)
        if (room < -1e-9 * problem.rest.thickness).any():
            i = int(np.argmin(room / problem.rest.thickness))
            raise ValueError(
                f"start, with the band where the tool wants it, makes slice {i} "
                f"{point.thickness[i] / problem.rest.thickness[i]:.3g} times as thick as before: "
                f"at least {float(problem.material.floor):g} (material.floor) is allowed"
            )
    return point
