"""E_total and its terms as functions of a problem and its unknowns.

On the paper's scheme these are the heights Y_i (n+1,), in the clay's length unit,
with X_i from eq. 22; on the scheme "spline" the coefficients (N,) of the
displacement, over the unit l.  All can be compiled and differentiated.
"""

from __future__ import annotations

import numpy as np

from jaxclay.model.energy import Terms
from jaxclay.numerics.arrays import Array, Float
from jaxclay.numerics.host import compiled, in_float64, is_transformed, promoting
from jaxclay.schemes.base import AnyProblem


@promoting
def energy_terms(problem: AnyProblem, unknowns: Array) -> Terms:
    """The four terms of E_total (eqs. 4, 5, 8, 9), scalars without a unit.

    Parameters
    ----------
    problem : Problem or SplineProblem
        From :func:`jaxclay.pose`.
    unknowns : (n+1,) or (N,) array
        Heights Y_i, in the clay's length unit, or a spline's coefficients.

    Raises
    ------
    ValueError
        Unknowns of another shape.
    """
    expected = problem.unknown_shape
    if np.shape(unknowns) != expected:
        raise ValueError(
            f"{problem.unknown_name} must have shape {expected}, got {np.shape(unknowns)}"
        )
    if is_transformed(problem, unknowns):
        return problem.terms(problem.point(unknowns))
    return in_float64("energy_terms", _terms, problem, unknowns)


def total_energy(problem: AnyProblem, unknowns: Array) -> Float[Array, ""]:
    """E_total (eq. 9) as a function of the heights Y_i, or of a spline's coefficients.

    A scalar without a unit; arguments and errors are those of :func:`energy_terms`.
    Called from the host it computes in float64; inside a transformation it
    follows the dtype of its arguments and can be compiled and differentiated.
    """
    return energy_terms(problem, unknowns).total


def strain_energy(problem: AnyProblem, unknowns: Array) -> Float[Array, ""]:
    """h sum k/2 (Y_u / Y0_u - 1)^2 (eq. 4), no unit; arguments as :func:`energy_terms`."""
    return energy_terms(problem, unknowns).strain


def friction_energy(problem: AnyProblem, unknowns: Array) -> Float[Array, ""]:
    """h sum mu |Y_i - Y0_i| (eq. 5), no unit; arguments as :func:`energy_terms`."""
    return energy_terms(problem, unknowns).friction


def tension_energy(problem: AnyProblem, unknowns: Array) -> Float[Array, ""]:
    """h sum alpha (X_u^2 + Y_u^2) (eq. 8), no unit; arguments as :func:`energy_terms`."""
    return energy_terms(problem, unknowns).tension


def bending_energy(problem: AnyProblem, unknowns: Array) -> Float[Array, ""]:
    """h sum beta (X_uu^2 + Y_uu^2) (eq. 8), no unit; arguments as :func:`energy_terms`."""
    return energy_terms(problem, unknowns).bending


@compiled()
def _terms(problem: AnyProblem, unknowns: Array) -> Terms:
    return problem.terms(problem.point(unknowns))
