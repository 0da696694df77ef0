"""``lattice``: dynamic programming over labels around a contour (Amini, Weymouth and Jain 1990).

Each free node has m labels: heights ``spacing`` apart around the present one,
and among them the rest height itself where it is in reach, since friction has
its kink there.  One step finds the contour of least E_total among all
m^(free nodes) on that lattice: nodes gain together, where greedy's must gain
one by one.  The lattice is then laid around that contour, or if it is no better
than the present one the spacing is halved.

Each term of eqs. 20-22 reads at most four neighbouring heights, X_uu at node i
those of i-1 .. i+2.  So the least energy of all contours up to node i+1 that
pass through given labels of nodes i-1, i and i+1 is enough to go on from:

    V_1     [a, b, c] = slice_0[a, b] + slice_1[b, c] + corner_1[a, b, c]
    V_{i+1} [b, c, d] = min_a (V_i[a, b, c] + bend_i[a, b, c, d])
                        + slice_{i+1}[c, d] + corner_{i+1}[b, c, d]

with the terms of one slice, of two neighbours (X_u, Y_uu) and of three (X_uu):
n m^4 sums, and n m^3 numbers to keep for the way back.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.methods.base import Method, State, check_setting
from jaxclay.model.energy import bending_density, friction_density, strain_density, tension_density
from jaxclay.numerics.arrays import Array, Float, Scalar
from jaxclay.numerics.host import is_concrete, pytree
from jaxclay.schemes.base import no_forces
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.sums import Displaced

_ROUNDING = 1e-12  # of the energy: a smaller fall is none


@pytree
@dataclasses.dataclass(frozen=True)
class LatticeSettings:
    """Lengths are over the unit l.

    Attributes
    ----------
    max_iterations : most lattices searched
    spacing : between labels of a node, at first
    smallest_spacing : it is not halved below
    labels : m, odd, from 3 to 15; each m is compiled for itself
    """

    max_iterations: Array = 500
    spacing: Array = 1e-2
    smallest_spacing: Array = 1e-8
    labels: int = dataclasses.field(default=7, metadata={"static": True})

    def __post_init__(self):
        whole = isinstance(self.labels, int | np.integer) and not isinstance(self.labels, bool)
        if not whole or not 3 <= self.labels <= 15 or self.labels % 2 == 0:
            raise ValueError(f"labels must be an odd number from 3 to 15, got {self.labels!r}")
        if is_concrete(self):
            check_setting("max_iterations", self.max_iterations, 1)
            check_setting("spacing", self.spacing, 1e-12, 1.0)
            check_setting("smallest_spacing", self.smallest_spacing, 1e-12, float(self.spacing))


class _Slices(NamedTuple):
    """What each pair of labels of neighbouring nodes makes of the slice between, (n, m, m).

    Attributes
    ----------
    slope, radius : Y_u and X_i; those at rest where t_i is below the lower bound
    energy : strain and tension of the slice, friction of its upper node; inf below the lower bound
    """

    slope: Array
    radius: Array
    energy: Array


def init(problem: Problem, start: Displaced, settings: LatticeSettings) -> State:
    """Lay the widest lattice around the start."""
    nothing_to_do = ~jnp.any(problem.free)
    spacing = jnp.asarray(settings.spacing)
    return State(start, no_forces(problem), jnp.asarray(0), nothing_to_do, memory=spacing)


def step(problem: Problem, state: State, settings: LatticeSettings) -> State:
    """Go to the best contour on the lattice; halve its spacing where that is no better."""
    point, spacing = state.point, state.memory
    move, _ = best_on_lattice(problem, point, label_steps(problem, point, spacing, settings.labels))
    moved = point.moved(move)
    moved = problem.put_to_rest(moved, moved.shift == 0)
    here, there = problem.terms(point).total, problem.terms(moved).total
    falls = there < here - _ROUNDING * jnp.abs(here)
    spacing = jnp.where(falls, spacing, spacing / 2)
    return State(
        point=jax.tree.map(lambda a, b: jnp.where(falls, a, b), moved, point),
        forces=state.forces,
        iterations=state.iterations + 1,
        finished=spacing < settings.smallest_spacing,
        memory=spacing,
    )


def label_steps(
    problem: Problem, point: Displaced, spacing: Scalar, labels: int
) -> Float[Array, "{problem.slices}+1 {labels}"]:
    """(n+1, m) steps of each node from the point to its labels; a fixed node's are all 0.

    They are even but for one: of the labels other than the present height, the
    nearest to the rest height is put onto it.
    """
    even = spacing * (jnp.arange(labels) - labels // 2)
    back = -point.shift[:, None]
    apart = jnp.where(even == 0, jnp.inf, jnp.abs(even - back))
    nearest = jnp.arange(labels) == jnp.argmin(apart, axis=1)[:, None]
    in_reach = (back != 0) & (jnp.abs(back) <= spacing * labels / 2)
    return jnp.where(problem.free[:, None], jnp.where(nearest & in_reach, back, even), 0.0)


def best_on_lattice(
    problem: Problem, point: Displaced, steps: Float[Array, "nodes m"]
) -> tuple[Float[Array, "nodes"], Float[Array, ""]]:
    """The step (n+1,) to the contour of least E_total on a lattice, and that E_total.

    ``point`` is a contour above the lower bound, and ``steps`` (n+1, m) lead from it to the
    labels of each node, as :func:`label_steps` gives them.  That E_total is inf where the
    lower bound forbids every contour.
    """
    slices = _slices(problem, point, steps)
    corners = _corners(problem, slices)
    X, sums = slices.radius, problem.sums

    def forward(value, inputs):
        before, here, after, spacing, energy, corner = inputs
        bends = _bend(problem, before[:, :, None, None], here[:, :, None], after, spacing)
        return jnp.min(value[..., None] + bends, axis=0) + energy + corner, value

    def backward(labels, inputs):
        value, before, here, after, spacing = inputs
        b, c, d = labels
        bends = _bend(problem, before[:, b], here[b, c], after[c, d], spacing)
        a = jnp.argmin(value[:, b, c] + bends)
        return (a, b, c), a

    first = slices.energy[0][..., None] + slices.energy[1] + corners[0]
    windows = (X[:-2], X[1:-1], X[2:], (sums.apart[:-1], sums.apart[1:], sums.turn))
    last, values = jax.lax.scan(forward, first, (*windows, slices.energy[2:], corners[1:]))
    ends = jnp.unravel_index(jnp.argmin(last), last.shape)
    _, labels = jax.lax.scan(backward, ends, (values, *windows), reverse=True)
    labels = jnp.concatenate([labels, jnp.stack(ends)])
    constant = sum(problem.band_terms)
    return jnp.take_along_axis(steps, labels[:, None], axis=1)[:, 0], jnp.min(last) + constant


def _slices(problem: Problem, point: Displaced, steps: Array) -> _Slices:
    m, sums = problem.material, problem.sums
    t = point.thickness[:, None, None] + steps[1:, None, :] - steps[:-1, :, None]
    t0 = problem.rest.thickness[:, None, None]
    # The contour itself stays allowed where rounding has put it below the lower bound.
    allowed = t >= jnp.minimum(problem.floor, point.thickness)[:, None, None]
    t = jnp.where(allowed, t, t0)
    slope = t / sums.width[:, None, None]
    shift = point.shift[1:, None] + steps[1:]
    density = strain_density(t / t0, m.k) + tension_density(slope, m.alpha)
    energy = sums.slices[:, None, None] * density
    energy += (sums.nodes[1:, None] * friction_density(shift, m.mu))[:, None, :]
    radius = problem.rest.r0 / jnp.sqrt(slope)
    return _Slices(slope, radius, jnp.where(allowed, energy, jnp.inf))


def _corners(problem: Problem, slices: _Slices) -> Array:
    """(n-1, m, m, m) energy of X_u and Y_uu at the nodes between two slices, 1 .. n-1."""
    m = problem.material
    apart, weight = (a[:, None, None, None] for a in (problem.sums.apart, problem.sums.between))
    X_u = (slices.radius[1:, None] - slices.radius[:-1, ..., None]) / apart
    Y_uu = (slices.slope[1:, None] - slices.slope[:-1, ..., None]) / apart
    return weight * (tension_density(X_u, m.alpha) + bending_density(Y_uu, m.beta))


def _bend(problem: Problem, before: Array, here: Array, after: Array, spacing) -> Array:
    """Energy of X_uu at the slice of radius X_i = ``here``; spacing a_i-1, a_i, c_i."""
    below, above, turn = spacing
    X_uu = ((after - here) / above - (here - before) / below) / turn
    return turn * bending_density(X_uu, problem.material.beta)


METHOD = Method(
    LatticeSettings, init, step, "dynamic programming over labels around the contour, exact on them"
)
