"""The energy density, one function per term (eqs. 4-6, 8, 9), and its weighted sum.

A scheme turns its unknowns into :class:`Samples` of the contour; every scheme
shares the densities below.  Lengths are over the unit l, so energies have no
unit.
"""

from __future__ import annotations

from typing import NamedTuple

from jaxclay.model.material import Material
from jaxclay.numerics.arrays import Array, Float, Scalar, namespace


class Weights(NamedTuple):
    """Quadrature weights: sums over samples approximate integrals over u.

    Attributes
    ----------
    slope, shift : of stretch and Y_u, and of shift
    first, second : of X_u and Y_uu, and of X_uu
    """

    slope: Array
    shift: Array
    first: Array
    second: Array


def everywhere(weight: Array) -> Weights:
    """The same weights for all."""
    return Weights(weight, weight, weight, weight)


class Samples(NamedTuple):
    """What the density needs, arrays each at the places where a scheme has it.

    Attributes
    ----------
    stretch : Y_u / Y0_u
    shift : Y - Y0
    Y_u, Y_uu, X_u, X_uu : derivatives of the contour (X, Y) in u
    weights : of each
    """

    stretch: Array
    shift: Array
    Y_u: Array
    X_u: Array
    Y_uu: Array
    X_uu: Array
    weights: Weights


class Terms(NamedTuple):
    """The four terms of E_total (eq. 9), scalars without a unit.

    Attributes
    ----------
    strain : scalar
        Of eq. 4.
    friction : scalar
        Of eq. 5.
    tension, bending : scalars
        Those of alpha and of beta in eq. 8.
    """

    strain: Float[Array, ""]
    friction: Float[Array, ""]
    tension: Float[Array, ""]
    bending: Float[Array, ""]

    @property
    def total(self) -> Float[Array, "..."]:
        """E_total, their sum."""
        return self.strain + self.friction + self.tension + self.bending

    @property
    def smooth(self) -> Float[Array, "..."]:
        """E_total without friction, which has a kink wherever clay rests."""
        return self.strain + self.tension + self.bending


def strain_density(stretch: Float[Array, "*at"], k: Scalar) -> Float[Array, "*at"]:
    """k/2 (Y_u / Y0_u - 1)^2, eq. 4."""
    return k / 2 * (stretch - 1) ** 2


def friction_density(shift: Float[Array, "*at"], mu: Scalar) -> Float[Array, "*at"]:
    """mu |Y - Y0|, eq. 5."""
    return mu * abs(shift)


def tension_density(v_u: Float[Array, "*at"], alpha: Scalar) -> Float[Array, "*at"]:
    """alpha v_u^2 of one coordinate of v = (X, Y), eq. 8."""
    return alpha * v_u**2


def bending_density(v_uu: Float[Array, "*at"], beta: Scalar) -> Float[Array, "*at"]:
    """beta v_uu^2 of one coordinate, eq. 8."""
    return beta * v_uu**2


def integrate(samples: Samples, material: Material) -> Terms:
    """The four terms of E_total (eq. 9): densities times weights, summed."""
    s, m, w = samples, material, samples.weights
    total = namespace(s.shift).sum
    X_u, Y_u = tension_density(s.X_u, m.alpha), tension_density(s.Y_u, m.alpha)
    X_uu, Y_uu = bending_density(s.X_uu, m.beta), bending_density(s.Y_uu, m.beta)
    return Terms(
        strain=total(w.slope * strain_density(s.stretch, m.k)),
        friction=total(w.shift * friction_density(s.shift, m.mu)),
        tension=total(w.first * X_u) + total(w.slope * Y_u),
        bending=total(w.second * X_uu) + total(w.first * Y_uu),
    )


def integrate_smooth(samples: Samples, material: Material) -> Float[Array, ""]:
    """E_total without friction, in one sum of each kind."""
    s, m, w = samples, material, samples.weights
    total = namespace(s.Y_u).sum
    slope = strain_density(s.stretch, m.k) + tension_density(s.Y_u, m.alpha)
    first = tension_density(s.X_u, m.alpha) + bending_density(s.Y_uu, m.beta)
    second = bending_density(s.X_uu, m.beta)
    return total(w.slope * slope) + total(w.first * first) + total(w.second * second)
