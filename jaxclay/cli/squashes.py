"""Squashes on the command line, in the file's heights: as they are given, and what they did."""

from __future__ import annotations

import math
import re

from jaxclay.clay.clay import Clay
from jaxclay.model.squash import Squash
from jaxclay.numerics.checks import check_positive
from jaxclay.solve.solution import Solution


def joined(arguments: list[str]) -> list[str]:
    """The arguments, with a squash that begins with a minus in one with its option."""
    found: list[str] = []
    for word in arguments:
        if found and found[-1] == "--squash" and re.match(r"-[\d.]", word):
            found[-1] += f"={word}"
        else:
            found.append(word)
    return found


def parse_squash(text: str) -> tuple[float, float, float]:
    """BOTTOM, TOP and RADIUS; a ValueError says what is no squash of any clay."""
    parts = text.split(":")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) != 3:
        raise ValueError(f"--squash {text!r} is not BOTTOM:TOP:RADIUS, three numbers, as 0:0.3:0.4")
    bottom, top, radius = numbers
    if not (math.isfinite(bottom) and math.isfinite(top) and top > bottom):
        raise ValueError(
            f"--squash {text}: the band is empty: bottom and top must be finite, and top above "
            f"bottom = {bottom:g}, got {top:g}"
        )
    check_positive("radius", radius)
    return bottom, top, radius


def squash_of(
    text: str, numbers: tuple[float, float, float], top_fixed: bool, clay: Clay, base: float
) -> Squash:
    """The squash in the clay's heights, from one in those of the file; refused in the file's."""
    bottom, top, radius = numbers
    high = base + float(clay.height)
    if bottom < base:
        raise ValueError(
            f"--squash {text}: bottom = {bottom:g} is below the piece, which stands at {base:g}: "
            "heights are the file's"
        )
    if bottom >= high:
        raise ValueError(
            f"--squash {text}: the band starts at bottom = {bottom:g}, above the clay: bottom must "
            f"be below its top at {high:g}"
        )
    if top_fixed and top >= high:
        raise ValueError(
            f"--squash {text}: the upper end is held at {high:g}, which leaves no room above top = "
            f"{top:g}: top must be below {high:g}"
        )
    return Squash(bottom - base, top - base, radius, top_fixed=top_fixed)


def describe(text: str, solution: Solution, error: float, base: float = 0.0) -> str:
    """What a squash did, in a few lines; ``base`` is the height that the piece stands at.

    ``error`` is that of the contour over l, of the profile's slices and of all squashes together;
    said where a tolerance was asked for.
    """
    rough, certificate, terms = solution.rough, solution.certificate, solution.terms
    case = f"case {rough.case}" + (
        f", below {rough.case_below}" if rough.case_below != "none" else ""
    )
    clay = solution.clay
    accuracy = ""
    if solution.error_estimate is not None:
        accuracy = f", {int(solution.unknowns)} unknowns, contour within {error:.1e} of "
        accuracy += "the height, the profile's slices included"
    stands = f" ({base:g} to {base + float(clay.height):.6g})" if base else ""
    bound = ", lower bound active" if certificate.on_floor or rough.floored else ""
    return "\n".join(
        (
            f"squash {text}: {case}{bound}, {solution.status} after {int(solution.iterations)} "
            f"iterations of {solution.method} on {clay.slices} slices{accuracy}",
            f"  band {base + float(rough.bottom):.6g} to {base + float(rough.top):.6g}, "
            f"reach u1 = {float(rough.reach):.4g}",
            f"  E_total {float(solution.energy):.8g} = strain {float(terms.strain):.4g} + friction "
            f"{float(terms.friction):.4g} + tension {float(terms.tension):.4g} + bending "
            f"{float(terms.bending):.4g}; can still gain {float(certificate.decrement):.1e}",
            f"  height {float(clay.height):.6g}{stands}, radius {float(clay.radii.min()):.6g} to "
            f"{float(clay.radii.max()):.6g}, volume {float(clay.volume):.8g}",
        )
    )
