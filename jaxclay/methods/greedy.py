"""``greedy`` and ``greedy-refined``: the paper's second stage (section 3-2).

In order over the free nodes, each Y_i moves by one step up or down if that
lowers E_total, to the lower of the two, in place, sweep after sweep, until
fewer nodes than the threshold move in a sweep.

A move of Y_i changes and reads nothing beyond Y_{i-3} .. Y_{i+3}, so sweep s+1
may visit node i as soon as sweep s has left node i+3.  Sweeps therefore run as
lanes, four nodes apart, all advanced by one vector operation: every visit sees
what it would see in plain order, and the moves are the same one by one.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxclay.methods.base import Method, State, check_setting
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.host import is_concrete, pytree
from jaxclay.schemes import sums
from jaxclay.schemes.base import no_forces
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.sums import Displaced

_APART = 4  # nodes between lanes: one more than the reach of a move
_BLOCK = 512  # sweeps started before their ends are looked at


@pytree
@dataclasses.dataclass(frozen=True)
class GreedySettings:
    """The paper names neither step nor threshold.

    Attributes
    ----------
    max_iterations : most sweeps
    step : how far a node moves, over the unit l
    threshold : a sweep that moves fewer nodes is the last
    """

    max_iterations: Array = 20_000
    step: Array = 1e-3
    threshold: Array = 1

    def __post_init__(self):
        if is_concrete(self):
            check_setting("max_iterations", self.max_iterations, 1)
            check_setting("step", self.step, 1e-12, 1.0)
            check_setting("threshold", self.threshold, 1)


@pytree
@dataclasses.dataclass(frozen=True)
class RefinedSettings:
    """As greedy's; whenever greedy would stop, the step halves, down to smallest_step."""

    max_iterations: Array = 20_000
    step: Array = 1e-2
    smallest_step: Array = 1e-7
    threshold: Array = 1

    def __post_init__(self):
        if is_concrete(self):
            check_setting("max_iterations", self.max_iterations, 1)
            check_setting("step", self.step, 1e-12, 1.0)
            check_setting("smallest_step", self.smallest_step, 1e-12, float(self.step))
            check_setting("threshold", self.threshold, 1)


def _init(problem: Problem, start: Displaced, settings) -> State:
    nothing_to_do = ~jnp.any(problem.free)
    step = jnp.asarray(settings.step)
    return State(start, no_forces(problem), jnp.asarray(0), nothing_to_do, memory=step)


def _refined_step(problem: Problem, state: State, settings: RefinedSettings) -> State:
    state = _block(problem, state, settings)
    at_end = state.memory <= settings.smallest_step
    halved = jnp.maximum(state.memory / 2, settings.smallest_step)
    return state._replace(
        finished=state.finished & at_end, memory=jnp.where(state.finished, halved, state.memory)
    )


def _block(problem: Problem, state: State, settings) -> State:
    """Sweep until the threshold, the limit or the block's end."""
    most = jnp.minimum(_BLOCK, settings.max_iterations - state.iterations)
    point, done, stopped = _sweep(problem, state.point, state.memory, most, settings.threshold)
    # Lanes behind the last sweep have begun the next ones.  If it moved nothing, nor did they.
    point = jax.lax.cond(
        stopped & (settings.threshold > 1),
        lambda: _sweep(problem, state.point, state.memory, done, 0)[0],
        lambda: point,
    )
    return state._replace(point=point, iterations=state.iterations + done, finished=stopped)


class _Lanes(NamedTuple):
    """The clay laid out in columns of four slots, the node to visit in row 3.

    Each array is (4, m); slot (j, c) is followed by (j+1, c) and (3, c) by
    (0, c+1), cyclically.  Turning the layout by one slot moves every lane on.
    """

    thickness: Array
    radius: Array
    shift: Array
    rest: Array  # rest thickness
    exists: Array  # whether the slot holds a slice
    node: Array  # the slot's node, -1 for padding
    free: Array
    width: Array  # h_i, and the sums' weights and spacings, weights 0 where there are no terms
    slices: Array
    nodes: Array
    apart: Array
    between: Array
    turn: Array  # 1/c_i, 0 where there is no X_uu

    def turned(self) -> _Lanes:
        return _Lanes(*(jnp.stack([a[1], a[2], a[3], jnp.roll(a[0], -1)]) for a in self))


def _sweep(problem: Problem, point: Displaced, step, sweeps, threshold):
    """At most ``sweeps`` sweeps: the shape, how many were made, whether the threshold ended it."""
    n = problem.slices
    lanes = _lay_out(problem, point)

    def visit(carry):
        time, lanes, moves, done, stopped = carry
        lane_sweep = (time - lanes.node[3]) // _APART
        running = (lanes.node[3] >= 0) & (lane_sweep >= 0) & (lane_sweep < sweeps)
        lanes, moved = _visit(problem, lanes, step, running)
        moves = jnp.where(lanes.node[3] == 0, 0, moves) + moved
        ends = running & (lanes.node[3] == n)
        stopped = stopped | jnp.any(ends & (moves < threshold))
        return time + 1, lanes.turned(), moves, done + jnp.sum(ends), stopped

    def go_on(carry):
        _, _, _, done, stopped = carry
        return (done < sweeps) & ~stopped

    moves = jnp.zeros(lanes.node.shape[1], int)
    carry = (jnp.asarray(0), lanes, moves, jnp.asarray(0), jnp.asarray(False))
    _, lanes, _, done, stopped = jax.lax.while_loop(go_on, visit, carry)
    return _gather(lanes, n), done, stopped


