"""Only the part that moves: solve in a window, check what rests outside, widen if need be.

A window of m of n slices is a piece of clay of its own, m/n of the whole, whose
ends are held at rest: with u' = u n/m, alpha (n/m)^2 and beta (n/m)^4 its energy
times m/n is what the window adds to the whole.  Outside, clay rests as long as
friction can balance the forces there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay import local
from jaxclay._host import compiled, in_float64, is_transformed
from jaxclay.band import Rest, Tool
from jaxclay.certificate import Forces
from jaxclay.clay import Array, unchecked_clay
from jaxclay.loop import Outcome
from jaxclay.problem import Problem
from jaxclay.schemes.paper import Point
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


def _wanted(problem: Problem, rough: RoughShape, window: Window) -> tuple[int, int]:
    """First and last node that the window should hold."""
    n = problem.slices
    band = np.array([problem.band.lower, problem.band.upper]) * n
    if isinstance(window, str):
        if window != "auto":
            raise ValueError(f"window must be 'auto' or (bottom, top), got {window!r}")
        spare = _SPARE * float(rough.reach - rough.reach_below) * n
        low, high = float(rough.reach_below) * n - spare, float(rough.reach) * n + spare
        return max(int(low), 0), min(int(np.ceil(high)), n)
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
    share = size / n
    slices = partial(jax.lax.dynamic_slice, start_indices=(first,), slice_sizes=(size,))
    nodes = partial(jax.lax.dynamic_slice, start_indices=(first,), slice_sizes=(size + 1,))
    rest, clay, tool, band = problem.rest, problem.clay, problem.tool, problem.band
    below, material = rest.heights[first], problem.material
    held_below, held_above = first > 0, first + size < n
    node = jnp.arange(size + 1)
    cut = (held_below & (node < _EDGE)) | (held_above & (node > size - _EDGE))
    piece = unchecked_clay(
        nodes(clay.heights) - clay.heights[first],
        slices(clay.thickness),
        clay.r0 * jnp.sqrt(share),
        clay.unit,
    )
    stiffer = {"alpha": material.alpha / share**2, "beta": material.beta / share**4}
    return Problem(
        clay=piece,
        rest=Rest(slices(rest.thickness), nodes(rest.heights) - below, rest.r0 * jnp.sqrt(share)),
        tool=Tool(tool.bottom - below, tool.top - below, tool.radius, tool.top_fixed | held_above),
        material=dataclasses.replace(material, **stiffer),
        band=band._replace(
            lower=(band.lower - first / n) / share,
            upper=(band.upper - first / n) / share,
            bottom=band.bottom - below,
            top=band.top - below,
        ),
        fixed=nodes(problem.fixed) | cut,
        shift=nodes(problem.shift),
    )


@compiled()
def _put_back(problem: Problem, first: Array, part: Outcome) -> tuple[Outcome, Array]:
    """The window's outcome within the whole clay; whether it is too narrow (below, above)."""
    n, size = problem.slices, part.point.thickness.shape[0]
    first, share = jnp.asarray(first, int), size / n

    def within(whole: Array, piece: Array) -> Array:
        return jax.lax.dynamic_update_slice(whole, piece, (first,))

    point = Point(
        within(problem.rest.thickness, part.point.thickness),
        within(jnp.zeros(n + 1), part.point.shift),
    )
    g, limit = local.gradient(problem, point), problem.friction_limit
    node = jnp.arange(n + 1)
    below = (first > 0) & (node < first + _EDGE)
    above = (first + size < n) & (node > first + size - _EDGE)
    balance = jnp.clip(-g, -limit, limit)
    friction = within(balance, share * part.forces.friction)
    forces = Forces(
        jnp.where(below | above, balance, friction),
        within(jnp.zeros(n), share * part.forces.floor),
    )
    moves = problem.free & (jnp.abs(g) > limit)
    wider = jnp.stack([jnp.any(moves & below), jnp.any(moves & above)])
    return part._replace(point=point, forces=forces), wider
