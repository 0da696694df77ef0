"""What the modeller reads off an answer."""

from __future__ import annotations

import dataclasses

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.model.energy import Terms
from jaxclay.solve.solution import Solution, Status


@dataclasses.dataclass(frozen=True, eq=False)
class Reading:
    """What there is to read off after a step.

    Attributes
    ----------
    clay : Clay
        The shape to be shown: what stays, or while the tool moves what would.
    certified : bool
        False where the last solve was refused and the clay is as before it.
    message : str
        Empty where all is well.
    terms : Terms or None
        E_total's (eq. 9), where there was a solve.
    error : float or None
        Estimate of the contour's error over l, where the answer was to a tolerance.
    late : bool
        Whether that was not met, on as many slices as are ready.
    zone : (2,) heights, length, or None
        Lowest and highest clay that the last squash moved.
    reach : float or None
        u1, material beyond which clay above the tool rests.
    floored : bool
        Whether the lower bound of thickness is active in the rough shape.
    milliseconds : float
        Of all solves since the last reading.
    """

    clay: Clay
    certified: bool = True
    message: str = ""
    terms: Terms | None = None
    error: float | None = None
    late: bool = False
    zone: tuple[float, float] | None = None
    reach: float | None = None
    floored: bool = False
    milliseconds: float = 0.0


def reading_of(answer: Solution, floored: bool | None) -> Reading:
    """What an answer says; ``floored`` as it is known, or None to have it found out."""
    clay = answer.clay
    floored = bool(answer.rough.floored) if floored is None else floored
    moved = np.flatnonzero(np.asarray(answer.point.shift))
    if len(moved):
        low, high = max(moved[0] - 1, 0), min(moved[-1] + 1, clay.slices)
        zone = float(clay.heights[low]), float(clay.heights[high])
        reach = float(clay.material[high])
    else:
        zone, reach = None, None
    error = None if answer.error_estimate is None else float(answer.error_estimate)
    late = answer.status is Status.UNRESOLVED and error is not None
    message = f"the tolerance was not met on {clay.slices} slices" if late else ""
    if answer.status is Status.STALLED:
        message = f"{answer.method} stalled: no certificate"
    return Reading(clay, True, message, answer.terms, error, late, zone, reach, floored)
