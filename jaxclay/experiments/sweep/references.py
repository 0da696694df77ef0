"""The certified minima that answers are measured against, from another method than theirs."""

from __future__ import annotations

import functools
from typing import Any

from jaxclay.clay.clay import Clay
from jaxclay.experiments.sweep.batched import minimized
from jaxclay.experiments.sweep.recipe import Recipe
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash, check_fits
from jaxclay.numerics.checks import REFUSALS
from jaxclay.schemes.posing import pose
from jaxclay.schemes.problem import Problem
from jaxclay.solve.minimize import deform, minimize
from jaxclay.solve.solution import Solution

_FINE = 512  # slices of the clay that splines start from, and of its earlier squashes
_KEPT = 1024
REFEREE = "lbfgs-preconditioned"  # of newton, on all schemes


def reference_method(method: str) -> str:
    """Whose certified minimum a method's gap is measured from, never its own."""
    return REFEREE if method == "newton" else "newton"


@functools.lru_cache(maxsize=_KEPT)
def posed(recipe: Recipe, slices: int, scheme: str = "paper") -> Problem:
    """The last squash, posed on the paper's scheme or on second-order slices.

    Raises
    ------
    ValueError, Hindrance
        Why the scene cannot be posed, or an earlier squash not be solved, on this grid.
    """
    return recipe.scene().problems(recipe.units, slices, scheme)[-1]


Posed = tuple[Recipe, int, str]  # what is posed, on how many slices of which scheme
_minima: dict[tuple[str, Recipe, int, str], Solution] = {}


def certified_minima(wanted: list[Posed], method: str) -> list[Solution | None]:
    """The reference method's answers for scenes that can be posed, None if not certified."""
    other = reference_method(method)
    # A worker of dask may have several threads: what they share is read once.
    known = {one: _minima.get((other, *one)) for one in wanted}
    new = [one for one, answer in known.items() if answer is None]
    for size in {one[1:] for one in new}:
        same = [one for one in new if one[1:] == size]
        answers = minimized([posed(*one) for one in same], other, [{}] * len(same))
        known.update(zip(same, answers, strict=True))
    if len(_minima) > _KEPT:
        _minima.clear()
    _minima.update({(other, *one): answer for one, answer in known.items() if answer})
    found = [known[one] for one in wanted]
    return [answer if answer and bool(answer.certificate.accepted) else None for answer in found]


def _last(recipe: Recipe, slices: int) -> tuple[Clay, Squash, Material]:
    """The last squash and the clay before it, earlier ones solved on so many placed slices.

    Raises
    ------
    ValueError, Hindrance
        Why an earlier squash could not be solved.
    """
    scene = recipe.scene()
    clay, material = scene.clay(slices), scene.material(recipe.units)
    for squash in scene.squashes[:-1]:
        clay = deform(clay, squash, material).raise_for_status().clay
    return clay, scene.squashes[-1], material


def whole(recipe: Recipe) -> tuple[Clay, Squash, Material]:
    """The last squash and fine clay before it; raises as :func:`posed`."""
    clay, squash, material = _last(recipe, _FINE)
    check_fits(squash, clay)
    return clay, squash, material


@functools.lru_cache(maxsize=_KEPT)
def on_spans(recipe: Recipe, elements: int) -> Any:
    """The last squash posed on splines; raises as :func:`posed`."""
    return pose(*_last(recipe, _FINE), "spline", elements=elements)


@functools.lru_cache(maxsize=_KEPT)
def minimum_on_spans(recipe: Recipe, elements: int, method: str) -> Solution | None:
    """The reference method's answer on the same splines; None where it is not certified."""
    answer = minimize(on_spans(recipe, elements), reference_method(method))
    return answer if bool(answer.certificate.accepted) else None


@functools.lru_cache(maxsize=_KEPT)
def continuum(recipe: Recipe, slices: int) -> Clay | None:
    """What stands for the continuum's minimum: newton's on placed slices; None if not certified."""
    try:
        answer = deform(*_last(recipe, slices))
    except REFUSALS:
        return None
    return answer.clay if bool(answer.certificate.accepted) else None
