"""What the energy samples of the splines on a mesh.

On the free clay Y = Y0 + w with w a spline of degree 3 to 5.  Y_u, Y_uu and
Y_uuu are exact, the radius is X = r0 Y_u^-1/2 (eq. 22 in the limit), so

    X_u  = -r0/2 Y_u^-3/2 Y_uu
    X_uu =  r0 (3/4 Y_u^-5/2 Y_uu^2 - 1/2 Y_u^-3/2 Y_uuu)

Friction has points of its own, in two cells a span that meet where w changes
sign: its density has a kink there.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxclay.model.energy import Samples, everywhere
from jaxclay.model.material import Material
from jaxclay.numerics.arrays import Array, Float, Scalar
from jaxclay.schemes.spline import bspline

GAUSS = 4  # points a span
_FRICTION = 3  # points in each of a span's two cells
_CUTS = 40  # of a span, for the place where w changes its sign


class Displaced(NamedTuple):
    """A displaced shape, lengths over the unit l: the point that a minimiser is at.

    Attributes
    ----------
    coefficients : (N,) array
        Of w.
    shift : (S * 6,) array
        w = Y - Y0 at the points of friction.
    slopes : (S * 4, 3) array
        Y_u, Y_uu and Y_uuu at the Gauss points.
    """

    coefficients: Float[Array, "N"]
    shift: Float[Array, "S*6"]
    slopes: Float[Array, "S*4 3"]

    @property
    def thickness(self) -> Float[Array, "points"]:
        """(S * 4,) Y_u, the thickness of a slice over its share of the clay."""
        return self.slopes[:, 0]


class Space(NamedTuple):
    """The splines on a mesh, and what of them the energy samples.

    Attributes
    ----------
    left, length : (S,) arrays
        Lower ends of the spans, material coordinates, and lengths, those below the band first.
    slopes : (S, 4, 3, p+1) array
        Derivatives 1 to 3 of each span's basis at its Gauss points.
    values : (S, 6, p+1) array
        The basis at the points of friction.
    weight : (S * 4,) array
    friction_weight : (S * 6,) array
        Zero in spans without length.
    """

    left: Float[Array, "S"]
    length: Float[Array, "S"]
    slopes: Float[Array, "S 4 3 p+1"]
    values: Float[Array, "S 6 p+1"]
    weight: Float[Array, "S*4"]
    friction_weight: Float[Array, "S*6"]

    @property
    def degree(self) -> int:
        """p."""
        return self.slopes.shape[-1] - 1

    @property
    def spans(self) -> int:
        """S, those without length included."""
        return self.slopes.shape[0]

    def slopes_of(self, coefficients: Float[Array, "N"]) -> Float[Array, "{self.spans}*4 3"]:
        """(S * 4, 3) w_u, w_uu and w_uuu at the Gauss points."""
        local = bspline.local(coefficients, self.degree)
        return jnp.einsum("sgoa,sa->sgo", self.slopes, local).reshape(-1, 3)

    def values_of(self, coefficients: Float[Array, "N"]) -> Float[Array, "{self.spans}*6"]:
        """(S * 6,) w at the points of friction."""
        local = bspline.local(coefficients, self.degree)
        return jnp.einsum("sga,sa->sg", self.values, local).reshape(-1)

    def at(self, coefficients: Float[Array, "N"], u: Float[Array, "m"]) -> Float[Array, "m"]:
        """(m,) w at material coordinates (m,) outside the band."""
        span = jnp.searchsorted(self.left, u, side="right") - 1
        s = (u - self.left[span]) / jnp.where(self.length > 0, self.length, 1.0)[span]
        control = self._control(coefficients)[span]
        return jnp.sum(bspline.bernstein(self.degree, jnp.clip(s, 0.0, 1.0), 0) * control, axis=-1)

    def _control(self, coefficients: Array) -> Array:
        """(S, p+1) Bernstein coefficients of w on each span."""
        extraction = bspline.extraction(self.degree, self.spans // 2)
        return jnp.einsum("sja,sa->sj", extraction, bspline.local(coefficients, self.degree))

    def crossings(self, coefficients: Float[Array, "N"]) -> Float[Array, "{self.spans}"]:
        """(S,) where in each span, from 0 to 1, w changes its sign; one half where it does not."""
        control = self._control(coefficients)
        turns = (control[:, 0] * control[:, -1] < 0) & (self.length > 0)

        def cut(_, bounds):
            low, high = bounds
            s = (low + high) / 2
            there = jnp.sum(bspline.bernstein(self.degree, s, 0) * control, axis=1)
            same = there * control[:, 0] > 0
            return jnp.where(same, s, low), jnp.where(same, high, s)

        none = jnp.zeros_like(control[:, 0])
        low, high = jax.lax.fori_loop(0, _CUTS, cut, (none, none + 1))
        return jnp.where(turns, jnp.clip((low + high) / 2, 0.02, 0.98), 0.5)

    def from_slopes(self, forces: Float[Array, "{self.spans}*4 3"]) -> Float[Array, "N"]:
        """(N,) what forces (S * 4, 3) on the slopes do to the coefficients."""
        forces = forces.reshape(self.spans, GAUSS, 3)
        return bspline.gathered(jnp.einsum("sgoa,sgo->sa", self.slopes, forces), self.degree)

    def from_values(self, forces: Float[Array, "{self.spans}*6"]) -> Float[Array, "N"]:
        """(N,) what forces (S * 6,) on the values do to the coefficients."""
        forces = forces.reshape(self.spans, -1)
        return bspline.gathered(jnp.einsum("sga,sg->sa", self.values, forces), self.degree)

    def stiffness(
        self, slopes: Float[Array, "{self.spans}*4 3 3"], values: Float[Array, "{self.spans}*6"]
    ) -> Float[Array, "{self.degree}+1 N"]:
        """(p+1, N) bands of a Hessian, from (S*4, 3, 3) by the slopes and (S*6,) by the values."""
        by_slopes = slopes.reshape(self.spans, GAUSS, 3, 3)
        by_values = values.reshape(self.spans, -1)
        half = jnp.einsum("sgop,sgpb->sgob", by_slopes, self.slopes)
        matrices = jnp.einsum("sgoa,sgob->sab", self.slopes, half)
        matrices += jnp.einsum("sga,sgb->sab", self.values * by_values[..., None], self.values)
        return bspline.gathered_bands(matrices, self.degree)


def space(
    left: Float[Array, "S"], length: Float[Array, "S"], degree: int, breaks: Float[Array, "S"]
) -> Space:
    """The splines on these spans; friction's cells meet at ``breaks`` (S,), 0 to 1 in each."""
    s, weight = bspline.gauss_points(GAUSS)
    f, friction_weight = bspline.gauss_points(_FRICTION)
    cut = breaks[:, None]
    s_friction = jnp.concatenate([cut * f, cut + (1 - cut) * f], axis=1)
    cells = jnp.concatenate([cut * friction_weight, (1 - cut) * friction_weight], axis=1)
    return Space(
        left,
        length,
        bspline.basis(length, degree, jnp.asarray(s), (1, 2, 3)),
        bspline.basis(length, degree, s_friction, (0,))[:, :, 0],
        (length[:, None] * weight).reshape(-1),
        (length[:, None] * cells).reshape(-1),
    )


