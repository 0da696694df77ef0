"""Solution: an answer with its status and its certificate."""

from __future__ import annotations

import dataclasses
import enum
from typing import Any, NamedTuple

import jax.numpy as jnp

from jaxclay._host import pytree
from jaxclay.certificate import Certificate, Forces
from jaxclay.clay import Array
from jaxclay.energy import Terms
from jaxclay.resolution import resolvable_slices
from jaxclay.scm import RoughShape


class Status(enum.IntEnum):
    """How a solve ended.

    Attributes
    ----------
    CONVERGED
        The certificate accepts the answer as a local minimum.
    STALLED
        The method found nothing better, and the certificate does not accept it.
    ITERATION_LIMIT
        It was ended by ``max_iterations``.
    NON_FINITE
        It left the finite numbers.
    INFEASIBLE
        A held end leaves less room than the thickness floor needs.
    UNRESOLVED
        float64 cannot resolve bending on this grid, or the mesh not the shape.
    """

    CONVERGED = 0
    STALLED = 1
    ITERATION_LIMIT = 2
    NON_FINITE = 3
    INFEASIBLE = 4
    UNRESOLVED = 5

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ").replace("non finite", "non-finite")


class Verdict(NamedTuple):
    """What the judge makes of an outcome; ``clay`` may be its arrays."""

    clay: Any
    point: Any
    terms: Terms
    certificate: Certificate
    code: Array


def status_code(
    finished: Array, accepted: Array, finite: Array, feasible: Array, hidden: Array
) -> Array:
    """The status of an outcome; ``hidden`` where float64 could not resolve it."""
    code = jnp.where(finished, Status.STALLED.value, Status.ITERATION_LIMIT.value)
    code = jnp.where(hidden, Status.UNRESOLVED.value, code)
    code = jnp.where(accepted, Status.CONVERGED.value, code)
    code = jnp.where(finite, code, Status.NON_FINITE.value)
    return jnp.where(feasible, code, Status.INFEASIBLE.value)


_MEANING = {
    Status.CONVERGED: "the certificate accepts the answer as a local minimum",
    Status.STALLED: "the method stopped by its own rule at a point that the certificate refuses; "
    "another method, a finer step or a tighter tolerance may go on from it",
    Status.ITERATION_LIMIT: "the iteration limit came first; raise max_iterations or start nearer",
    Status.NON_FINITE: "the energy or the step became infinite or not a number; the last finite "
    "shape is kept. Check the material's constants against the clay's size",
    Status.UNRESOLVED: "so many slices that float64 cannot resolve the bending term: rounding "
    "hides how softly the clay gives way",
    Status.INFEASIBLE: "no shape obeys the thickness floor: the held end leaves too little room. "
    "Lower top, lower material.floor or let the upper end free",
}


@pytree
@dataclasses.dataclass(frozen=True, eq=False)
class Solution:
    """An answer with its certificate.

    Attributes
    ----------
    clay : Clay
        The shape, ready for the next squash.
    point : Point
        The same over l, as solvers hold it.
    energy, terms : float, Terms
        E_total and its four terms (eq. 9).
    iterations : int
        Newton or L-BFGS iterations, greedy's sweeps; on the last grid.
    levels : (g,) int array
        Iterations on the coarser grids that were solved first, coarse to fine.
    certificate : Certificate
        The judge's findings; ``certificate.energy_free`` is E_free.
    forces : Forces
        The method's multipliers, from which a squash close by can start.
    rough : RoughShape
        What the sliced cylinder model says of the squash.
    problem : Problem or SplineProblem
    method : str
    status_code : int
        See :attr:`status`.
    error_estimate : float or None
        Estimate of the contour's error over l where a tolerance was asked for.
    """

    clay: Any
    point: Any
    energy: Array
    terms: Terms
    iterations: Array
    levels: Array
    certificate: Certificate
    forces: Forces
    rough: RoughShape
    problem: Any
    status_code: Array
    error_estimate: Array | None
    method: str = dataclasses.field(metadata={"static": True})

    @property
    def before(self) -> Any:
        """The clay before the squash, on its own nodes where those are known."""
        before = getattr(self.problem, "before", None)
        return self.problem.clay if before is None else before

    @property
    def heights(self) -> Array:
        """(n+1,) Y_i, in the clay's length unit."""
        return self.clay.heights

    @property
    def unknowns(self) -> Array:
        """How many heights or coefficients were free."""
        return self.problem.unknowns

    @property
    def status(self) -> Status:
        """How the solve ended; CONVERGED only where the certificate accepts."""
        return Status(int(self.status_code))

    @property
    def message(self) -> str:
        """The status, what it means and what to do."""
        text = f"{self.method}: {self.status}: {_MEANING[self.status]}"
        on_slices = hasattr(self.problem, "slices")
        if self.status is Status.UNRESOLVED and self.error_estimate is not None:
            return (
                f"{self.method}: unresolved: the tolerance cannot be reached; the estimate of the "
                f"contour's error is {float(self.error_estimate):.2g}. Ask for a larger tolerance"
            )
        if self.status is Status.UNRESOLVED and not on_slices:
            return (
                f"{self.method}: unresolved: the spans are so long that Y_u is negative between "
                "the points that see the floor, which is no shape: give more elements"
            )
        if self.status is Status.UNRESOLVED:
            most = resolvable_slices(self.problem)
            return f"{text}. Use at most {most} slices for this clay and material"
        if self.status is Status.INFEASIBLE:
            return f"{text}. {self._lack_of_room()}"
        return text

    def _lack_of_room(self) -> str:
        room, least = (float(value) for value in self.problem.room())
        return f"Above top are {room:.6g}, and the clay there needs {least:.6g} at least"

    def raise_for_status(self) -> Solution:
        """The solution itself if it converged.

        Raises
        ------
        RuntimeError
            If it did not; the message names cause and cure.
        """
        if self.status is not Status.CONVERGED:
            raise RuntimeError(self.message)
        return self

    def _repr_html_(self) -> str:
        from jaxclay._html import solution_html

        return solution_html(self)
