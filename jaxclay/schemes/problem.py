"""Problem: which nodes may move, from which rest shape, under which energy."""

from __future__ import annotations

import dataclasses

import numpy as np

from jaxclay.clay import text
from jaxclay.clay.clay import Clay, unchecked_clay
from jaxclay.model.band import Band, Rest, Tool
from jaxclay.model.energy import Samples, Terms, integrate, integrate_smooth
from jaxclay.model.material import Material
from jaxclay.numerics.arrays import Array, Bool, Float, Int, Scalar, namespace
from jaxclay.numerics.host import kept, pytree
from jaxclay.schemes import sums
from jaxclay.schemes.folding import system_of
from jaxclay.schemes.sums import Displaced, Sums
from jaxclay.schemes.system import System


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
    fixed: Bool[Array, "nodes"]
    shift: Float[Array, "nodes"]
    sums: Sums
    band_terms: Terms
    before: Clay | None = dataclasses.field(default=None, metadata={"host": True})
    scheme: str = dataclasses.field(default="paper", metadata={"static": True})

    def __repr__(self) -> str:
        return text.lines(
            f'Problem on scheme "{self.scheme}": {text.size(self.rest.thickness)}, '
            f"{text.free(self.fixed)} heights free",
            *text.asked(self.tool, self.material),
            f"clay: {text.dimensions(self.clay)}",
        )

    @property
    def slices(self) -> int:
        """n."""
        return self.rest.slices

    @property
    def free(self) -> Bool[Array, "..."]:
        """(n+1,) nodes that the minimiser moves."""
        return ~self.fixed

    unknown_name = "heights"

    @property
    def unknown_shape(self) -> tuple[int, ...]:
        """Shape of what :func:`jaxclay.total_energy` takes."""
        return np.shape(self.clay.heights)

    @property
    def unknowns(self) -> Int[Array, ""]:
        """How many heights are free."""
        return self.free.sum()

    @property
    def loose(self) -> Bool[Array, "{self.slices}"]:
        """(n,) slices with a free end: only those can become too thin."""
        return self.free[1:] | self.free[:-1]

    @property
    def banded(self) -> Bool[Array, "{self.slices}"]:
        """(n,) slices between two nodes of the band."""
        held = self.rest.held(self.band)
        return held[1:] & held[:-1]

    @property
    def rest_thickness(self) -> Float[Array, "{self.slices}"]:
        """(n,) thickness before the squash, over the unit l."""
        return self.rest.thickness

    @property
    def floor(self) -> Float[Array, "{self.slices}"]:
        """(n,) lower bound of each loose slice's thickness, 0 for the others."""
        return self.loose * (self.material.floor * self.rest.thickness)

    @property
    def band_thickness(self) -> Float[Array, "{self.slices}"]:
        """(n,) thickness of slices of the tool's radius (eq. 10)."""
        return (self.rest.r0 / self.tool.radius) ** 2 * self.sums.width

    def point(self, heights: Float[Array, "{self.slices}+1"]) -> Displaced:
        """Heights (n+1,) in the clay's length unit as a displaced shape."""
        scaled = heights / self.clay.unit
        point = Displaced(scaled[1:] - scaled[:-1], scaled - self.rest.heights)
        return point if self.scheme == "paper" else self.imposed(point)

    def shape(self, point: Displaced) -> Clay:
        """The point as clay in its own length unit; what rests is the old clay bit for bit."""
        xp = namespace(point, self.clay.heights)
        clay, moves = self.clay, point.shift != 0
        heights = xp.where(moves, (self.rest.heights + point.shift) * clay.unit, clay.heights)
        changed = point.thickness != self.rest.thickness
        thickness = xp.where(changed, point.thickness * clay.unit, clay.thickness)
        edges = clay.edges if self.scheme == "paper" else self._edges(point)
        return unchecked_clay(heights, thickness, clay.r0, clay.unit, clay.material, edges)

    def _edges(self, point: Displaced) -> Array:
        """(4, 2) material and radius, in length units, below and above each edge of the band."""
        xp = namespace(point, self.band.lower)
        radius, scale = self.tool.radius, self.clay.unit
        X = sums.radii(self.rest, self.sums, point.thickness)
        middle = (self.rest.material[1:] + self.rest.material[:-1]) / 2
        smooth = (self.material.alpha > 0) | (self.material.beta > 0)

        def outside(edge: Array, i: Array, step: int) -> Array:
            """The radius beside the band; without smoothing it need not be the tool's."""
            near, far = (xp.clip(i + j * step, 0, self.slices - 1) for j in (0, 1))
            share = (edge - middle[near]) / xp.where(far == near, 1.0, middle[near] - middle[far])
            beyond = xp.maximum(X[near] + share * (X[near] - X[far]), X[near] / 2)
            return xp.where(smooth | self.banded[near], radius, beyond)

        held = self.rest.held(self.band)
        first = xp.argmax(held)
        last = self.slices - xp.argmax(held[::-1])
        low, high = self.rest.material[first], self.rest.material[last]
        below, above = outside(low, first - 1, -1), outside(high, last, 1)
        edges = xp.stack([low, low, high, high]), xp.stack([below, radius, radius, above])
        return xp.stack([edges[0], edges[1] * scale], axis=1)

    def imposed(self, point: Displaced) -> Displaced:
        """The point with its fixed nodes, and the slices between them, as the tool wants them."""
        xp = namespace(point, self.shift)
        shift = xp.where(self.fixed, self.shift, point.shift)
        change = shift - point.shift
        thickness = point.thickness + change[1:] - change[:-1]
        return Displaced(xp.where(self.banded, self.band_thickness, thickness), shift)

    def terms(self, point: Displaced) -> Terms:
        """The energy's four terms at a point; pure, in JAX's dtype: see :func:`energy_terms`."""
        if self.scheme == "paper":
            return integrate(sums.sample(self.rest, self.sums, point), self.material)
        return Terms(*(a + b for a, b in zip(self.free_terms(point), self.band_terms, strict=True)))

    def free_terms(self, point: Displaced) -> Terms:
        """The same over the terms that touch a free node: their sum is E_free."""
        return integrate(self._free_samples(point), self.material)

    def free_smooth(self, point: Displaced) -> Float[Array, ""]:
        """E_free without friction: what solvers evaluate most."""
        return integrate_smooth(self._free_samples(point), self.material)

    def room(self) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Length that a held upper end leaves above the tool, and the least that the clay needs."""
        edge = np.interp(self.band.upper, self.rest.material, self.rest.heights)
        top, unit = self.rest.heights[-1], self.clay.unit
        return (top - self.tool.top) * unit, self.material.floor * (top - edge) * unit

    @property
    def friction_limit(self) -> Float[Array, "{self.slices}+1"]:
        """(n+1,) mu times a node's share of the clay at the free nodes, 0 at the fixed ones."""
        return self.free * (self.material.mu * self.sums.nodes)

    def slack(self, point: Displaced) -> Float[Array, "{self.slices}"]:
        """(n,) thickness above the lower bound."""
        return point.thickness - self.floor

    def moved(self, point: Displaced, step: Float[Array, "{self.slices}+1"]) -> Displaced:
        """The point after every node has moved by ``step``, (n+1,)."""
        return point.moved(step)

    @kept
    def system(self) -> System:
        """What Newton and the certificate see of it."""
        xp = namespace(self.shift, self.band.lower)
        upper = xp.arange(self.slices) >= self.rest.held(self.band).argmax()
        target = self.fixed * self.shift
        return system_of(self.rest, self.sums, self.material, self.free, target, upper)

    def evened(self, point: Displaced, fraction: Scalar) -> Displaced:
        """The point moved by ``fraction`` towards each side of the band spread evenly."""
        return self.system.evened(point, fraction)

    def put_to_rest(self, point: Displaced, rests: Bool[Array, "{self.slices}+1"]) -> Displaced:
        """The point with the nodes that rest, a bool array, exactly where they were."""
        return self.system.put_to_rest(point, rests)

    def _free_samples(self, point: Displaced) -> Samples:
        return sums.sample_free(sums.sample(self.rest, self.sums, point), self.free)