def sample(
    weight: Float[Array, "m"],
    rest_slope: Float[Array, "m"],
    r0: Scalar,
    slopes: Float[Array, "m 3"],
) -> Samples:
    """Samples of the contour from Y_u, Y_uu, Y_uuu (m, 3), without friction."""
    Y_u, Y_uu, Y_uuu = slopes[:, 0], slopes[:, 1], slopes[:, 2]
    root = jax.lax.rsqrt(Y_u)
    inverse = root * root
    X_u = -r0 / 2 * root * inverse * Y_uu
    X_uu = r0 * root * inverse * (0.75 * inverse * Y_uu**2 - Y_uuu / 2)
    return Samples(Y_u / rest_slope, jnp.zeros_like(Y_u), Y_u, X_u, Y_uu, X_uu, everywhere(weight))


def seeds(slopes: Float[Array, "m 3"]) -> list[Float[Array, "m 3"]]:
    """The three unit changes of every point's slopes."""
    return [jnp.zeros_like(slopes).at[:, i].set(1.0) for i in range(3)]


def gauss_newton(
    weight: Float[Array, "m"],
    rest_slope: Float[Array, "m"],
    r0: Scalar,
    slopes: Float[Array, "m 3"],
    m: Material,
) -> Float[Array, "m 3 3"]:
    """(m, 3, 3) the energy's Hessian by the slopes without the radius' second derivatives."""

    def quantities(slopes):
        s = sample(weight, rest_slope, r0, slopes)
        return jnp.stack([s.stretch, s.X_u, s.Y_u, s.X_uu, s.Y_uu], axis=1)

    columns = [jax.jvp(quantities, (slopes,), (seed,))[1] for seed in seeds(slopes)]
    jacobian = jnp.stack(columns, axis=2)
    stiffness = jnp.stack([m.k, 2 * m.alpha, 2 * m.alpha, 2 * m.beta, 2 * m.beta])
    return jnp.einsum("q,iqa,iqb->iab", stiffness, jacobian * weight[:, None, None], jacobian)
