"""What a scheme is to the methods and to the certificate: the interface, written.

A problem has m places where clay may rest and s where it may become too thin: on slices the n+1
nodes and the n slices, on splines Gauss points of friction and of the strain.  Its N unknowns are
heights, (n+1,) with the fixed ones, or coefficients.  Lengths are over the unit l, energies have no
unit, forces are energies over lengths.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from jaxclay.numerics.arrays import Array, Bool, Float, Scalar, Shaped, namespace

AnyDisplaced = Any  # a displaced shape as a scheme holds it: a point, for a minimiser

DECREMENT = 1e-10  # accepted, relative to max(E_free, SMALL)
SMALL = 1e-3
CONSISTENT = 1e-12  # over the unit l: rounding of an answer's parts


class Forces(NamedTuple):
    """Multipliers of the two kinds of kink and bound, energies over lengths.

    Attributes
    ----------
    friction : (n+1,) array
        lam, between -h mu and h mu; h mu sign(d_i) where clay moves.
    floor : (n,) array
        z >= 0, what holds a slice above its lower bound.
    """

    friction: Float[Array, "n+1"]
    floor: Float[Array, "n"]


class Pull(NamedTuple):
    """What a step asks of the linear model: curvatures beside the Hessian's own, and the force.

    ``shift`` times the Hessian's largest entry is added everywhere; where ``gauss`` is 1 the
    Hessian is that of Gauss and Newton.  ``energy`` is E_free, ``weight`` (s,) the barrier's.
    """

    floor: Float[Array, "s"]
    friction: Float[Array, "m"]
    shift: Scalar
    gauss: Scalar
    force: Float[Array, "N"]
    energy: Scalar
    weight: Float[Array, "s"]


@runtime_checkable
class Minimisable(Protocol):
    """What every method may ask of a problem, or of its :class:`.System`."""

    @property
    def free(self) -> Shaped[Array, "N"]:
        """(N,) true or 1 where an unknown moves."""
        ...

    @property
    def friction_limit(self) -> Float[Array, "m"]:
        """(m,) most that friction can hold a place with, force."""
        ...

    @property
    def loose(self) -> Shaped[Array, "s"]:
        """(s,) true or 1 where clay may become too thin."""
        ...

    @property
    def rest_thickness(self) -> Float[Array, "s"]:
        """(s,) thickness before the squash: of slices a length, of points of a spline Y0_u."""
        ...

    @property
    def floor(self) -> Float[Array, "s"]:
        """(s,) lower bound of thickness where ``loose``, 0 elsewhere."""
        ...

    def slack(self, point: Any, /) -> Float[Array, "s"]:
        """(s,) thickness above the lower bound."""
        ...

    def moved(self, point: Any, step: Float[Array, "N"], /) -> Any:
        """The point after a step (N,) of the unknowns."""
        ...

    def evened(self, point: Any, fraction: Scalar, /) -> Any:
        """The point moved by a fraction towards clay spread evenly beside the band."""
        ...

    def put_to_rest(self, point: Any, rests: Bool[Array, "m"], /) -> Any:
        """The point with the places that rest, a bool array (m,), exactly where they were."""
        ...

    def free_smooth(self, point: Any, /) -> Float[Array, ""]:
        """E_free without friction, scalar."""
        ...


@runtime_checkable
class Newtonian(Minimisable, Protocol):
    """What Newton asks besides: of :class:`.System` and :class:`.SplineProblem`."""

    @property
    def k(self) -> Scalar:
        """The material's stiffness."""
        ...

    @property
    def mu(self) -> Scalar:
        """The material's friction."""
        ...

    @property
    def friction_total(self) -> Float[Array, ""]:
        """Sum of ``friction_limit``, above 0."""
        ...

    def shift_change(self, step: Float[Array, "N"], /) -> Float[Array, "m"]:
        """(m,) what a step (N,) adds to displacements."""
        ...

    def thickness_change(self, step: Float[Array, "N"], /) -> Float[Array, "s"]:
        """(s,) what a step adds to thicknesses, 0 where not ``loose``."""
        ...

    def from_shift(self, forces: Float[Array, "m"], /) -> Float[Array, "N"]:
        """(N,) forces on displacements (m,) as forces on the unknowns."""
        ...

    def from_thickness(self, forces: Float[Array, "s"], /) -> Float[Array, "N"]:
        """(N,) forces on thicknesses (s,) likewise."""
        ...

    def kinks(self, point: Any, eps: Scalar, weight: Float[Array, "s"], /) -> Float[Array, ""]:
        """Friction, smoothed over the length eps, less ``weight`` times the log of slacks."""
        ...

    def smooth_model(self, point: Any, /) -> Any:
        """Value, gradient (N,) and the Hessian's bands of ``free_smooth``."""
        ...

    def newton_step(
        self, point: Any, bands: Any, pull: Pull, /
    ) -> tuple[Float[Array, "N"], Bool[Array, ""]]:
        """(N,) H^-1 force, and whether H is positive definite where unknowns are free."""
        ...

    def own_stiffness(self, bands: Any, /) -> tuple[Float[Array, "m"], Float[Array, "s"]]:
        """(m,) and (s,) curvatures at the places of friction and of thickness, about."""
        ...

    def admissible(self, point: Any, /) -> Bool[Array, ""]:
        """Whether the shape keeps above the lower bound, in step with itself and to the tool."""
        ...


@runtime_checkable
class AnyProblem(Minimisable, Protocol):
    """A posed squash of any scheme: :class:`.Problem` or :class:`.SplineProblem`."""

    @property
    def material(self) -> Any:
        """The energy's constants."""
        ...

    @property
    def shift(self) -> Float[Array, "N"]:
        """(N,) what fixed unknowns are, over their values at rest."""
        ...

    @property
    def unknown_name(self) -> str:
        """What the unknowns are: "heights" or "coefficients"."""
        ...

    @property
    def unknown_shape(self) -> tuple[int, ...]:
        """(N,), the shape of what the energy takes."""
        ...

    def point(self, unknowns: Float[Array, "N"], /) -> Any:
        """Heights (n+1,), in the clay's length unit, or coefficients (N,) as a displaced shape."""
        ...

    def terms(self, point: Any, /) -> Any:
        """E_total's four terms."""
        ...

    def free_terms(self, point: Any, /) -> Any:
        """The same over what touches a free unknown: their sum is E_free."""
        ...


def no_forces(problem: Minimisable) -> Forces:
    """Zero multipliers."""
    xp = namespace(problem.friction_limit)
    return Forces(xp.zeros_like(problem.friction_limit), xp.zeros_like(problem.floor))


def lifted(problem: AnyProblem, point: AnyDisplaced) -> AnyDisplaced:
    """The point moved no further than needed for every slice to reach the lower bound."""
    xp = namespace(problem.shift, point)
    low = problem.loose & (point.thickness < problem.floor)
    if xp is np and not low.any():
        return point
    even = problem.evened(point, 1.0).thickness
    gained = xp.where(low, even - point.thickness, 1.0)
    fraction = xp.where(low, (problem.floor - point.thickness) / gained, 0.0)
    return problem.evened(point, xp.clip(xp.max(fraction), 0.0, 1.0))
