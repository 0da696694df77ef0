"""The certified minima that answers are measured against, from another method than theirs."""

from __future__ import annotations

import functools
from typing import NamedTuple

from jaxclay.clay import Clay, Material
from jaxclay.contour import contour_error
from jaxclay.minimize import Solution, deform, minimize
from jaxclay.problem import Problem
from jaxclay.smooth_clay import SmoothClay
from jaxclay.squash import Squash
from jaxclay.sweep.batched import minimized
from jaxclay.sweep.recipe import Recipe

_FINE = 512  # slices from which a profile becomes a function
_EARLIER = 1e-5  # tolerance of the squashes before the last
_GOOD_ENOUGH = 10.0  # error estimate of a reference over the tolerance it was asked for
_KEPT = 1024
REFEREE = "lbfgs-preconditioned"  # of newton, on both schemes
_SAME = 1e-8  # of E_free: energies of the same minimum


def referee(method: str) -> str:
    """Whose certified minimum a method's gap is measured from, never its own."""
    return REFEREE if method == "newton" else "newton"


@functools.lru_cache(maxsize=_KEPT)
def posed(recipe: Recipe, slices: int, scheme: str = "paper") -> Problem:
    """The last squash, posed on the paper's scheme or on second-order slices.

    Raises
    ------
    ValueError, RuntimeError
        Why the scene cannot be posed, or an earlier squash not be solved, on this grid.
    """
    return recipe.scene().problems(recipe.units, slices, scheme)[-1]


Posed = tuple[Recipe, int, str]  # what is posed, on how many slices of which scheme
_minima: dict[tuple[str, Recipe, int, str], Solution] = {}


def certified_minima(wanted: list[Posed], method: str) -> list[Solution | None]:
    """The referee's answers for scenes that can be posed, None where it is not certified."""
    judge = referee(method)
    # A worker of dask may have several threads: what they share is read once.
    known = {one: _minima.get((judge, *one)) for one in wanted}
    new = [one for one, answer in known.items() if answer is None]
    for size in {one[1:] for one in new}:
        same = [one for one in new if one[1:] == size]
        answers = minimized([posed(*one) for one in same], judge, [{}] * len(same))
        known.update(zip(same, answers, strict=True))
    if len(_minima) > _KEPT:
        _minima.clear()
    _minima.update({(judge, *one): answer for one, answer in known.items() if answer})
    found = [known[one] for one in wanted]
    return [answer if answer and bool(answer.certificate.accepted) else None for answer in found]


def function_of(recipe: Recipe) -> tuple[Clay | SmoothClay, Squash, Material]:
    """The last squash as :func:`jaxclay.deform` takes it for splines: clay, squash, material.

    Raises
    ------
    ValueError, RuntimeError
        Why an earlier squash could not be solved.
    """
    scene = recipe.scene()
    clay, material = scene.clay(_FINE), scene.material(recipe.units)
    for squash in scene.squashes[:-1]:
        clay = deform(clay, squash, material, tolerance=_EARLIER).raise_for_status().clay
    return clay, scene.squashes[-1], material


class Truth(NamedTuple):
    """The continuum's minimum, and whose it is, in words."""

    answer: Solution
    judge: str


@functools.lru_cache(maxsize=_KEPT)
def true_minimum(recipe: Recipe, tolerance: float) -> Truth | None:
    """The continuum's minimum by splines to ``tolerance``; None where it is not certified.

    Newton finds the mesh, another method the minimum on it, from a cold start.  Where that one
    stalls beside newton's, which the certificate accepts, it confirms newton's.
    """
    try:
        mesh = deform(*function_of(recipe), tolerance=tolerance)
    except (ValueError, RuntimeError):
        return None
    estimate = mesh.error_estimate
    if estimate is None or float(estimate) > _GOOD_ENOUGH * tolerance:
        return None
    other = minimize(mesh.problem, REFEREE)
    if bool(other.certificate.accepted):
        return Truth(other, f"{REFEREE} on splines to {tolerance:g}")
    apart = abs(float(other.energy) - float(mesh.energy))
    same = apart <= _SAME * float(mesh.certificate.energy_free)
    same = same and contour_error(other.clay, mesh.clay) <= tolerance
    if same and bool(mesh.certificate.accepted):
        return Truth(mesh, f"newton on splines to {tolerance:g}, confirmed by {REFEREE}")
    return None
