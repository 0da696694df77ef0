"""Problem: which nodes may move, from which rest shape, under which energy."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay import _repr, local
from jaxclay._host import pytree
from jaxclay.band import Band, Rest, Tool
from jaxclay.banded import Model
from jaxclay.clay import Array, Clay, Material, unchecked_clay
from jaxclay.energy import Samples, Terms, integrate, integrate_smooth
from jaxclay.local import Stiffness
from jaxclay.schemes import sums
from jaxclay.schemes.sums import Point, Sums


@pytree
@dataclasses.dataclass(frozen=True, eq=False)
class Problem:
    """A squash posed on a clay (eqs. 9, 20 to 22); lengths inside are over the unit l.

    Attributes
    ----------
    clay : Clay
        The shape before the squash, in its own length unit, on the nodes of this problem.
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
    sums : Sums
        Spacings and weights of the energy's sums.
    band_terms : Terms
        What E_total has beside the sums over free nodes, on the scheme "slices": the clay under
        the tool, which no minimiser moves.
    before : Clay or None
        The clay as it was given, on its own nodes; not there inside transformations.
    scheme : str
        "paper" or "slices".
    """

    clay: Clay
    rest: Rest
    tool: Tool
    material: Material
    band: Band
    fixed: Array
    shift: Array
    sums: Sums
    band_terms: Terms
    before: Clay | None = dataclasses.field(default=None, metadata={"host": True})
    scheme: str = dataclasses.field(default="paper", metadata={"static": True})

    def __repr__(self) -> str:
        return _repr.lines(
            f'Problem on scheme "{self.scheme}": {_repr.size(self.rest.thickness)}, '
            f"{_repr.free(self.fixed)} heights free",
            *_repr.asked(self.tool, self.material),
            f"clay: {_repr.dimensions(self.clay)}",
        )

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
        held = self.rest.held(self.band)
        return held[1:] & held[:-1]

    @property
    def floor(self) -> Array:
        """(n,) least thickness of each loose slice, 0 for the others."""
        return jnp.where(self.loose, self.material.floor * self.rest.thickness, 0.0)

    @property
    def band_thickness(self) -> Array:
        """(n,) thickness of slices of the tool's radius (eq. 10)."""
        return (self.rest.r0 / self.tool.radius) ** 2 * self.sums.width

    def point(self, heights: Array) -> Point:
        """Heights (n+1,) in the clay's length unit as a point."""
        scaled = heights / self.clay.unit
        point = Point(jnp.diff(scaled), scaled - self.rest.heights)
        return point if self.scheme == "paper" else self.imposed(point)

    def shape(self, point: Point) -> Clay:
        """The point as clay in its own length unit; what rests is the old clay bit for bit."""
        clay, moves = self.clay, point.shift != 0
        heights = jnp.where(moves, (self.rest.heights + point.shift) * clay.unit, clay.heights)
        changed = point.thickness != self.rest.thickness
        thickness = jnp.where(changed, point.thickness * clay.unit, clay.thickness)
        edges = clay.edges if self.scheme == "paper" else self._edges(point)
        return unchecked_clay(heights, thickness, clay.r0, clay.unit, clay.material, edges)

    def _edges(self, point: Point) -> Array:
        """(4, 2) material and radius, in length units, below and above each edge of the band."""
        radius, scale = self.tool.radius, self.clay.unit
        X = sums.radii(self.rest, self.sums, point.thickness)
        middle = (self.rest.material[1:] + self.rest.material[:-1]) / 2
        smooth = (self.material.alpha > 0) | (self.material.beta > 0)

        def outside(edge: Array, i: Array, step: int) -> Array:
            """The radius beside the band; without smoothing it need not be the tool's."""
            near, far = (jnp.clip(i + j * step, 0, self.slices - 1) for j in (0, 1))
            share = (edge - middle[near]) / jnp.where(far == near, 1.0, middle[near] - middle[far])
            beyond = jnp.maximum(X[near] + share * (X[near] - X[far]), X[near] / 2)
            return jnp.where(smooth | self.banded[near], radius, beyond)

        held = self.rest.held(self.band)
        first = jnp.argmax(held)
        last = self.slices - jnp.argmax(held[::-1])
        low, high = self.rest.material[first], self.rest.material[last]
        below, above = outside(low, first - 1, -1), outside(high, last, 1)
        edges = jnp.stack([low, low, high, high]), jnp.stack([below, radius, radius, above])
        return jnp.stack([edges[0], edges[1] * scale], axis=1)

    def imposed(self, point: Point) -> Point:
        """The point with its fixed nodes, and the slices between them, as the tool wants them."""
        shift = jnp.where(self.fixed, self.shift, point.shift)
        thickness = point.thickness + jnp.diff(shift - point.shift)
        return Point(jnp.where(self.banded, self.band_thickness, thickness), shift)

    def terms(self, point: Point) -> Terms:
        """The energy's four terms at a point; pure, in JAX's dtype: see :func:`energy_terms`."""
        if self.scheme == "paper":
            return integrate(sums.sample(self.rest, self.sums, point), self.material)
        return jax.tree.map(jnp.add, self.free_terms(point), self.band_terms)

    def free_terms(self, point: Point) -> Terms:
        """The same over the terms that touch a free node: their sum is E_free."""
        return integrate(self._free_samples(point), self.material)

    def free_smooth(self, point: Point) -> Array:
        """E_free without friction: what solvers evaluate most."""
        return integrate_smooth(self._free_samples(point), self.material)

    def room(self) -> tuple[Array, Array]:
        """Length that a held upper end leaves above the band, and the least that the clay needs."""
        edge = np.interp(self.band.upper, self.rest.material, self.rest.heights)
        top, unit = self.rest.heights[-1], self.clay.unit
        return (top - self.tool.top) * unit, self.material.floor * (top - edge) * unit

    # What a minimiser needs of any scheme: forces at the unknowns, at the places of friction
    # and at those of the floor.

    @property
    def friction_limit(self) -> Array:
        """(n+1,) mu times a node's share of the clay at the free nodes, 0 at the fixed ones."""
        return jnp.where(self.free, self.material.mu * self.sums.nodes, 0.0)

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
        held = self.rest.held(self.band)
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
        return sums.sample_free(sums.sample(self.rest, self.sums, point), self.free)
