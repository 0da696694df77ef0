"""Material: what the clay is made of (eqs. 4, 5, 8)."""

from __future__ import annotations

import dataclasses

import numpy as np

from jaxclay.numerics.arrays import Array
from jaxclay.numerics.checks import as_number, check_positive, check_slices
from jaxclay.numerics.host import is_concrete, pytree


@pytree
@dataclasses.dataclass(frozen=True)
class Material:
    """Constants of the energy, for a piece of unit height (eqs. 4, 5, 8).

    Attributes
    ----------
    k : float > 0
        Stiffness against a change of thickness (eq. 4).
    mu : float >= 0
        Friction against a shift (eq. 5).
    alpha, beta : float >= 0
        Weights of the contour's first and second derivative (eq. 8), which eq.
        21 takes by differences divided by h.  A snake in the sense of Williams
        and Shah does not divide: see :meth:`from_snake_units`.
    floor : float in (0, 1)
        f, lower bound of a slice's thickness over that before the squash.
        The paper has none, but E_move is finite at zero thickness.

    Raises
    ------
    ValueError
        A constant outside its range.
    """

    k: Array = 1.0
    mu: Array = 1.0
    alpha: Array = 1.0
    beta: Array = 1.0
    floor: Array = 0.05

    def __post_init__(self):
        if not is_concrete(self):
            return
        check_positive("k", self.k)
        for name in ("mu", "alpha", "beta"):
            value = as_number(name, getattr(self, name))
            if not (value >= 0 and np.isfinite(value)):
                raise ValueError(f"{name} must be finite and at least 0, got {value:g}")
        if not 0 < as_number("floor", self.floor) < 1:
            raise ValueError(f"floor must lie between 0 and 1, got {self.floor:g}")

    @classmethod
    def from_snake_units(
        cls, k=1.0, mu=1.0, alpha=1.0, beta=1.0, slices: int = 64, floor=0.05
    ) -> Material:
        """Constants whose alpha and beta weigh raw differences on a grid of ``slices``.

        alpha h^2 and beta h^4 with h = 1/slices take the place of alpha and
        beta, so the material is the same on every grid it is used on.
        """
        check_slices(slices)
        if is_concrete(alpha, beta):
            alpha, beta = as_number("alpha", alpha), as_number("beta", beta)
        return cls(k, mu, alpha / slices**2, beta / slices**4, floor)