def _lay_out(problem: Problem, point: Displaced) -> _Lanes:
    n, w = problem.slices, problem.sums
    slots = -(-(n + 1 + _APART) // _APART) * _APART

    def lay(values, padding):
        padded = jnp.full(slots, padding, values.dtype).at[: values.shape[0]].set(values)
        return jnp.roll(padded, _APART - 1).reshape(-1, _APART).T

    return _Lanes(
        thickness=lay(point.thickness, 1.0),
        radius=lay(sums.radii(problem.rest, problem.sums, point.thickness), 0.0),
        shift=lay(point.shift, 0.0),
        rest=lay(problem.rest.thickness, 1.0),
        exists=lay(jnp.ones(n), 0.0),
        node=lay(jnp.arange(n + 1), -1),
        free=lay(problem.free, False),
        width=lay(w.width, 1.0),
        slices=lay(w.slices, 0.0),
        nodes=lay(w.nodes, 0.0),
        apart=lay(w.apart, 1.0),
        between=lay(w.between, 0.0),
        turn=lay(jnp.pad(1 / w.turn, 1), 0.0),
    )


def _gather(lanes: _Lanes, n: int) -> Displaced:
    nodes = lanes.node.T.reshape(-1)
    place = jnp.argsort(jnp.where(nodes < 0, n + 1, nodes))
    return Displaced(
        lanes.thickness.T.reshape(-1)[place[:n]], lanes.shift.T.reshape(-1)[place[: n + 1]]
    )


def _visit(problem: Problem, lanes: _Lanes, step, running) -> tuple[_Lanes, Array]:
    """Move the node in row 3 of each running lane if that lowers the energy."""
    r0, floor = problem.rest.r0, problem.material.floor
    t = _window(lanes.thickness)[1:5]  # slices i-2 .. i+1
    X = _window(lanes.radius)  # slices i-3 .. i+2
    above = lanes.exists[3]  # 0 at the free upper end, which has no slice above
    delta = step * jnp.array([[1.0], [-1.0]])

    lower, upper = t[1] + delta, t[2] - delta
    allowed = (lower >= floor * lanes.rest[2]) & ((upper >= floor * lanes.rest[3]) | (above == 0))
    radius_lower = r0 / jnp.sqrt(jnp.where(allowed, lower, 1.0) / lanes.width[2])
    radius_upper = above * r0 / jnp.sqrt(jnp.where(allowed, upper, 1.0) / lanes.width[3])
    change = _energy_change(problem, lanes, t, X, delta, radius_lower - X[2], radius_upper - X[3])
    change = jnp.where(allowed, change, jnp.inf)

    up = change[0] <= change[1]
    moves = running & lanes.free[3] & (jnp.minimum(change[0], change[1]) < 0)
    by = jnp.where(moves, jnp.where(up, step, -step), 0.0)

    def pick(pair, old):
        return jnp.where(moves, jnp.where(up, pair[0], pair[1]), old)

    T, R, S = lanes.thickness, lanes.radius, lanes.shift
    moved = lanes._replace(
        thickness=jnp.stack([T[0], T[1], T[2] + by, T[3] - above * by]),
        radius=jnp.stack([R[0], R[1], pick(radius_lower, R[2]), pick(radius_upper, R[3])]),
        shift=jnp.stack([S[0], S[1], S[2], S[3] + by]),
    )
    return moved, moves


def _window(rows: Array) -> list[Array]:
    """Slots i-3 .. i+2 around the visited node i."""
    return [rows[0], rows[1], rows[2], rows[3], jnp.roll(rows[0], -1), jnp.roll(rows[1], -1)]


def _energy_change(problem, lanes, t, X, delta, lower_change, upper_change) -> Array:
    """Change of E_total (eq. 9) from the terms that Y_i touches, as differences of squares."""
    m = problem.material
    width, apart, turn = _window(lanes.width), _window(lanes.apart), _window(lanes.turn)
    between = [w / a**2 for w, a in zip(_window(lanes.between), apart, strict=True)]
    none = jnp.zeros_like(lower_change)
    dX = [none, none, lower_change, upper_change, none, none]
    slope = [t[j] / width[j + 1] for j in range(4)]
    dY_u = [none, delta / width[2], -delta / width[3], none]

    def grows(value, change):
        """(value + change)^2 - value^2, without cancellation."""
        return change * (2 * value + change)

    below, above = lanes.slices[2], lanes.slices[3]
    strain = below * grows(t[1] / lanes.rest[2] - 1, delta / lanes.rest[2])
    strain += above * grows(t[2] / lanes.rest[3] - 1, -delta / lanes.rest[3])
    friction = lanes.nodes[3] * (jnp.abs(lanes.shift[3] + delta) - jnp.abs(lanes.shift[3]))
    tension = below * grows(slope[1], dY_u[1]) + above * grows(slope[2], dY_u[2])
    for j in (1, 2, 3):
        tension += between[j] * grows(X[j + 1] - X[j], dX[j + 1] - dX[j])
    bending = none
    for j in (1, 2, 3):
        bending += between[j] * grows(slope[j] - slope[j - 1], dY_u[j] - dY_u[j - 1])
    for j in range(4):
        second = (X[j + 2] - X[j + 1]) / apart[j + 1] - (X[j + 1] - X[j]) / apart[j]
        change = (dX[j + 2] - dX[j + 1]) / apart[j + 1] - (dX[j + 1] - dX[j]) / apart[j]
        bending += turn[j + 1] * grows(second, change)
    return m.k / 2 * strain + m.mu * friction + m.alpha * tension + m.beta * bending


GREEDY = Method(GreedySettings, _init, _block, "the paper's greedy search, one step size")
REFINED = Method(
    RefinedSettings, _init, _refined_step, "greedy, its step halved whenever nothing moves"
)
