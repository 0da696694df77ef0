"""What Newton and the certificate see of a problem on slices: its sums over the free nodes.

With d_i = t_i / h_i and X = r0 d^-1/2 (eq. 22) the smooth energy is

    E = sum_i w_i (k/2 (t_i / t0_i - 1)^2 + alpha d_i^2)
      + 1/2 sum_j [ p_j (dX_j)^2 + q_j (dd_j)^2 ]
      + 1/2 sum_i s_i (dX_{i+1} / a_{i+1} - dX_i / a_i)^2

dX, dd the differences of neighbours.  It is quadratic in d and in X, so gradient and Hessian
are closed forms by the thicknesses t, where the Hessian has half-bandwidth 2; by the
heights it is D^T H D, D = diff, of half-bandwidth 3.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.numerics import banded
from jaxclay.numerics.arrays import Array, Bool, Float, Scalar, namespace
from jaxclay.numerics.banded import Model
from jaxclay.schemes.base import CONSISTENT, Pull
from jaxclay.schemes.sums import Displaced


class Linear(NamedTuple):
    """A linear problem beside a Hessian.

    Attributes
    ----------
    between : (n,) array
        Curvatures by thicknesses to add.
    at_nodes : (n+1,) array
        Curvatures by heights to add.
    force : (n+1,) array
    keep : (n+1,) array
        1 at the nodes that move, 0 at the others, where the force is 0 too.
    """

    between: Float[Array, "n"]
    at_nodes: Float[Array, "n+1"]
    force: Float[Array, "n+1"]
    keep: Float[Array, "n+1"]


class System(NamedTuple):
    """A problem with its constants folded in; lengths over the unit l.

    Attributes
    ----------
    free : (n+1,) array
        1 at the nodes that move; 0 at the others, which stay at ``target``.
    target : (n+1,) array
        Their displacement; 0 at nodes that move.
    friction_limit : (n+1,) array
        The most force that friction holds, 0 at the fixed nodes.
    upper : (n,) array
        1 for slices above the band's lower edge.
    width, rest_thickness, floor : (n,) arrays
        h_i; t0_i; the least t_i of slices that touch a free node, 0 for the others.
    strain, slope : (n,) arrays
        w_i k and 2 w_i alpha of the same.
    radii : 3 arrays (n,)
        d^2E / dX^2 in bands.
    apart, tension, change : (n-1,) arrays
        1 / a_j, p_j, q_j.
    turn : (n-2,) array
        s_i.
    r0, k, mu, friction_total : scalars
        The last is the sum of ``friction_limit``, or hardly anything.
    """

    free: Float[Array, "n+1"]
    target: Float[Array, "n+1"]
    friction_limit: Float[Array, "n+1"]
    upper: Float[Array, "n"]
    width: Float[Array, "n"]
    rest_thickness: Float[Array, "n"]
    floor: Float[Array, "n"]
    strain: Float[Array, "n"]
    slope: Float[Array, "n"]
    radii: tuple[Float[Array, "n"], Float[Array, "n"], Float[Array, "n"]]
    apart: Float[Array, "n-1"]
    tension: Float[Array, "n-1"]
    change: Float[Array, "n-1"]
    turn: Float[Array, "n-2"]
    r0: Scalar
    k: Scalar
    mu: Scalar
    friction_total: Scalar

    # What a minimiser needs of any scheme: forces at the unknowns, at the places of friction
    # and at those of the lower bound.

    @property
    def loose(self) -> Bool[Array, "n"]:
        """(n,) whether a slice has a free end: only those can become too thin."""
        return self.floor > 0

    def slack(self, point: Displaced) -> Float[Array, "n"]:
        """(n,) thickness above the lower bound."""
        return point.thickness - self.floor

    def moved(self, point: Displaced, step: Float[Array, "nodes"]) -> Displaced:
        """The point after every node has moved by ``step``, (n+1,)."""
        return point.moved(step)

    def shift_change(self, step: Float[Array, "nodes"]) -> Float[Array, "nodes"]:
        """(n+1,) by how much a step changes the displacements."""
        return step

    def thickness_change(self, step: Float[Array, "nodes"]) -> Float[Array, "nodes-1"]:
        """(n,) by how much a step changes the thicknesses."""
        return _differences(step)

    def from_shift(self, forces: Float[Array, "nodes"]) -> Float[Array, "nodes"]:
        """(n+1,) what forces on the displacements do to the free nodes."""
        return forces

    def from_thickness(self, forces: Float[Array, "n"]) -> Float[Array, "n+1"]:
        """(n+1,) what forces on the thicknesses do to the free nodes."""
        return self.free * _to_nodes(forces)

    def free_smooth(self, point: Displaced) -> Float[Array, ""]:
        """E_free without friction."""
        d, X = self._slopes(point)
        stretch = point.thickness / self.rest_thickness - 1
        step, bent = _differences(X), _differences(d)
        turned = _differences(self.apart * step)
        slices = self.strain * stretch * stretch + self.slope * d * d
        between = self.tension * step * step + self.change * bent * bent
        return (
            0.5 * (slices + padded(between, 0, 1) + padded(self.turn * turned * turned, 0, 2)).sum()
        )

    def kinks(self, point: Displaced, eps: Scalar, weight: Float[Array, "n"]) -> Float[Array, ""]:
        """Energy of friction smoothed by eps, and of the lower bound's barrier."""
        smoothed = self.friction_limit * jnp.sqrt(point.shift * point.shift + eps * eps)
        return (smoothed[1:] - weight * jnp.log(self.slack(point))).sum()

    def smooth_model(self, point: Displaced) -> Model:
        """Value and gradient (n+1,) of E_free without friction, its Hessian by thicknesses.

        The Hessian is four arrays (n,): three bands, of which the first holds all of it, and the
        part of that which Gauss and Newton's matrix leaves out, radii being linear in it.
        """
        d, X = self._slopes(point)
        inverse = 1 / point.thickness
        X1, by_radius = -0.5 * X * inverse, self._by_radius(X)
        bend = 0.75 * X * inverse * inverse * by_radius
        own, beside, second = self.radii
        per = 1 / self.width
        first = X1 * X1 * own + bend + self.strain / (self.rest_thickness * self.rest_thickness)
        first += per * per * (self.slope + _to_nodes(self.change, 1))
        beside = X1 * padded(X1, -1, 1) * beside
        beside -= per * padded(per, -1, 1) * padded(self.change, 0, 1)
        second = X1 * padded(X1, -2, 2) * second
        gradient = self._gradient(point, d, X1, by_radius)
        return Model(self.free_smooth(point), gradient, (first, beside, second, bend))

    def gradient(self, point: Displaced) -> Float[Array, "nodes"]:
        """(n+1,) the gradient of E_free without friction."""
        d, X = self._slopes(point)
        return self._gradient(point, d, -X / (2 * point.thickness), self._by_radius(X))

    def _slopes(self, point: Displaced) -> tuple[Array, Array]:
        d = point.thickness / self.width
        return d, self.r0 / namespace(d).sqrt(d)

    def _by_radius(self, X: Array) -> Array:
        """(n,) dE / dX."""
        step = _differences(X)
        moment = self.turn * _differences(self.apart * step)
        return _to_nodes(self.tension * step + self.apart * _to_nodes(moment))

    def _gradient(self, point: Displaced, d: Array, X1: Array, by_radius: Array) -> Array:
        strain = self.strain * (point.thickness / self.rest_thickness - 1) / self.rest_thickness
        by_slope = self.slope * d + _to_nodes(self.change * _differences(d))
        return self.from_thickness(strain + by_slope / self.width + X1 * by_radius)

    def matrix(self, bands: Any, linear: Linear) -> Float[Array, "4 nodes"]:
        """(4, n+1) the Hessian by heights in bands, the identity where nodes are not kept."""
        first, second, third, _ = bands
        here = [padded(first + linear.between, 0, 1), padded(second, 0, 1), padded(third, 0, 1)]
        before = [padded(band, 1, -1) for band in here]
        keep = linear.keep
        rows = (
            here[0] + before[0] - 2 * before[1] + linear.at_nodes,
            before[1] - before[2] - here[0] + here[1],
            before[2] - here[1] + here[2],
            -here[2],
        )
        masked = [keep * row * padded(keep, -k, k) for k, row in enumerate(rows)]
        return jnp.stack([masked[0] + (1 - keep), *masked[1:]])

    def newton_step(
        self, _point: Displaced, bands: Any, pull: Pull
    ) -> tuple[Float[Array, "nodes"], Bool[Array, ""]]:
        """(n+1,) H^-1 force on the free nodes; whether H is positive definite there."""
        return self.solve(bands, self.linear(bands, pull))

    def linear(self, bands: Any, pull: Pull) -> Linear:
        """What a step of Newton's asks of :meth:`solve`."""
        between = pull.floor - pull.gauss * bands[3]
        spread = pull.friction + 4 * pull.shift * jnp.max(bands[0])
        return Linear(between, spread, pull.force, self.free)

    def own_stiffness(self, bands: Any) -> tuple[Float[Array, "nodes"], Float[Array, "nodes-1"]]:
        """(n+1,) and (n,) the Hessian's diagonals by heights and thicknesses, about.

        Gauss and Newton's where the whole is less, so that they are positive.
        """
        first, *_, bend = bands
        by_thickness = jnp.maximum(first, first - bend)
        return _to_nodes(by_thickness, 1), by_thickness

    def solve(self, bands: Any, linear: Linear) -> tuple[Float[Array, "nodes"], Bool[Array, ""]]:
        """(n+1,) H^-1 force on the nodes to keep, and whether H is positive definite there.

        In heights bending is of sixth order, and on fine grids the rounding of its entries hides
        how softly a free upper end gives way.  By thicknesses that is known: so its pivot, the
        last one, comes from how all nodes follow when the end is lifted by 1.
        """
        between, at_nodes, force, keep = linear
        factor, forward = banded.reduced(self.matrix(bands, linear), force)
        inner, end = (
            padded((forward / factor.pivots)[:-1], 0, 1),
            padded(jnp.ones(1), force.shape[0] - 1, 0),
        )
        held, follow = jax.vmap(banded.substituted, (None, 0))(factor, jnp.stack([inner, end]))
        q = padded(_differences(keep * follow), 0, 1)
        first, second, third, _ = bands
        rise = (first + between) * q[:-1] + 2 * second * q[1:] + 2 * third * padded(q[1:], -1, 1)
        pivot = (q[:-1] * rise + (at_nodes * follow * follow)[1:]).sum()
        pivot = pivot * keep[-1] + (1 - keep[-1])
        positive = (jnp.min(factor.pivots[:-1]) > 0) & (pivot > 0)
        return held + follow * (forward[-1] / pivot), positive

    def admissible(self, point: Displaced) -> Bool[Array, ""]:
        """Whether the shape keeps above the lower bound, in step with itself and to the tool."""
        # A slice at the lower bound may lie below it by rounding.
        low = -CONSISTENT * self.rest_thickness
        obeys_bound = (self.slack(point) >= low).all() & (point.thickness > 0).all()
        # Thicknesses and displacements are held apart; the energy is of both, so they must agree.
        apart = self.rest_thickness + self.thickness_change(point.shift) - point.thickness
        missed = (1 - self.free) * (point.shift - self.target)
        consistent = abs(apart).max() <= CONSISTENT
        return obeys_bound & consistent & (abs(missed).max() <= CONSISTENT)

    def evened(self, point: Displaced, fraction: Scalar) -> Displaced:
        """The point moved by ``fraction`` towards each side of the band spread evenly.

        Spread evenly between its ends a side is above the lower bound if it can be at all.
        """
        xp = namespace(self.floor, point.shift, fraction)
        change = 0.0
        for side in (self.loose * (1 - self.upper), self.loose * self.upper):
            rest, now = side * self.rest_thickness, side * point.thickness
            even = rest * (now.sum() / xp.maximum(rest.sum(), 1e-300))
            change += fraction * (even - now)
        moved = xp.concatenate([xp.zeros(1), xp.cumsum(change)])
        return Displaced(point.thickness + change, point.shift + self.free * moved)

    def put_to_rest(self, point: Displaced, rests: Bool[Array, "nodes"]) -> Displaced:
        """The point with the nodes that rest, a bool array, exactly where they were."""
        stays = 1 - self.free * rests
        moved = point.moved(point.shift * (stays - 1))
        shift = moved.shift * stays
        resting = (abs(shift[1:]) + abs(shift[:-1]) == 0) & self.loose
        return Displaced(jnp.where(resting, self.rest_thickness, moved.thickness), shift)


def _differences(values: Array) -> Array:
    return values[1:] - values[:-1]


def padded(values: Array, low: int, high: int) -> Array:
    """With zeros before and after; with fewer entries where a number is negative."""
    if namespace(values) is np:
        whole = np.zeros(len(values) + low + high)
        whole[max(low, 0) : len(whole) - max(high, 0)] = values[
            max(-low, 0) : len(values) - max(-high, 0)
        ]
        return whole
    return jax.lax.pad(values, jnp.zeros((), values.dtype), [(low, high, 0)])


def _to_nodes(forces: Array, sign: int = -1) -> Array:
    """D^T forces, what forces on differences do to what they are differences of; or their sum."""
    return padded(forces, 1, 0) + sign * padded(forces, 0, 1)
