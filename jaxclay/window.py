"""Only the part that moves: solve in a window, check what rests outside, widen if need be.

A window of some of the slices is a problem of its own, with their part of the sums, whose
ends are held at rest.  Outside, clay rests as long as friction can balance the forces there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay._host import compiled, in_float64, is_transformed
from jaxclay.band import Rest
from jaxclay.certificate import Forces
from jaxclay.clay import Array, unchecked_clay
from jaxclay.loop import Outcome, Start
from jaxclay.problem import Problem
from jaxclay.schemes.sums import Point
from jaxclay.scm import RoughShape

Window = str | tuple[float, float] | None
_EDGE = 3  # nodes held at each cut: a term reaches over four nodes
_SPARE = 0.25  # of the rough shape's reach, solved beyond it
_SMALLEST = 64  # slices
_ON_NODE = 1e-6  # in slices


def minimize_in_window(
    problem: Problem, rough: RoughShape, window: Window, solve: Callable[[Problem, Piece], Outcome]
) -> Outcome | None:
    """The outcome in the narrowest window that holds all that moves.

    ``solve`` gives the outcome of a window's problem, told where it lies.  None
    once the window would be all of the clay.

    Raises
    ------
    ValueError
        The window is empty, reaches beyond the clay or leaves out part of the band.
    TypeError
        Inside a JAX transformation: a window's size depends on values.
    """
    if is_transformed(problem, rough):
        raise TypeError("window needs values, which jit, grad, vmap and scan do not have yet")
    n = problem.slices
    low, high = _wanted(problem, rough, window)
    while True:
        size = max(_SMALLEST, 1 << int(np.ceil(np.log2(high - low + 2 * _EDGE))))
        if size >= n:
            return None
        piece = Piece(int(np.clip((low + high - size) // 2, 0, n - size)), size)
        part = in_float64("minimize", _cut, problem, piece.first, size=size)
        outcome = solve(part, piece)
        whole, wider = in_float64("minimize", _put_back, problem, piece.first, outcome)
        if not wider.any():
            return whole
        low = max(piece.first - size // 2, 0) if wider[0] else low
        high = min(piece.first + size + size // 2, n) if wider[1] else high


class Piece(NamedTuple):
    """A window: ``size`` slices, a power of two, from slice ``first`` on."""

    first: int
    size: int

    def of(self, values: Array, nodes: int = 0) -> Array:
        """The window's part of values of all slices, or of all nodes if ``nodes`` is 1."""
        return values[self.first : self.first + self.size + nodes]

    def start(self, start: Start) -> Start:
        """The window's part of a start."""
        (thickness, shift), (friction, floor), near = start
        point = Point(self.of(thickness), self.of(shift, 1))
        return Start(point, Forces(self.of(friction, 1), self.of(floor)), near)


def _wanted(problem: Problem, rough: RoughShape, window: Window) -> tuple[int, int]:
    """First and last node that the window should hold."""
    n, u = problem.slices, problem.rest.material
    band = np.interp([problem.band.lower, problem.band.upper], u, np.arange(n + 1))
    if isinstance(window, str):
        if window != "auto":
            raise ValueError(f"window must be 'auto' or (bottom, top), got {window!r}")
        spare = _SPARE * float(rough.reach - rough.reach_below)
        ends = float(rough.reach_below) - spare, float(rough.reach) + spare
        low, high = np.interp(ends, u, np.arange(n + 1))
        return int(low), int(np.ceil(high))
    bottom, top = _numbers(window)
    height = float(problem.clay.height)
    if not 0 <= bottom < top <= height:
        raise ValueError(
            f"window ({bottom:g}, {top:g}) must lie within the clay, 0 <= bottom < top <= "
            f"{height:g}, its height before the squash"
        )
    low, high = np.interp([bottom, top], problem.clay.heights, np.arange(n + 1))
    if low > band[0] + _ON_NODE or high < band[1] - _ON_NODE:
        held = np.interp(band, np.arange(n + 1), problem.clay.heights)
        raise ValueError(
            f"window ({bottom:g}, {top:g}) must hold the clay under the tool, "
            f"from {held[0]:g} to {held[1]:g} before the squash"
        )
    return int(low), min(int(np.ceil(high)), n)


def _numbers(window: Any) -> tuple[float, float]:
    try:
        bottom, top = (float(value) for value in window)
    except (TypeError, ValueError):
        raise ValueError(f"window must be 'auto' or (bottom, top), got {window!r}") from None
    return bottom, top


@compiled("size")
def _cut(problem: Problem, first: Array, *, size: int) -> Problem:
    """The window as a problem of its own."""
    n, first = problem.slices, jnp.asarray(first, int)

    def cut(values: Array, more: int = 0) -> Array:
        return jax.lax.dynamic_slice(values, (first,), (size + more,))

    rest, clay = problem.rest, problem.clay
    held_below, held_above = first > 0, first + size < n
    node = jnp.arange(size + 1)
    held = (held_below & (node < _EDGE)) | (held_above & (node > size - _EDGE))
    return dataclasses.replace(
        problem,
        clay=unchecked_clay(
            cut(clay.heights, 1), cut(clay.thickness), clay.r0, clay.unit, cut(clay.material, 1)
        ),
        rest=Rest(cut(rest.thickness), cut(rest.heights, 1), rest.r0, cut(rest.material, 1)),
        tool=problem.tool._replace(top_fixed=problem.tool.top_fixed | held_above),
        fixed=cut(problem.fixed, 1) | held,
        shift=cut(problem.shift, 1),
        sums=problem.sums.cut(first, size),
    )


@compiled()
def _put_back(problem: Problem, first: Array, part: Outcome) -> tuple[Outcome, Array]:
    """The window's outcome within the whole clay; whether it is too narrow (below, above)."""
    n, size = problem.slices, part.point.thickness.shape[0]
    first = jnp.asarray(first, int)

    def within(whole: Array, piece: Array) -> Array:
        return jax.lax.dynamic_update_slice(whole, piece, (first,))

    point = Point(
        within(problem.rest.thickness, part.point.thickness),
        within(jnp.zeros(n + 1), part.point.shift),
    )
    g, limit = problem.system.gradient(point), problem.friction_limit
    node = jnp.arange(n + 1)
    below = (first > 0) & (node < first + _EDGE)
    above = (first + size < n) & (node > first + size - _EDGE)
    balance = jnp.clip(-g, -limit, limit)
    friction = within(balance, part.forces.friction)
    forces = Forces(
        jnp.where(below | above, balance, friction),
        within(jnp.zeros(n), part.forces.floor),
    )
    moves = problem.free & (jnp.abs(g) > limit)
    wider = jnp.stack([jnp.any(moves & below), jnp.any(moves & above)])
    return part._replace(point=point, forces=forces), wider
