"""Solution: an answer with its status and its certificate."""

from __future__ import annotations

import dataclasses
import enum
import math
from typing import Any, NamedTuple

import numpy as np

from jaxclay.clay import text
from jaxclay.methods.loop import Outcome
from jaxclay.model.energy import Terms
from jaxclay.numerics.arrays import Array, Bool, Float, Int, Scalar, Shaped, namespace
from jaxclay.numerics.checks import Hindrance
from jaxclay.numerics.host import is_concrete, kept, pytree
from jaxclay.schemes.base import Forces
from jaxclay.schemes.resolution import resolvable_slices
from jaxclay.schemes.rough import RoughShape, rough_shape
from jaxclay.schemes.slices.edges import with_edges
from jaxclay.solve.certificate import Certificate
from jaxclay.solve.html import solution_html


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
        A held end leaves less room than the lower bound of thickness needs.
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


_NAMES = {status.value: str(status) for status in Status}


def shape_of(problem: Any, point: Any) -> Any:
    """The clay of a point on slices, with the edges of tools that it keeps."""
    clay = problem.shape(point)
    if problem.before is None or not is_concrete(clay):
        return clay
    return with_edges(clay, problem, point.shift)


def status_code(
    finished: Bool[Array, ""],
    accepted: Bool[Array, ""],
    finite: Bool[Array, ""],
    feasible: Bool[Array, ""],
    hidden: Bool[Array, ""],
) -> Int[Array, ""]:
    """The status of an outcome; ``hidden`` where float64 could not resolve it."""
    xp = namespace(finished, accepted, finite, feasible, hidden)
    code = xp.where(finished, Status.STALLED.value, Status.ITERATION_LIMIT.value)
    code = xp.where(hidden, Status.UNRESOLVED.value, code)
    code = xp.where(accepted, Status.CONVERGED.value, code)
    code = xp.where(finite, code, Status.NON_FINITE.value)
    return xp.where(feasible, code, Status.INFEASIBLE.value)


_MEANING = {
    Status.CONVERGED: "the certificate accepts the answer as a local minimum",
    Status.STALLED: "the method stopped by its own rule at a point that the certificate refuses; "
    "another method, a finer step or a tighter tolerance may go on from it",
    Status.ITERATION_LIMIT: "the iteration limit came first; raise max_iterations or start nearer",
    Status.NON_FINITE: "the energy or the step became infinite or not a number; the last finite "
    "shape is kept. Check the material's constants against the clay's size, and that the method "
    "keeps thicknesses positive",
    Status.UNRESOLVED: "so many slices that float64 cannot resolve the bending term: rounding "
    "hides how softly the clay gives way",
    Status.INFEASIBLE: "no shape obeys the lower bound of thickness: the held end leaves too "
    "little room. Lower top, lower material.floor or let the upper end free",
}


class Derived(NamedTuple):
    """What follows from a solution's problem and point, where it is there already."""

    clay: Any
    terms: Terms
    rough: RoughShape


@pytree
@dataclasses.dataclass(frozen=True, eq=False)
class Solution:
    """An answer, a minimum of E_total (eq. 9), with its certificate.

    Attributes
    ----------
    problem : Problem or SplineProblem
    point : Displaced
        The shape over l, as solvers hold it.
    forces : Forces
        The method's multipliers, from which a squash close by can start.
    iterations : int
        Newton or L-BFGS iterations, greedy's sweeps; of the last solve.
    levels : (g,) int array
        Iterations of the solves before it, from which it was placed and started.
    certificate : Certificate
        What the certificate found; ``certificate.energy_free`` is E_free.
    status_code : int
        See :attr:`status`.
    error_estimate : float or None
        Estimate of the contour's error over l where a tolerance was asked for.
    derived : Derived or None
        None on the host, where that is built when it is asked for.
    method : str
    """

    problem: Any
    point: Any
    forces: Forces
    iterations: Scalar
    levels: Shaped[Array, "g"]
    certificate: Certificate
    status_code: Int[Array, ""]
    error_estimate: Scalar | None = None
    derived: Derived | None = None
    method: str = dataclasses.field(default="newton", metadata={"static": True})

    @kept
    def clay(self) -> Any:
        """The shape, ready for the next squash."""
        return shape_of(self.problem, self.point) if self.derived is None else self.derived.clay

    @kept
    def terms(self) -> Terms:
        """E_total's four terms (eq. 9)."""
        return self.problem.terms(self.point) if self.derived is None else self.derived.terms

    @property
    def energy(self) -> Float[Array, "..."]:
        """E_total (eq. 9)."""
        return self.terms.total

    @kept
    def rough(self) -> RoughShape:
        """What the sliced cylinder model says of the squash."""
        return rough_shape(self.problem) if self.derived is None else self.derived.rough

    @property
    def before(self) -> Any:
        """The clay before the squash, on its own nodes where those are known."""
        before = getattr(self.problem, "before", None)
        return self.problem.clay if before is None else before

    @property
    def heights(self) -> Float[Array, "... nodes"]:
        """(n+1,) Y_i, in the clay's length unit."""
        return self.clay.heights

    @property
    def unknowns(self) -> Shaped[Array, ""]:
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
            error = float(self.error_estimate)
            known = (
                f"the estimate of the contour's error is {error:.2g}. Ask for a tolerance of "
                f"{1.1 * error:.2g}"
                if math.isfinite(error)
                else "no two answers are close enough to say how far off this one is. Give "
                f"slices={self.problem.slices} instead of a tolerance"
            )
            return (
                f"{self.method}: unresolved: the tolerance cannot be reached; {known}, or use this "
                "clay as it is"
            )
        if self.status is Status.UNRESOLVED and not on_slices:
            return (
                f"{self.method}: unresolved: the spans are so long that Y_u is negative between "
                "the points that see the lower bound, which is no shape: give more elements"
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
            raise Hindrance(self.message)
        return self

    def __repr__(self) -> str:
        say, code = text.figure, text.known(self.status_code)
        told = code is not None and code.ndim == 0 and is_concrete(self)
        error = self.error_estimate
        within = "" if error is None else f", contour within {say(error, '.2g')} l"
        lines = [
            "Solution by "
            + (self.message if told else f"{self.method}: {text.named(self.status_code, _NAMES)}"),
            self.certificate.gain,
            f"{text.free(self.problem.fixed)} unknowns, {say(self.iterations)} iterations{within}",
        ]
        if self.derived is not None or text.known(self.point.shift) is not None:
            terms = [f"{name} {say(value, '.4g')}" for name, value in self.terms._asdict().items()]
            lines.insert(1, f"E_total {say(self.energy)} = {' + '.join(terms)}")
            lines.append(f"clay: {text.dimensions(self.clay)}")
        return text.lines(*lines)

    def _repr_html_(self) -> str:
        return solution_html(self)


def concluded(
    problem: Any, outcome: Outcome, certificate: Certificate, feasible: Array, hidden: Array,
    method: str, derived: Derived | None = None,
) -> Solution:  # fmt: skip
    """The answer as users see it, of any scheme; ``hidden`` where it could not be resolved."""
    xp = namespace(outcome.point, feasible)
    finite = outcome.finite & xp.isfinite(certificate.energy_free + problem.band_terms.total)
    code = status_code(outcome.finished, certificate.accepted, finite, feasible, hidden)
    return Solution(
        problem=problem,
        point=outcome.point,
        forces=outcome.forces,
        iterations=outcome.iterations,
        levels=np.zeros(0, int),
        certificate=dataclasses.replace(certificate, accepted=code == Status.CONVERGED.value),
        status_code=code,
        derived=derived,
        method=method,
    )
