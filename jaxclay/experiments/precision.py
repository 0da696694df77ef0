"""What float32 makes of a scene.

The public functions compute in float64 and refuse float32; the pure ones beneath
follow the dtype of their arguments.  Run on float32 arrays they show why.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import jax
import numpy as np

from jaxclay.methods.choice import method_settings
from jaxclay.methods.loop import Outcome, initial_guess, solve
from jaxclay.numerics.arrays import Array
from jaxclay.schemes.base import Forces
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.rough import rough_shape
from jaxclay.schemes.sums import Displaced
from jaxclay.solve.certificate import Certificate, certify
from jaxclay.solve.minimize import conclude
from jaxclay.solve.solution import Solution

T = TypeVar("T")
SINGLE = "float32"


def rounded(tree: T) -> T:
    """Every number as float32."""

    def convert(leaf):
        array = np.asarray(leaf)
        return array.astype(np.float32) if array.dtype.kind in "fiu" else array

    return jax.tree.map(convert, tree)


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


def solve_in_single(
    problem: Problem, method: str, settings: dict[str, Any]
) -> tuple[Callable[[], Outcome], Callable[[Outcome], Solution]]:
    """The method's loop in float32, from the rough shape; and its answer, certified in float64."""
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

    return call, certified


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
    with jax.enable_x64(True):
        _, exact = jax.tree.map(np.asarray, _derivative(problem, minimum.point))
    with jax.enable_x64(False):
        arguments = rounded((problem, minimum.point))
        energy, gradient = jax.tree.map(np.asarray, _derivative(*arguments))
        verdict = _certified(*arguments, rounded(minimum.forces))
        decrement = float(verdict.decrement) / float(verdict.energy_free)
    error = np.abs(gradient - exact).max() * problem.slices / (float(m.mu) + float(m.k))
    relative = abs(float(energy) / float(minimum.energy) - 1)
    return Rounding(relative, float(error), decrement)


@jax.jit
def _derivative(problem: Problem, point: Displaced) -> tuple[Array, Array]:
    return problem.terms(point).total, problem.system.gradient(point)


@jax.jit
def _certified(problem: Problem, point: Displaced, forces: Forces) -> Certificate:
    return certify(problem.system, point, forces)
