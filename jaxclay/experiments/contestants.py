"""Contestants: the methods, in float64 or float32, and peers from outside, behind one call.

:func:`prepare` hands a posed problem to one; what it returns can be called again and again, to be
timed, and says what an answer is worth.  jaxclay's public functions compute in float64 and refuse
float32; the pure ones beneath follow the dtype of their arguments, and show what float32 makes of
a scene.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import jax
import numpy as np

from jaxclay.experiments import peers
from jaxclay.experiments.peers import PEERS
from jaxclay.methods import METHODS
from jaxclay.methods.choice import method_settings
from jaxclay.methods.loop import Outcome, initial_guess, solve
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.host import as_float64
from jaxclay.schemes.base import Forces
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.rough import rough_shape
from jaxclay.schemes.sums import Displaced
from jaxclay.solve.certificate import Certificate, certify
from jaxclay.solve.minimize import conclude, minimize
from jaxclay.solve.solution import Solution

T = TypeVar("T")
SINGLE = "float32"
_TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
_FINER = (*_TOLERANCES[:-1], 1e-13)
_STEPS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)


class Contestant(NamedTuple):
    """Its looks, a colour of the palette first, and its ladder, a setting from loose to tight."""

    colour: int
    marker: str
    line: str = "-"
    ladder: tuple[float, ...] = _TOLERANCES
    setting: str = "tolerance"


# Those of the default comparison come first, and so never share a colour.
CONTESTANTS: dict[str, Contestant] = {
    "newton": Contestant(0, "o", ladder=(1.0, 1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-11, 1e-14)),
    "lbfgs": Contestant(1, "s"),
    "lbfgs-preconditioned": Contestant(2, "D"),
    "optax-lbfgs": Contestant(3, "^"),
    "greedy": Contestant(4, "v", ladder=_STEPS[:5], setting="step"),
    "greedy-refined": Contestant(5, "*", ladder=_STEPS[1:6], setting="smallest_step"),
    "lbfgsb": Contestant(6, "P", ladder=_FINER),
    "projected-gradient": Contestant(7, "X", ladder=_FINER),
    "augmented-lagrangian": Contestant(0, "p", "-."),
    "adam": Contestant(1, "h", "-.", ladder=_FINER),
    "lattice": Contestant(2, "<", "-.", ladder=_STEPS, setting="smallest_spacing"),
    "ipopt": Contestant(6, "*", "--"),
    "scipy-lbfgsb": Contestant(5, "X", "--"),
    "scipy-trust-constr": Contestant(4, "p", "--"),
    "optimistix-bfgs": Contestant(3, "h", "--"),
    "clarabel": Contestant(2, "<", "--"),
    "piqp": Contestant(1, ">", "--"),
}

DEFAULT = ("newton", "lbfgs", "lbfgs-preconditioned", "optax-lbfgs", "greedy", "greedy-refined")
"""What a comparison runs unless told otherwise."""


class Ready(NamedTuple):
    """A problem in a contestant's hands."""

    call: Callable[[], Any]  # what is timed; can be called again and again
    certified: Callable[[Any], Solution]  # what its answer is worth


def prepare(
    problem: Any,
    name: str,
    settings: dict[str, Any],
    precision: str = "float64",
    seconds: float | None = None,
) -> Ready:
    """Hand a posed problem to a contestant, up to the point where only solving is left.

    A method's call is :func:`jaxclay.minimize`, or its loop alone in float32.  ``seconds`` limits
    a peer's solve where it can be told.

    Raises ValueError: What the contestant cannot take.
    """
    if precision == SINGLE:
        if name in PEERS:
            raise ValueError(f"{name} computes in float64 alone")
        return _in_single(problem, name, settings)
    if name in PEERS:
        ready = peers.prepare(name, problem, seconds=seconds, **settings)
        return Ready(ready.solve, ready.certify)
    return Ready(lambda: minimize(problem, name, **settings), lambda answer: answer)


