"""minimize and deform: one loop for all methods, one status, one certificate."""

from __future__ import annotations

import dataclasses
import enum
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay._host import in_float64, is_concrete, is_transformed, pytree
from jaxclay.certificate import Certificate, certify, slack
from jaxclay.clay import Array, Clay, Material
from jaxclay.energy import Terms
from jaxclay.implicit import solve_implicitly
from jaxclay.loop import Outcome, solve
from jaxclay.methods import METHODS
from jaxclay.problem import Problem, pose
from jaxclay.schemes.paper import Point
from jaxclay.scm import RoughShape, rough_shape
from jaxclay.squash import Squash


class Status(enum.IntEnum):
    """How a solve ended."""

    CONVERGED = 0
    STALLED = 1
    ITERATION_LIMIT = 2
    NON_FINITE = 3
    INFEASIBLE = 4

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ").replace("non finite", "non-finite")


_MEANING = {
    Status.CONVERGED: "the certificate accepts the answer as a local minimum",
    Status.STALLED: "the method stopped by its own rule at a point that the certificate refuses; "
    "another method, a finer step or a tighter tolerance may go on from it",
    Status.ITERATION_LIMIT: "the iteration limit came first; raise max_iterations or start nearer",
    Status.NON_FINITE: "the energy or the step became infinite or not a number; the last finite "
    "shape is kept. Check the material's constants against the clay's size",
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
    energy, terms : float, Terms
        E_total and its four terms (eq. 9).
    iterations : int
        Newton or L-BFGS iterations, greedy's sweeps.
    certificate : Certificate
        The judge's findings; ``certificate.energy_free`` is E_free.
    rough : RoughShape
        What the sliced cylinder model says of the squash.
    problem : Problem
    method : str
    status_code : int
        See :attr:`status`.
    error_estimate : None
        Not known on the paper's scheme.
    """

    clay: Clay
    energy: Array
    terms: Terms
    iterations: Array
    certificate: Certificate
    rough: RoughShape
    problem: Problem
    status_code: Array
    error_estimate: Array | None
    method: str = dataclasses.field(metadata={"static": True})

    @property
    def heights(self) -> Array:
        """(n+1,) Y_i, in the clay's length unit."""
        return self.clay.heights

    @property
    def unknowns(self) -> Array:
        """How many heights were free."""
        return self.problem.unknowns

    @property
    def status(self) -> Status:
        """How the solve ended; CONVERGED only where the certificate accepts."""
        return Status(int(self.status_code))

    @property
    def message(self) -> str:
        """The status, what it means and what to do."""
        text = f"{self.method}: {self.status}: {_MEANING[self.status]}"
        if self.status is not Status.INFEASIBLE:
            return text
        problem, unit = self.problem, float(self.clay.unit)
        nodes = np.arange(problem.slices + 1) / problem.slices
        upper = np.interp(problem.band.upper, nodes, problem.rest.heights)
        least = float(problem.material.floor) * float(problem.rest.heights[-1] - upper) * unit
        room = float(problem.rest.heights[-1] - problem.tool.top) * unit
        return f"{text}. Above top are {room:.6g}, and the clay there needs {least:.6g} at least"

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


def deform(
    clay: Clay, squash: Squash, material: Material, method: str = "newton", **settings: Any
) -> Solution:
    """Squash the clay: pose, rough shape, minimum of E_total.

    Takes what :func:`pose` and :func:`minimize` take and raises what they raise.
    """
    return minimize(pose(clay, squash, material), method, **settings)


def minimize(
    problem: Problem, method: str = "newton", start: Array | None = None, **settings: Any
) -> Solution:
    """Minimise E_total over the free heights.

    Inside ``grad`` and its kin the derivative is the minimum's, from the implicit
    function theorem, not the iterations'.

    Parameters
    ----------
    problem : Problem
        From :func:`pose`.
    method : str
        A key of :data:`jaxclay.METHODS`.
    start : (n+1,) array, optional
        Heights to start from, in the clay's length unit; the rough shape if
        not given.  The band's nodes are put where the tool wants them.
    **settings
        The method's own: see ``jaxclay.METHODS[method].settings``.

    Raises
    ------
    ValueError
        Unknown method or setting, a setting out of its range, a start of the
        wrong length, out of order or below the thickness floor.
    TypeError
        Inside a JAX transformation while float64 is off.
    """
    chosen = method_settings(method, settings)
    rough = rough_shape(problem)
    point = rough.point if start is None else start_from(problem, start)
    arguments = (problem, point, chosen, rough.feasible)
    call = solve_implicitly if is_transformed(*arguments) else solve
    outcome = in_float64("minimize", partial(call, method=method), *arguments)
    return conclude(problem, rough, outcome, method)


def conclude(problem: Problem, rough: RoughShape, outcome: Outcome, method: str) -> Solution:
    """Judge where a method ended, and say so."""
    clay, terms, certificate, code = in_float64(
        "minimize", _judge, problem, outcome, rough.feasible
    )
    return Solution(
        clay=clay,
        energy=terms.total,
        terms=terms,
        iterations=outcome.iterations,
        certificate=certificate,
        rough=rough,
        problem=problem,
        status_code=code,
        error_estimate=None,
        method=method,
    )


def method_settings(method: str, settings: dict[str, Any]) -> Any:
    """The method's settings, defaults filled in; errors name what is allowed."""
    if not isinstance(method, str) or method not in METHODS:
        raise ValueError(f"unknown method {method!r}: choose from {', '.join(METHODS)}")
    kind = METHODS[method].settings
    known = [field.name for field in dataclasses.fields(kind)]
    for name in settings:
        if name not in known:
            raise ValueError(f"{method} has no setting {name!r}: it takes {', '.join(known)}")
    return kind(**settings)


def start_from(problem: Problem, heights: Array) -> Point:
    """The caller's heights as a point that obeys the tool."""
    if is_concrete(heights):
        heights = np.asarray(heights, np.float64)
    if np.shape(heights) != np.shape(problem.clay.heights):
        raise ValueError(
            f"start must hold one height for each of {problem.slices + 1} nodes: got shape "
            f"{np.shape(heights)}"
        )
    point, room = in_float64("minimize", _imposed, problem, heights)
    if is_concrete(problem, heights) and not is_transformed(point):
        if not np.isfinite(heights).all() or (np.diff(heights) <= 0).any():
            raise ValueError("start must be finite and increase from node to node")
        if (room < -1e-9 * problem.rest.thickness).any():
            i = int(np.argmin(room / problem.rest.thickness))
            raise ValueError(
                f"start, with the band where the tool wants it, makes slice {i} "
                f"{point.thickness[i] / problem.rest.thickness[i]:.3g} times as thick as before: "
                f"at least {float(problem.material.floor):g} (material.floor) is allowed"
            )
    return point


@jax.jit
def _imposed(problem: Problem, heights: Array) -> tuple[Point, Array]:
    point = problem.imposed(problem.point(heights))
    return point, slack(problem, point)


@jax.jit
def _judge(problem: Problem, outcome: Outcome, feasible: Array):
    """The shape, its terms, its certificate and the status code."""
    rest = Point(problem.rest.thickness, jnp.zeros_like(problem.shift))
    point = jax.tree.map(lambda a, b: jnp.where(feasible, a, b), outcome.point, rest)
    terms = problem.terms(point)
    certificate = certify(*jax.lax.stop_gradient((problem, point, outcome.forces)))
    finite = outcome.finite & jnp.isfinite(terms.total)
    code = jnp.where(outcome.finished, Status.STALLED.value, Status.ITERATION_LIMIT.value)
    code = jnp.where(certificate.accepted, Status.CONVERGED.value, code)
    code = jnp.where(finite, code, Status.NON_FINITE.value)
    code = jnp.where(feasible, code, Status.INFEASIBLE.value)
    accepted = code == Status.CONVERGED.value
    certificate = dataclasses.replace(certificate, accepted=accepted)
    return problem.shape(point), terms, certificate, code
