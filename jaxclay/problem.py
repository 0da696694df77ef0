"""Problem: which nodes may move, from which rest shape, under which energy.

    problem = pose(clay, squash, material)

E_total and its terms are functions of the problem and the heights Y_i alone,
with the radii from eq. 22; all of them can be compiled and differentiated.
"""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np

from jaxclay._host import compiled, in_float64, is_concrete, is_transformed, pytree
from jaxclay.band import Band, Rest, Tool, locate_band
from jaxclay.clay import Array, Clay, Material, unchecked_clay
from jaxclay.energy import Samples, Terms, integrate, integrate_smooth
from jaxclay.schemes import paper
from jaxclay.schemes.paper import Point
from jaxclay.squash import Squash, check_fits

SCHEMES = ("paper",)


@pytree
@dataclasses.dataclass(frozen=True, eq=False)
class Problem:
    """A squash posed on a clay; lengths inside are over the unit l.

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

    def _free_samples(self, point: Point) -> Samples:
        return paper.sample_free(paper.sample(self.rest, point), self.free)


def pose(clay: Clay, squash: Squash, material: Material, scheme: str = "paper") -> Problem:
    """Pose a squash: find the material under the tool and fix its nodes (eqs. 10, 11).

    Parameters
    ----------
    clay : Clay
        The shape before the squash, n slices.
    squash : Squash
        In the clay's length unit.
    material : Material
        Its constants.
    scheme : str
        "paper" (eqs. 20-22).

    Raises
    ------
    ValueError
        The band lies above the clay, leaves a held end no room, or holds fewer
        than two nodes, and so imposes no radius on this grid.
    TypeError
        Inside a JAX transformation while float64 is off.
    """
    if scheme not in SCHEMES:
        raise ValueError(f"unknown scheme {scheme!r}: choose from {', '.join(SCHEMES)}")
    concrete = is_concrete(clay, squash, material)
    if concrete:
        check_fits(squash, clay)
    problem = in_float64("pose", _pose, clay, squash, material)
    if concrete and not is_transformed(problem):
        _check_band(problem, squash)
    return problem


def energy_terms(problem: Problem, heights: Array) -> Terms:
    """The four terms of E_total at heights (n+1,), in the clay's length unit (eq. 9)."""
    if np.shape(heights) != np.shape(problem.clay.heights):
        raise ValueError(
            f"heights must hold one height for each of {problem.slices + 1} nodes: got shape "
            f"{np.shape(heights)}"
        )
    if is_transformed(problem, heights):
        return problem.terms(problem.point(heights))
    return in_float64("energy_terms", _terms, problem, heights)


def total_energy(problem: Problem, heights: Array) -> Array:
    """E_total (eq. 9) as a function of the heights Y_i (n+1,), with X_i from eq. 22.

    Called from the host it computes in float64; inside a transformation it
    follows the dtype of its arguments and can be compiled and differentiated.
    """
    return energy_terms(problem, heights).total


def strain_energy(problem: Problem, heights: Array) -> Array:
    """h sum k/2 (Y_u / Y0_u - 1)^2 (eq. 4)."""
    return energy_terms(problem, heights).strain


def friction_energy(problem: Problem, heights: Array) -> Array:
    """h sum mu |Y_i - Y0_i| (eq. 5)."""
    return energy_terms(problem, heights).friction


def tension_energy(problem: Problem, heights: Array) -> Array:
    """h sum alpha (X_u^2 + Y_u^2) (eq. 8)."""
    return energy_terms(problem, heights).tension


def bending_energy(problem: Problem, heights: Array) -> Array:
    """h sum beta (X_uu^2 + Y_uu^2) (eq. 8)."""
    return energy_terms(problem, heights).bending


@compiled()
def _terms(problem: Problem, heights: Array) -> Terms:
    return problem.terms(problem.point(heights))


@compiled()
def _pose(clay: Clay, squash: Squash, material: Material) -> Problem:
    unit = clay.unit
    rest = Rest(clay.thickness / unit, clay.heights / unit, clay.r0 / unit**1.5)
    tool = Tool(squash.bottom / unit, squash.top / unit, squash.radius / unit, squash.top_fixed)
    return placed(clay, rest, tool, material, locate_band(rest, tool, material))


def placed(clay: Clay, rest: Rest, tool: Tool, material: Material, band: Band) -> Problem:
    """The problem of a band that has been located: its nodes fixed where the tool wants them."""
    held = band.holds(rest.slices)
    in_band = band.bottom + (rest.r0 / tool.radius) ** 2 * (rest.nodes() - band.lower)
    shift = jnp.where(held, in_band - rest.heights, 0.0).at[0].set(0.0)
    ends = jnp.zeros_like(held).at[0].set(True).at[-1].set(tool.top_fixed)
    return Problem(clay, rest, tool, material, band, held | ends, shift)


@compiled()
def _held(problem: Problem) -> Array:
    return problem.band.holds(problem.slices)


def _check_band(problem: Problem, squash: Squash) -> None:
    held = in_float64("pose", _held, problem)  # on the host a node on the edge needs float64 too
    if held.sum() >= 2:
        return
    share = float(problem.band.upper - problem.band.lower)
    raise ValueError(
        f"the band from {float(squash.bottom):g} to {float(squash.top):g} holds {share:.3g} of "
        f"the clay, which fixes {held.sum()} of the nodes of {problem.slices} slices and so "
        f"imposes no radius: use at least {int(np.ceil(2 / share))} slices (2/{share:.3g}) "
        "or a taller band"
    )