def checked_contestant(name: str) -> str:
    """The name; ValueError if it is unknown, ImportError where a peer's library is missing."""
    if name in PEERS:
        peers.checked(name)  # imports it, before threads are limited
    elif name not in METHODS:
        raise ValueError(f"unknown method {name!r}: choose from {', '.join((*METHODS, *PEERS))}")
    return name


def takes_splines(name: str) -> bool:
    """Whether it knows the scheme "spline"."""
    return name in METHODS and METHODS[name].splines


def contestant(name: str) -> Contestant:
    """Its looks and its ladder; a method that was added elsewhere has none of its own."""
    return CONTESTANTS.get(name, Contestant(7, ".", ladder=(), setting=""))


def rounded(tree: T) -> T:
    """Every number as float32."""
    return jax.tree.map(
        lambda leaf: leaf.astype(np.float32) if leaf.dtype == float else leaf, as_float64(tree)
    )


def widened(problem: Problem, outcome: Outcome) -> Outcome:
    """Where a float32 run ended, as float64 can certify it.

    Heights are added up from the thicknesses, which float32 holds best; what rests goes
    on resting and the tool's nodes are exact.  For squashes from the ground.
    """
    rest, point = problem.rest, outcome.point
    change = np.where(
        point.thickness == rounded(rest.thickness), 0.0, point.thickness - rest.thickness
    )
    change = np.where(problem.banded, problem.band_thickness - rest.thickness, change)
    shift = np.concatenate([[0.0], np.cumsum(change)])
    shift = np.where(problem.free, np.where(point.shift == 0, 0.0, shift), problem.shift)
    thickness = np.where(problem.banded, problem.band_thickness, rest.thickness + np.diff(shift))
    forces = jax.tree.map(lambda leaf: np.asarray(leaf, np.float64), outcome.forces)
    return outcome._replace(point=Displaced(thickness, shift), forces=forces)


def _in_single(problem: Problem, method: str, settings: dict[str, Any]) -> Ready:
    """The method's loop in float32, from the rough shape; its answer is certified in float64."""
    if problem.scheme != "paper" or bool(np.asarray(problem.loose)[0]):
        raise ValueError('float32 is for squashes from the ground on the scheme "paper"')
    rough, chosen = rough_shape(problem), method_settings(method, settings)
    with jax.enable_x64(False):
        arguments = (problem, initial_guess(problem, rough.point), chosen, rough.feasible)
        arguments = jax.device_put(rounded(arguments))

    def call() -> Outcome:
        with jax.enable_x64(False):
            return jax.block_until_ready(solve(*arguments, method=method))

    def certified(outcome: Outcome) -> Solution:
        outcome = jax.tree.map(np.asarray, outcome)
        return conclude(problem, rough, widened(problem, outcome), method)

    return Ready(call, certified)


class Rounding(NamedTuple):
    """What float32 says at a minimum found in float64."""

    energy: float  # relative error of E_total
    gradient: float  # largest error of its smooth part's gradient, over h (mu + k)
    # What the certificate reads, over E_free; inf where it sees no positive curvature.  In float64
    # it reads 1e-10 or less.
    decrement: float


def rounding_at(minimum: Solution) -> Rounding:
    """Energy, gradient and certificate in float32 at a minimum found in float64."""
    problem, m = minimum.problem, minimum.problem.material
    there = problem, minimum.point, minimum.forces
    with jax.enable_x64(True):
        _, exact, _ = jax.tree.map(np.asarray, _seen(*there))
    with jax.enable_x64(False):
        energy, gradient, verdict = jax.tree.map(np.asarray, _seen(*rounded(there)))
    error = np.abs(gradient - exact).max() * problem.slices / (float(m.mu) + float(m.k))
    relative = abs(float(energy) / float(minimum.energy) - 1)
    return Rounding(relative, float(error), float(verdict.decrement) / float(verdict.energy_free))


@jax.jit
def _seen(problem: Problem, point: Displaced, forces: Forces) -> tuple[Array, Array, Certificate]:
    """Energy, gradient and certificate."""
    system = problem.system
    return problem.terms(point).total, system.gradient(point), certify(system, point, forces)
