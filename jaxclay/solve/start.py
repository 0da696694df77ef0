"""Initial guesses and warm starts: the rough shape, the caller's heights, or an answer close by."""

from __future__ import annotations

from typing import Any

import jax
import numpy as np

from jaxclay.methods.loop import Start, initial_guess
from jaxclay.numerics.arrays import Array, namespace
from jaxclay.numerics.host import is_transformed
from jaxclay.schemes.base import lifted
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.slices.density import layer_of
from jaxclay.schemes.sums import Displaced
from jaxclay.solve.solution import Solution


def start_of(problem: Problem, rough: Displaced, start: Any, method: str) -> Start:
    """What the caller gave as start, checked; else the rough shape, rounded for newton."""
    if start is None:
        return initial_guess(problem, rounded(problem, rough) if method == "newton" else rough)
    check_same_scheme(problem, start)
    if isinstance(start, Displaced):
        _check_one_each(problem, start.shift)
        return initial_guess(problem, start)
    if not isinstance(start, Solution):
        return initial_guess(problem, start_from(problem, start))
    if start.problem.slices != problem.slices:
        raise ValueError(
            f"start is an answer on {start.problem.slices} slices, but this clay has "
            f"{problem.slices}: give heights, or squash a clay of as many slices"
        )
    moved = jax.tree.map(lambda a, b, c: a + b - c, rough, start.point, start.rough.point)
    close = lifted(problem, problem.imposed(moved))
    return Start(close, start.forces, np.asarray(True))


def check_same_scheme(problem: Any, start: Any) -> None:
    """Raise where an answer or a displaced shape is of another scheme than the problem."""
    own = f'"{problem.scheme}"'
    if isinstance(start, Solution):
        what, theirs = "an answer", f'"{start.problem.scheme}"'
    elif hasattr(start, "coefficients"):
        what, theirs = "a displaced shape", '"spline"'
    elif isinstance(start, Displaced):
        what, theirs = (
            "a displaced shape",
            own if problem.scheme != "spline" else '"slices" or "paper"',
        )
    else:
        return
    if theirs != own:
        instead = (
            "coefficients, or no start"
            if problem.scheme == "spline"
            else "heights: start=answer.clay.height_at(problem.clay.material)"
        )
        raise ValueError(
            f"start is {what} on scheme {theirs}, but the problem is on scheme {own}: pose both on "
            f"the same scheme, or give {instead}"
        )


def rounded(problem: Problem, point: Displaced) -> Displaced:
    """A rough shape whose jumps of radius at the band's edges are rounded as smoothing will do.

    At the distance x from an edge the stretch changes by (1 - x / l) e^(-x / l) of what it jumps
    there, l the length of the layer: that moves nothing further away.
    """
    xp = namespace(point.shift, problem.band.lower)
    rest, band, m, n = problem.rest, problem.band, problem.material, problem.slices
    held, stretch = rest.held(band), point.thickness / rest.thickness
    middle, slope = (rest.material[1:] + rest.material[:-1]) / 2, rest.slopes()
    first, last = held.argmax(), n - held[::-1].argmax()
    smooth = (m.alpha > 0) | (m.beta > 0)

    def bump(edge: Array, inner: Array, outer: Array, side: Array) -> Array:
        inner, outer = (xp.clip(i, 0, n - 1) for i in (inner, outer))
        length = layer_of(slope[outer], rest.r0, m)
        x = abs(middle - edge) / length
        return (side & smooth) * (stretch[inner] - stretch[outer]) * (1 - x) * xp.exp(-x)

    below = bump(band.lower, first, first - 1, middle < band.lower)
    above = bump(band.upper, last - 1, last, middle > band.upper)
    size = problem.loose * rest.thickness
    below, above = (size * xp.maximum(b, -stretch / 2) for b in (below, above))
    none = xp.zeros(1)
    shift = point.shift + xp.concatenate([none, xp.cumsum(above)])
    shift -= xp.concatenate([xp.cumsum(below[::-1])[::-1], none])
    return lifted(
        problem, problem.imposed(Displaced(rest.thickness + shift[1:] - shift[:-1], shift))
    )


def start_from(problem: Problem, heights: Array) -> Displaced:
    """The caller's heights as a point that obeys the tool."""
    if not is_transformed(problem, heights):
        heights = np.asarray(heights, np.float64)
    _check_one_each(problem, heights)
    point = problem.imposed(problem.point(heights))
    if not is_transformed(problem, heights):
        if not np.isfinite(heights).all() or (np.diff(heights) <= 0).any():
            raise ValueError("start must be finite and increase from node to node")
        slack = problem.slack(point)
        if (slack < -1e-9 * problem.rest.thickness).any():
            i = int(np.argmin(slack / problem.rest.thickness))
            raise ValueError(
                f"start, with the band where the tool wants it, makes slice {i} "
                f"{point.thickness[i] / problem.rest.thickness[i]:.3g} times as thick as before: "
                f"at least {float(problem.material.floor):g} (material.floor) is allowed"
            )
    return point


def _check_one_each(problem: Problem, values: Array) -> None:
    if np.shape(values) != np.shape(problem.clay.heights):
        raise ValueError(
            f"start must hold one height for each of {problem.slices + 1} nodes: got shape "
            f"{np.shape(values)}"
        )
