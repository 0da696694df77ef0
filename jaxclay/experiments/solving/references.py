"""The certified minima that answers are measured against, from another method than theirs."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple

from jaxclay.clay.clay import Clay
from jaxclay.clay.contour import contour_error
from jaxclay.experiments.entries.sizes import Discretisation
from jaxclay.experiments.entries.specification import Specification
from jaxclay.experiments.solving.batched import minimized
from jaxclay.experiments.solving.clock import compiled
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash, check_fits
from jaxclay.numerics.checks import REFUSALS
from jaxclay.schemes.posing import pose
from jaxclay.solve.minimize import deform, minimize
from jaxclay.solve.solution import Solution

_FINE = 512  # slices of the clay that splines and placed slices start from
_KEPT = 1024
_DENSE = 256  # slices beyond which only newton is a reference: the other's time goes as their cube
_OTHER = "lbfgs-preconditioned"  # newton's, on all schemes


def reference_method(method: str) -> str:
    """Whose certified minimum a method's gap is measured from, never its own."""
    return _OTHER if method == "newton" else "newton"


@functools.lru_cache(maxsize=_KEPT)
def posed(specification: Specification, size: Discretisation) -> Any:
    """The last squash, posed on a scheme whose slices or spans are known beforehand.

    Raises
    ------
    ValueError, Hindrance
        Why the scene cannot be posed, or an earlier squash not be solved, on this grid.
    """
    if size.scheme == "spline":
        clay, squash, material = last(specification, _FINE)
        how: dict[str, Any] = {"degree": size.degree, "elements": size.elements}
        return pose(clay, squash, material, "spline", **how)
    scene = specification.scene()
    return scene.problems(specification.units, size.slices, size.scheme)[-1]


Posed = tuple[Specification, Discretisation]
_minima: dict[tuple, Solution] = {}


def certified_minima(wanted: list[Posed], method: str) -> list[Solution | None]:
    """The reference method's answers on slices, many at once; None if not certified."""
    other = reference_method(method)
    # A worker of dask may have several threads: what they share is read once.
    known = {one: _minima.get((other, *one)) for one in wanted}
    new = [one for one, answer in known.items() if answer is None and _within(one[1], other)]
    for size in {one[1] for one in new}:
        same = [one for one in new if one[1] == size]
        answers = minimized([posed(*one) for one in same], other, [{}] * len(same))
        known.update(zip(same, answers, strict=True))
    if len(_minima) > _KEPT:
        _minima.clear()
    _minima.update({(other, *one): answer for one, answer in known.items() if answer})
    return [_accepted(known[one]) for one in wanted]


@functools.lru_cache(maxsize=_KEPT)
def certified_minimum(
    specification: Specification, size: Discretisation, method: str
) -> Solution | None:
    """The reference method's answer to one problem; None if not certified."""
    other = reference_method(method)
    if not _within(size, other):
        return None
    return minimum_of(posed(specification, size), method)


def minimum_of(problem: Any, method: str) -> Solution | None:
    """The same for a problem that an answer came with."""
    other = reference_method(method)
    slices = getattr(problem, "slices", 0) if problem.scheme != "spline" else 0
    if other == _OTHER and slices > _DENSE:
        return None
    answer, _ = compiled((other, problem.scheme, slices), lambda: minimize(problem, other))
    return _accepted(answer)


def _within(size: Discretisation, other: str) -> bool:
    return other != _OTHER or size.slices <= _DENSE


def _accepted(answer: Solution | None) -> Solution | None:
    return answer if answer is not None and bool(answer.certificate.accepted) else None


@functools.lru_cache(maxsize=_KEPT)
def last(specification: Specification, slices: int) -> tuple[Clay, Squash, Material]:
    """The last squash and the clay before it, earlier ones solved on so many placed slices.

    Raises
    ------
    ValueError, Hindrance
        Why an earlier squash could not be solved; a squash above the clay.
    """
    scene = specification.scene()
    clay, material = scene.clay(slices), scene.material(specification.units)
    for squash in scene.squashes[:-1]:
        clay = deform(clay, squash, material).raise_for_status().clay
    check_fits(scene.squashes[-1], clay)
    return clay, scene.squashes[-1], material


def whole(specification: Specification) -> tuple[Clay, Squash, Material]:
    """The last squash and fine clay before it; raises as :func:`last`."""
    return last(specification, _FINE)


class Continuum(NamedTuple):
    """The contour that stands for the continuum's minimum, and about how far it is off, over l."""

    clay: Clay
    error: float


@functools.lru_cache(maxsize=_KEPT)
def continuum(specification: Specification, slices: int) -> Continuum | None:
    """Newton's answer on placed slices; None if it is not certified.

    Of second order: its error is about a third of the way from the answer on half as many.
    """
    try:
        piece = last(specification, slices)
        half, full = (deform(*piece, slices=n) for n in (slices // 2, slices))
    except REFUSALS:
        return None
    if _accepted(half) is None or _accepted(full) is None:
        return None
    return Continuum(full.clay, contour_error(half.clay, full.clay) / 3)
