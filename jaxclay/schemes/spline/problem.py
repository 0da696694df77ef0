"""SplineProblem: a squash posed on the scheme "spline"."""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.clay import text
from jaxclay.clay.clay import Clay
from jaxclay.model.band import Band, Tool
from jaxclay.model.energy import Terms, integrate, integrate_smooth
from jaxclay.model.material import Material
from jaxclay.numerics import banded
from jaxclay.numerics.arrays import Array, Bool, Float, Int, Scalar
from jaxclay.numerics.banded import Factor, Model
from jaxclay.numerics.host import pytree
from jaxclay.numerics.interpolation import Interpolant
from jaxclay.schemes.base import CONSISTENT
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.rough import RoughShape
from jaxclay.schemes.spline import bspline
from jaxclay.schemes.spline.space import Displaced, Space, gauss_newton, sample, seeds

_STIFF = 1e2  # over the unit l: curvature of friction that is reached within a hundredth of l


@pytree
@dataclasses.dataclass(frozen=True, eq=False)
class SplineProblem:
    """A squash posed on splines (eq. 9); lengths inside are over the unit l.

    Attributes
    ----------
    sliced : Problem
        The same squash on second-order slices, at whose nodes the answer becomes a clay.
    rest : Interpolant
        The shape before the squash, Y0(u) over l.
    space : Space
        The splines for the displacement of the free clay.
    fixed : (N,) bool array
        Coefficients that are prescribed, and all of a side without clay.
    shift : (N,) array
        Their values, 0 at the others.
    slopes : (S * 4, 3) array
        Y0_u, Y0_uu, Y0_uuu at the Gauss points.
    band_terms : Terms
        Energies of the clay under the tool.
    rough : RoughShape
        What the sliced cylinder model says of the squash.
    """

    sliced: Problem
    rest: Interpolant
    space: Space
    fixed: Bool[Array, "N"]
    shift: Float[Array, "N"]
    slopes: Float[Array, "points 3"]
    band_terms: Terms
    rough: RoughShape

    def __repr__(self) -> str:
        free = text.free(self.fixed)
        head = f'Problem on scheme "spline": {free} coefficients free'
        return text.lines(head, *text.asked(self.tool, self.material))

    @property
    def clay(self) -> Clay:
        """The shape before the squash, in its own length unit, on the nodes of the answer."""
        return self.sliced.clay

    @property
    def before(self) -> Clay | None:
        """The clay as it was given; not there inside transformations."""
        return self.sliced.before

    @property
    def tool(self) -> Tool:
        """The squash."""
        return self.sliced.tool

    @property
    def material(self) -> Material:
        """Constants of the energy."""
        return self.sliced.material

    @property
    def band(self) -> Band:
        """The material that the tool holds."""
        return self.sliced.band

    @property
    def r0(self) -> Scalar:
        """sqrt(volume / pi), over l^(3/2)."""
        return self.sliced.rest.r0

    @property
    def free(self) -> Bool[Array, "..."]:
        """(N,) coefficients that the minimiser moves."""
        return ~self.fixed

    scheme = "spline"
    unknown_name = "coefficients"

    @property
    def unknown_shape(self) -> tuple[int, ...]:
        """Shape of what :func:`jaxclay.total_energy` takes."""
        return np.shape(self.shift)

    @property
    def unknowns(self) -> Int[Array, ""]:
        """How many."""
        return self.free.sum()

    @property
    def loose(self) -> Bool[Array, "points"]:
        """(S * 4,) Gauss points in spans that have a length."""
        return self.space.weight > 0

    @property
    def rest_thickness(self) -> Float[Array, "points"]:
        """(S * 4,) Y0_u."""
        return self.slopes[:, 0]

    @property
    def floor(self) -> Float[Array, "points"]:
        """(S * 4,) lower bound of Y_u, 0 in spans without length."""
        return jnp.where(self.loose, self.material.floor * self.rest_thickness, 0.0)

    @property
    def friction_limit(self) -> Float[Array, "{self.space.spans}*6"]:
        """(S * 6,) weight times mu: the most that friction can hold."""
        return self.space.friction_weight * self.material.mu

    def point(self, coefficients: Float[Array, "N"]) -> Displaced:
        """Coefficients (N,) as a displaced shape."""
        slopes = self.slopes + self.space.slopes_of(coefficients)
        return Displaced(coefficients, self.space.values_of(coefficients), slopes)

    def moved(self, point: Displaced, step: Float[Array, "N"]) -> Displaced:
        """The point after the coefficients have changed by ``step``, (N,)."""
        change = self.space.values_of(step), self.space.slopes_of(step)
        return Displaced(
            point.coefficients + step, point.shift + change[0], point.slopes + change[1]
        )

    @property
    def friction_total(self) -> Float[Array, ""]:
        """The sum of ``friction_limit``, or hardly anything."""
        return jnp.maximum(jnp.sum(self.friction_limit), 1e-300)

    @property
    def k(self) -> Scalar:
        """The material's."""
        return self.material.k

    @property
    def mu(self) -> Scalar:
        """The material's."""
        return self.material.mu

    def kinks(
        self, point: Displaced, eps: Scalar, weight: Float[Array, "{self.space.spans}*4"]
    ) -> Float[Array, ""]:
        """Energy of friction smoothed by eps, and of the lower bound's barrier."""
        smoothed = self.friction_limit * jnp.sqrt(point.shift**2 + eps**2)
        return jnp.sum(smoothed) - jnp.sum(weight * jnp.log(self.slack(point)))

    def slack(self, point: Displaced) -> Float[Array, "{self.space.spans}*4"]:
        """(S * 4,) Y_u above the lower bound."""
        return jnp.where(self.loose, point.thickness - self.floor, 1.0)

    def shift_change(self, step: Float[Array, "N"]) -> Float[Array, "{self.space.spans}*6"]:
        """(S * 6,) by how much a step changes the displacements."""
        return self.space.values_of(step)

    def thickness_change(self, step: Float[Array, "N"]) -> Float[Array, "{self.space.spans}*4"]:
        """(S * 4,) by how much a step changes Y_u."""
        return self.space.slopes_of(step)[:, 0]

    def from_shift(self, forces: Float[Array, "{self.space.spans}*6"]) -> Float[Array, "N"]:
        """(N,) what forces (S * 6,) on the displacements do to the free coefficients."""
        return jnp.where(self.free, self.space.from_values(forces), 0.0)

    def from_thickness(self, forces: Float[Array, "{self.space.spans}*4"]) -> Float[Array, "N"]:
        """(N,) what forces (S * 4,) on Y_u do to the free coefficients."""
        on_slopes = jnp.pad(forces[:, None], ((0, 0), (0, 2)))
        return jnp.where(self.free, self.space.from_slopes(on_slopes), 0.0)

    def total(self, friction: Float[Array, "m"], floor: Float[Array, "s"]) -> Float[Array, ""]:
        """The sum of energies at the points of friction and at the Gauss points."""
        return jnp.sum(friction) + jnp.sum(floor)

    def free_smooth(self, point: Displaced) -> Float[Array, ""]:
        """E_free without friction."""
        return integrate_smooth(self._samples(point.slopes), self.material)

    def free_terms(self, point: Displaced) -> Terms:
        """E_free's four terms."""
        terms = integrate(self._samples(point.slopes), self.material)
        return terms._replace(friction=jnp.sum(self.friction_limit * jnp.abs(point.shift)))

    def terms(self, point: Displaced) -> Terms:
        """The energy's four terms, the band's included."""
        return jax.tree.map(jnp.add, self.free_terms(point), self.band_terms)

    def _samples(self, slopes: Array):
        weight = self.space.weight
        return sample(weight, self.rest_thickness, self.r0, slopes)

    def smooth_model(self, point: Displaced) -> Model:
        """Value and gradient of E_free without friction; its Hessian by the slopes, (S*4, 3, 3)."""

        def energy(slopes):
            return integrate_smooth(self._samples(slopes), self.material)

        value, by_slopes = jax.value_and_grad(energy)(point.slopes)
        slope = jax.grad(energy)
        columns = [jax.jvp(slope, (point.slopes,), (seed,))[1] for seed in seeds(point.slopes)]
        gradient = jnp.where(self.free, self.space.from_slopes(by_slopes), 0.0)
        return Model(value, gradient, jnp.stack(columns, axis=2))

    def stiffness(
        self,
        point: Displaced,
        matrix: Float[Array, "s 3 3"],
        floor: Float[Array, "s"],
        friction: Float[Array, "m"],
        shift: Scalar | None = None,
        gauss: Scalar | None = None,
    ) -> Factor:
        """A Hessian's factor with the curvatures of lower bound and friction added.

        Where ``gauss``, that of Gauss and Newton; ``shift`` times its largest entry is
        added everywhere.
        """
        if gauss is not None:
            own = self.space.weight, self.rest_thickness, self.r0, point.slopes, self.material
            matrix = jax.lax.cond(gauss, lambda: gauss_newton(*own), lambda: matrix)
        corner = jnp.zeros((3, 3)).at[0, 0].set(1.0)
        bands = self.space.stiffness(matrix + floor[:, None, None] * corner, friction)
        bands = banded.masked(bands, self.free)
        if shift is not None:
            bands = bands.at[0].add(jnp.where(self.free, shift * jnp.max(bands[0]), 0.0))
        return banded.factorize(bands)

    def solved(self, stiff: Factor, force: Float[Array, "N"]) -> Float[Array, "N"]:
        """(N,) H^-1 force."""
        return banded.solve(stiff, force)

    def newton_step(
        self, point: Displaced, matrix: Float[Array, "s 3 3"], pull: Any
    ) -> tuple[Float[Array, "N"], Bool[Array, ""]]:
        """(N,) H^-1 force; whether H is positive definite."""
        gauss = pull.gauss > 0
        stiff = self.stiffness(point, matrix, pull.floor, pull.friction, pull.shift, gauss)
        return self.solved(stiff, pull.force), stiff.positive

    def own_stiffness(
        self, matrix: Array
    ) -> tuple[Float[Array, "{self.space.spans}*6"], Float[Array, "{self.space.spans}*4"]]:
        """(S * 6,) and (S * 4,) curvatures at the points of friction and the Gauss points, about.

        Friction's own scale, reached within a hundredth of l, and the Hessian's by Y_u.
        """
        return _STIFF * self.friction_limit, jnp.abs(matrix[:, 0, 0])

    def admissible(self, point: Displaced) -> Bool[Array, ""]:
        """Whether Y_u keeps above the lower bound and the prescribed coefficients are kept."""
        low = -CONSISTENT * self.rest_thickness
        above = jnp.all(jnp.where(self.loose, self.slack(point) >= low, True))
        missed = jnp.where(self.fixed, point.coefficients - self.shift, 0.0)
        apart = jnp.max(jnp.abs(self.point(point.coefficients).shift - point.shift))
        return above & (jnp.max(jnp.abs(missed)) <= CONSISTENT) & (apart <= CONSISTENT)

    def evened(self, point: Displaced, fraction: Scalar) -> Displaced:
        """The point moved by ``fraction`` towards each side of the band squeezed evenly."""
        return self.moved(point, fraction * (self.even() - point.coefficients))

    def even(self) -> Float[Array, "N"]:
        """(N,) coefficients of a squeeze in proportion: of all clay up to an end that is held.

        Clay up to a free end is moved as one.
        """
        rest, degree, elements = self.rest, self.space.degree, self.space.spans // 2
        start, end = self.space.left[::elements], self.space.length[::elements] * elements
        u = start[:, None] + end[:, None] * bspline.greville(degree, elements)
        height = rest.height(jnp.minimum(u, 1.0))
        ends = jnp.stack([self.band.lower, self.band.upper, jnp.ones(())])
        lower, upper, top = rest.height(ends)
        # What the band prescribes of each side's last coefficient is carried on.
        shift, free = self.shift.reshape(2, -1), self.free.reshape(2, -1)
        below = shift[0, jnp.sum(jnp.cumsum(free[0][::-1]) > 0)] * height[0] / lower
        share = jnp.where(self.tool.top_fixed, (top - height[1]) / (top - upper), 1.0)
        above = shift[1, jnp.argmax(free[1]) - 1] * share
        squeezed = jnp.concatenate([below, above])
        return jnp.where(self.fixed, self.shift, squeezed)

    def put_to_rest(self, point: Displaced, rests: Bool[Array, "m"]) -> Displaced:
        """The point without the coefficients in whose support all clay rests."""
        spans, width = self.space.spans, self.space.degree + 1
        moves = (~rests & (self.space.friction_weight > 0)).reshape(spans, -1).any(axis=1)
        entries = jnp.broadcast_to(moves[:, None], (spans, width)).astype(point.shift.dtype)
        resting = self.free & (bspline.gathered(entries, self.space.degree) == 0)
        return self.moved(point, jnp.where(resting, -point.coefficients, 0.0))

    def room(self) -> tuple[Float[Array, ""], Float[Array, ""]]:
        """Length that a held upper end leaves above the band, and the least that the clay needs."""
        return self.sliced.room()
