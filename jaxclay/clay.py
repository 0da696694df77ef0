"""Clay and Material: what is shaped and what it is made of (eqs. 1-3, 22).

Notation: u in [0, 1] is the material coordinate (equal steps hold equal
volumes), Y(u) the height, X(u) the radius.  n slices have thickness
t_i = Y_{i+1} - Y_i and radius X_i = r0 sqrt(h / t_i), h = 1/n (eq. 22), with
r0 = sqrt(volume / pi).
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay._host import is_concrete, pytree
from jaxclay.checks import as_number, check_increasing, check_positive, check_slices, within
from jaxclay.slicing import clip_radii, equal_volume_heights

if TYPE_CHECKING:
    from jaxclay.conversion import Converted

Array = Any  # NumPy on the host, JAX inside transformations


@pytree
@dataclasses.dataclass(frozen=True, eq=False)
class Clay:
    """A rotationally symmetric piece of clay, n slices of equal volume (eqs. 2, 20, 22).

    Build it with :meth:`cylinder` or :meth:`from_profile`, or read it with
    :func:`jaxclay.load_profile`.

    Attributes
    ----------
    heights : (n+1,) array, length
        Y_0 = 0 < Y_1 < ... < Y_n, the slices' boundaries from bottom to top.
    thickness : (n,) array, length
        t_i = Y_{i+1} - Y_i, kept beside the heights because differences of
        heights are rounding noise on fine grids.
    r0 : float, length^(3/2)
        sqrt(volume / pi); never changes, whatever the clay goes through.
    unit : float, length
        l, the height of the piece when it first became clay.  Energies are
        those of lengths divided by l.

    Raises
    ------
    ValueError
        Heights that do not increase from 0, an r0 or a unit that is not positive.
    """

    heights: Array
    thickness: Array
    r0: Array
    unit: Array

    def __post_init__(self):
        if not is_concrete(self):
            return
        set_field = object.__setattr__
        for name in ("heights", "thickness", "r0", "unit"):
            set_field(self, name, np.array(getattr(self, name), np.float64))
        if self.heights.ndim != 1 or self.heights.shape[0] != self.thickness.shape[0] + 1:
            raise ValueError(
                f"heights must be one more than thickness: got shapes {self.heights.shape} and "
                f"{self.thickness.shape}"
            )
        check_slices(self.slices)
        check_increasing(self.heights, "heights")
        if self.heights[0] != 0:
            raise ValueError(f"heights must start at 0, got {self.heights[0]:g}")
        if not (self.thickness > 0).all():
            raise ValueError(f"every thickness must be positive, got {self.thickness.min():g}")
        apart = np.abs(np.diff(self.heights) - self.thickness).max()
        if apart > 1e-9 * self.heights[-1]:
            raise ValueError(
                f"thickness must be the differences of the heights, but they differ by {apart:g}"
            )
        check_positive("r0", self.r0)
        check_positive("unit", self.unit)

    @classmethod
    def cylinder(cls, radius: float = 0.5, height: float = 1.0, slices: int = 64) -> Clay:
        """A cylinder of the given radius and height, in one length unit, of ``slices`` slices.

        Raises
        ------
        ValueError
            A radius or a height that is not positive, fewer than 3 slices.
        """
        check_positive("radius", radius)
        check_positive("height", height)
        check_slices(slices)
        return cls(
            heights=height * np.arange(slices + 1) / slices,
            thickness=np.full(slices, height / slices),
            r0=radius * np.sqrt(height),
            unit=height,
        )

    @classmethod
    def from_profile(
        cls, heights, radii, slices: int = 64, minimum_radius: float | None = None
    ) -> Clay:
        """Clay from a measured contour, cut into slices of equal volume.

        The contour is the polyline through the points (radii, heights), so the
        solid is a stack of cone frusta; its volume is kept exactly.  Its lowest
        point becomes height 0 and its total height the unit l.

        Parameters
        ----------
        heights, radii : (m,) array_like, same length unit
            From bottom to top, m >= 2: heights increasing, radii positive.
        slices : int
            n, how many slices of equal volume.
        minimum_radius : float, optional
            Radii below it are raised to it.  Give it to clip a pointed tip.

        Raises
        ------
        ValueError
            Names the first bad value, its place and what is allowed.
        """
        check_slices(slices)
        heights = np.asarray(heights, np.float64)
        radii = np.asarray(radii, np.float64)
        if heights.ndim != 1 or heights.shape != radii.shape or heights.size < 2:
            raise ValueError(
                "heights and radii must be two lists of the same length, at least 2: got shapes "
                f"{heights.shape} and {radii.shape}"
            )
        check_increasing(heights, "heights")
        radii = clip_radii(radii, minimum_radius)
        y = equal_volume_heights(heights - heights[0], radii, slices)
        steps, ra, rb = np.diff(heights), radii[:-1], radii[1:]
        third = np.sum(steps * (ra * ra + ra * rb + rb * rb)) / 3  # volume / pi
        return cls(heights=y, thickness=np.diff(y), r0=np.sqrt(third), unit=y[-1])

    @property
    def slices(self) -> int:
        """n, the number of slices."""
        return self.thickness.shape[0]

    @property
    def radii(self) -> Array:
        """(n,) radius of each slice, length (eq. 22)."""
        return self.r0 / (self.slices * self.thickness) ** 0.5

    @property
    def volume(self) -> Array:
        """Volume of the stack of slices, length^3; pi r0^2, which nothing changes (eq. 2)."""
        return np.pi * self.r0**2

    @property
    def height(self) -> Array:
        """Y_n, length."""
        return self.heights[-1]

    def height_at(self, u: Array) -> Array:
        """Height at the material coordinates u in [0, 1], length; linear within a slice."""
        nodes = np.arange(self.slices + 1) / self.slices
        return _line(within("u", u, 0.0, 1.0), nodes, self.heights)

    def material_at(self, height: Array) -> Array:
        """The fraction u of the volume below heights in [0, Y_n]."""
        height = within("height", height, 0.0, self.height)
        return _line(height, self.heights, np.arange(self.slices + 1) / self.slices)

    def radius_at(self, height: Array) -> Array:
        """Radius at heights in [0, Y_n], length; linear between the middles of slices."""
        middles = (self.heights[1:] + self.heights[:-1]) / 2
        return _line(within("height", height, 0.0, self.height), middles, self.radii)

    def as_function(self, tolerance: float = 1e-6) -> Converted:
        """A :class:`jaxclay.SmoothClay` through all heights, and how far its contour is off.

        See :func:`jaxclay.conversion.as_function`.
        """
        from jaxclay.conversion import as_function

        return as_function(self, tolerance)

    def _repr_html_(self) -> str:
        from jaxclay._html import clay_html

        return clay_html(self)


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
        f, the least thickness of a slice over its thickness before the squash.
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


def unchecked_clay(heights: Array, thickness: Array, r0: Array, unit: Array) -> Clay:
    """A Clay from arrays that may be traced, or a solver's word; no validation."""
    leaves = (heights, thickness, r0, unit)
    return jax.tree.unflatten(jax.tree.structure(Clay.cylinder(slices=3)), leaves)


def _line(at: Array, x: Array, y: Array) -> Array:
    """The polyline through (x, y) at the places ``at``."""
    return (np if is_concrete(at, x, y) else jnp).interp(at, x, y)
