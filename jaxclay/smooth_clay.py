"""SmoothClay: clay whose heights are a function Y(u), piecewise polynomial of degree 5.

Where :class:`jaxclay.Clay` has slices, this has the whole contour: radius
X(u) = r0 Y_u^-1/2 at height Y(u), which keeps the volume pi r0^2 whatever Y is.
A dozen pieces hold what takes thousands of slices.
"""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from jaxclay._host import is_concrete, pytree
from jaxclay.bernstein import DEGREE, evaluate, heights_at_breaks, least_slope, solve
from jaxclay.checks import check_positive, within

if TYPE_CHECKING:
    from jaxclay.conversion import Converted

Array = Any  # NumPy on the host, JAX inside transformations

_CONTINUOUS = 1e-9  # of the height


@pytree
@dataclasses.dataclass(frozen=True, eq=False)
class SmoothClay:
    """A rotationally symmetric piece of clay by its heights Y(u), u in [0, 1] (eqs. 1 to 3).

    Equal steps of u hold equal volumes.  Clay in slices becomes one of these by
    :meth:`jaxclay.Clay.as_function`.

    Attributes
    ----------
    breaks : (m+1,) array
        Material coordinates 0 = breaks[0] <= ... <= breaks[m] = 1 where pieces
        meet.  Pieces of no width fill arrays up to a size and mean nothing.
    control : (m, 6) array, length
        Bernstein coefficients of Y on each piece (:mod:`jaxclay.bernstein`).
        Y_u and Y_uu may jump where pieces meet, Y may not.
    r0 : float, length^(3/2)
        sqrt(volume / pi); never changes, whatever the clay goes through.
    unit : float, length
        l, the height of the piece when it first became clay.

    Raises
    ------
    ValueError
        Breaks out of order, values that are not finite, a Y that does not start
        at 0, jumps or does not increase, an r0 or a unit that is not positive.
    """

    breaks: Array
    control: Array
    r0: Array
    unit: Array

    def __post_init__(self):
        if not is_concrete(self):
            return
        for name in ("breaks", "control", "r0", "unit"):
            object.__setattr__(self, name, np.array(getattr(self, name), np.float64))
        _check_breaks(self.breaks, self.control)
        _check_control(self.breaks, self.control)
        check_positive("r0", self.r0)
        check_positive("unit", self.unit)

    @property
    def pieces(self) -> Array:
        """How many pieces have a width."""
        return (self.breaks[1:] > self.breaks[:-1]).sum()

    @property
    def heights(self) -> Array:
        """(m+1,) Y at the breaks, length."""
        return heights_at_breaks(self.control)

    @property
    def height(self) -> Array:
        """Y(1), length."""
        return self.control[-1, DEGREE]

    @property
    def volume(self) -> Array:
        """pi r0^2, length^3, which is the volume of this contour for every Y."""
        return np.pi * self.r0**2

    def derivatives(self, u: Array) -> tuple[Array, Array, Array, Array]:
        """Y, Y_u, Y_uu and Y_uuu at u in [0, 1], length; where they jump, the value above."""
        u = within("u", u, 0.0, 1.0)
        y, y_u, y_uu, y_uuu = evaluate(self.breaks, self.control, u)
        return y, y_u, y_uu, y_uuu

    def height_at(self, u: Array) -> Array:
        """Y(u), length, of the clay at the material coordinates u in [0, 1]."""
        return evaluate(self.breaks, self.control, within("u", u, 0.0, 1.0), 1)[0]

    def material_at(self, height: Array) -> Array:
        """The u with Y(u) = height: the fraction of the volume below, for heights in [0, Y(1)]."""
        return solve(self.breaks, self.control, within("height", height, 0.0, self.height))

    def radius_at(self, height: Array) -> Array:
        """The contour's radius X = r0 Y_u^-1/2 (eq. 3), length, at heights in [0, Y(1)]."""
        return self.r0 / self.derivatives(self.material_at(height))[1] ** 0.5

    def sliced(self, slices: int) -> Converted:
        """Clay of ``slices`` equal volumes with Y_i = Y(i/n), and how far its contour is off.

        See :func:`jaxclay.conversion.sliced`.
        """
        from jaxclay.conversion import sliced

        return sliced(self, slices)

    def _repr_html_(self) -> str:
        from jaxclay._html import clay_html

        return clay_html(self)


def unchecked_smooth_clay(breaks: Array, control: Array, r0: Array, unit: Array) -> SmoothClay:
    """A SmoothClay from arrays that may be traced, or a solver's word; no validation."""
    return jax.tree.unflatten(_STRUCTURE, (breaks, control, r0, unit))


def _check_breaks(breaks: np.ndarray, control: np.ndarray) -> None:
    if breaks.ndim != 1 or len(breaks) < 2 or control.shape != (len(breaks) - 1, DEGREE + 1):
        raise ValueError(
            f"control must hold {DEGREE + 1} heights for each piece between two breaks: got shapes "
            f"{control.shape} and {breaks.shape}"
        )
    if not np.isfinite(breaks).all() or breaks[0] != 0 or breaks[-1] != 1:
        raise ValueError(
            f"breaks must be finite and run from 0 to 1, got {breaks[0]:g} to {breaks[-1]:g}"
        )
    if (np.diff(breaks) < 0).any():
        i = int(np.argmax(np.diff(breaks) < 0))
        raise ValueError(
            f"breaks must not fall, but breaks[{i + 1}] = {breaks[i + 1]:g} follows "
            f"breaks[{i}] = {breaks[i]:g}"
        )


def _check_control(breaks: np.ndarray, control: np.ndarray) -> None:
    if not np.isfinite(control).all():
        i = int(np.argmin(np.isfinite(control).all(axis=1)))
        raise ValueError(f"control[{i}] is {control[i]}, but heights must be finite")
    if control[0, 0] != 0:
        raise ValueError(f"Y must start at 0, got {control[0, 0]:g}")
    slope, u = least_slope(breaks, control)
    if not slope > 0:
        raise ValueError(f"Y must increase with u, but Y_u falls to {slope:g} near u = {u:g}")
    # An empty piece at breaks[i] jumps by its own spread.
    jump = np.append(0.0, np.abs(control[1:, 0] - control[:-1, DEGREE]))
    jump = np.maximum(jump, np.where(np.diff(breaks) > 0, 0.0, np.ptp(control, axis=1)))
    if jump.max() > _CONTINUOUS * control[-1, DEGREE]:
        i = int(np.argmax(jump))
        raise ValueError(
            f"Y must be continuous, but it jumps by {jump[i]:g} at breaks[{i}] = {breaks[i]:g}"
        )


_STRUCTURE = jax.tree.structure(SmoothClay([0.0, 1.0], [np.arange(6) / 5], 0.5, 1.0))
