"""The energy density, one function per term (eqs. 4-6, 8, 9), and its weighted sum.

A scheme turns its unknowns into :class:`Samples` of the contour; every scheme
shares the densities below.  Lengths are over the unit l, so energies have no
unit.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp

from jaxclay.clay import Array, Material


class Samples(NamedTuple):
    """What the density needs at each quadrature point; all (m,) arrays.

    Attributes
    ----------
    stretch : Y_u / Y0_u
    shift : Y - Y0
    Y_u, Y_uu, X_u, X_uu : derivatives of the contour (X, Y) in u
    weight : quadrature weights; the sum over samples approximates the integral over u
    """

    stretch: Array
    shift: Array
    Y_u: Array
    X_u: Array
    Y_uu: Array
    X_uu: Array
    weight: Array


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

    strain: Array
    friction: Array
    tension: Array
    bending: Array

    @property
    def total(self) -> Array:
        """E_total, their sum."""
        return self.strain + self.friction + self.tension + self.bending

    @property
    def smooth(self) -> Array:
        """E_total without friction, which has a kink wherever clay rests."""
        return self.strain + self.tension + self.bending


def strain_density(stretch: Array, k: Array) -> Array:
    """k/2 (Y_u / Y0_u - 1)^2, eq. 4."""
    return k / 2 * (stretch - 1) ** 2


def friction_density(shift: Array, mu: Array) -> Array:
    """mu |Y - Y0|, eq. 5."""
    return mu * jnp.abs(shift)


def tension_density(X_u: Array, Y_u: Array, alpha: Array) -> Array:
    """alpha |v_u|^2, eq. 8."""
    return alpha * (X_u**2 + Y_u**2)


def bending_density(X_uu: Array, Y_uu: Array, beta: Array) -> Array:
    """beta |v_uu|^2, eq. 8."""
    return beta * (X_uu**2 + Y_uu**2)


def integrate(samples: Samples, material: Material) -> Terms:
    """The four terms of E_total (eq. 9): densities times weights, summed."""
    s, m, w = samples, material, samples.weight
    return Terms(
        strain=jnp.sum(w * strain_density(s.stretch, m.k)),
        friction=jnp.sum(w * friction_density(s.shift, m.mu)),
        tension=jnp.sum(w * tension_density(s.X_u, s.Y_u, m.alpha)),
        bending=jnp.sum(w * bending_density(s.X_uu, s.Y_uu, m.beta)),
    )


def integrate_smooth(samples: Samples, material: Material) -> Array:
    """E_total without friction, in one sum."""
    s, m = samples, material
    density = strain_density(s.stretch, m.k) + tension_density(s.X_u, s.Y_u, m.alpha)
    return jnp.sum(s.weight * (density + bending_density(s.X_uu, s.Y_uu, m.beta)))
