"""Problem: which nodes may move, from which rest shape, under which energy."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay import local
from jaxclay._host import pytree
from jaxclay.band import Band, Rest, Tool
from jaxclay.banded import Model
from jaxclay.clay import Array, Clay, Material, unchecked_clay
from jaxclay.energy import Samples, Terms, integrate, integrate_smooth
from jaxclay.local import Stiffness
from jaxclay.schemes import paper
from jaxclay.schemes.paper import Point


@pytree
@dataclasses.dataclass(frozen=True, eq=False)
class Problem:
    """A squash posed on a clay (eqs. 9, 20 to 22); lengths inside are over the unit l.

    Attributes
    ----------
    clay : Clay
        The shape before the squash, in its own length unit.
    rest : Rest
        The same over l.
    tool : Tool
        The squash.
    material : Material
    band : Band
        The material that the tool holds.
    fixed : (n+1,) bool array
        Nodes whose height is prescribed: the band's, the lower end, a held upper end.
    shift : (n+1,) array
        Y_i - Y0_i of the fixed nodes, 0 at the others.
    """

    clay: Clay
    rest: Rest
    tool: Tool
    material: Material
    band: Band
    fixed: Array
    shift: Array

    @property
    def slices(self) -> int:
        """n."""
        return self.rest.slices

    @property
    def free(self) -> Array:
        """(n+1,) nodes that the minimiser moves."""
        return ~self.fixed

    unknown_name = "heights"

    @property
    def unknown_shape(self) -> tuple[int, ...]:
        """Shape of what :func:`jaxclay.total_energy` takes."""
        return np.shape(self.clay.heights)

    @property
    def unknowns(self) -> Array:
        """How many heights are free."""
        return self.free.sum()

    @property
    def loose(self) -> Array:
        """(n,) slices with a free end: only those can become too thin."""
        return self.free[1:] | self.free[:-1]

    @property
    def banded(self) -> Array:
        """(n,) slices between two nodes of the band."""
        held = self.band.holds(self.slices)
        return held[1:] & held[:-1]

    @property
    def floor(self) -> Array:
        """(n,) least thickness of each loose slice, 0 for the others."""
        return jnp.where(self.loose, self.material.floor * self.rest.thickness, 0.0)

    @property
    def band_thickness(self) -> Array:
        """Thickness of a slice of the tool's radius (eq. 10)."""
        return (self.rest.r0 / self.tool.radius) ** 2 / self.slices

    def point(self, heights: Array) -> Point:
        """Heights (n+1,) in the clay's length unit as a point."""
        scaled = heights / self.clay.unit
        return Point(jnp.diff(scaled), scaled - self.rest.heights)

    def shape(self, point: Point) -> Clay:
        """The point as clay in its own length unit; what rests is the old clay bit for bit."""
        clay, moves = self.clay, point.shift != 0
        heights = jnp.where(moves, (self.rest.heights + point.shift) * clay.unit, clay.heights)
        changed = point.thickness != self.rest.thickness
        thickness = jnp.where(changed, point.thickness * clay.unit, clay.thickness)
        return unchecked_clay(heights, thickness, clay.r0, clay.unit)

    def imposed(self, point: Point) -> Point:
        """The point with its fixed nodes, and the slices between them, as the tool wants them."""
        shift = jnp.where(self.fixed, self.shift, point.shift)
        thickness = point.thickness + jnp.diff(shift - point.shift)
        return Point(jnp.where(self.banded, self.band_thickness, thickness), shift)

    def terms(self, point: Point) -> Terms:
        """The energy's four terms at a point; pure, in JAX's dtype: see :func:`energy_terms`."""
        return integrate(paper.sample(self.rest, point), self.material)

    def free_terms(self, point: Point) -> Terms:
        """The same over the terms that touch a free node: their sum is E_free."""
        return integrate(self._free_samples(point), self.material)

    def free_smooth(self, point: Point) -> Array:
        """E_free without friction: what solvers evaluate most."""
        return integrate_smooth(self._free_samples(point), self.material)

    def room(self) -> tuple[Array, Array]:
        """Length that a held upper end leaves above the band, and the least that the clay needs."""
        nodes = np.arange(self.slices + 1) / self.slices
        edge = np.interp(self.band.upper, nodes, self.rest.heights)
        top, unit = self.rest.heights[-1], self.clay.unit
        return (top - self.tool.top) * unit, self.material.floor * (top - edge) * unit

    # What a minimiser needs of any scheme: forces at the unknowns, at the places of friction
    # and at those of the floor.

    @property
    def friction_limit(self) -> Array:
        """(n+1,) h mu at the free nodes, 0 at the fixed ones: the most that friction can hold."""
        return jnp.where(self.free, self.material.mu / self.slices, 0.0)

    @property
    def rest_thickness(self) -> Array:
        """(n,) thickness before the squash."""
        return self.rest.thickness

    def slack(self, point: Point) -> Array:
        """(n,) thickness above the floor."""
        return point.thickness - self.floor

    def moved(self, point: Point, step: Array) -> Point:
        """The point after every node has moved by ``step``, (n+1,)."""
        return point.moved(step)

    def shift_change(self, step: Array) -> Array:
        """(n+1,) by how much a step changes the displacements."""
        return step

    def thickness_change(self, step: Array) -> Array:
        """(n,) by how much a step changes the thicknesses."""
        return jnp.diff(step)

    def from_shift(self, forces: Array) -> Array:
        """(n+1,) what forces on the displacements do to the free nodes."""
        return forces

    def from_thickness(self, forces: Array) -> Array:
        """(n+1,) what forces on the thicknesses do to the free nodes."""
        return jnp.where(self.free, local.to_nodes(forces), 0.0)

    def total(self, friction: Array, floor: Array) -> Array:
        """The sum of energies at the nodes (n+1,), of which the first is fixed, and the slices."""
        return jnp.sum(friction[1:] + floor)

    def smooth_model(self, point: Point) -> Model:
        """Value, gradient and Hessian of E_free without friction."""
        return local.smooth_model(self, point)

    def stiffness(
        self, point: Point, matrix: Array, floor: Array, friction: Array, shift: Array, gauss: Array
    ) -> Stiffness:
        """A Hessian's factor with the curvatures of floor and friction added.

        Where ``gauss``, that of Gauss and Newton; ``shift`` times its largest entry is
        added everywhere.
        """
        none = jnp.zeros_like(floor)
        bend = jax.lax.cond(gauss, lambda: local.radius_curvature(self, point), lambda: none)
        between = jnp.where(self.loose, floor, 0.0) - bend
        spread = friction + shift * jnp.max(matrix[0])
        return local.stiffness(self, point, matrix, between, spread)

    def relaxed(self, stiff: Stiffness, force: Array) -> Array:
        """(n+1,) H^-1 force."""
        return local.relaxed(stiff, force)

    def evened(self, point: Point, fraction: Array) -> Point:
        """The point moved by ``fraction`` towards each side of the band spread evenly.

        Spread evenly between its ends a side is above the floor if it can be at all.
        """
        held = self.band.holds(self.slices)
        upper = jnp.arange(self.slices) >= jnp.argmax(held)
        change = jnp.zeros_like(point.thickness)
        for side in (self.loose & ~upper, self.loose & upper):
            rest = jnp.where(side, self.rest.thickness, 0.0)
            now = jnp.where(side, point.thickness, 0.0)
            even = rest * jnp.sum(now) / jnp.maximum(jnp.sum(rest), 1e-300)
            change += jnp.where(side, fraction * (even - now), 0.0)
        moved = jnp.concatenate([jnp.zeros(1), jnp.cumsum(change)])
        return Point(point.thickness + change, point.shift + jnp.where(self.free, moved, 0.0))

    def sent_home(self, point: Point, rests: Array) -> Point:
        """The point with the nodes that rest, a bool array, exactly where they were."""
        rests = rests & self.free
        moved = point.moved(jnp.where(rests, -point.shift, 0.0))
        shift = jnp.where(rests, 0.0, moved.shift)
        home = (shift[1:] == 0) & (shift[:-1] == 0) & self.loose
        return Point(jnp.where(home, self.rest.thickness, moved.thickness), shift)

    def _free_samples(self, point: Point) -> Samples:
        return paper.sample_free(paper.sample(self.rest, point), self.free)
