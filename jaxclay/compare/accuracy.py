"""Speed against accuracy: all schemes on the random population, errors against the continuum.

Every row is one scene solved in one way: how far its contour is from that of the function Y(u)
which minimises E_total, over l, how many unknowns that took, and two times.  ``solve_s`` is
compiled code alone, from a posed problem to a judged answer; where slices are placed that is the
two solves on half as many and the last one.  ``call_s`` is what a user waits for: ``pose`` and
``minimize``, or ``deform``, the band, the nodes and Python included.  Both are medians of warm
repeats.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from jaxclay._host import let_go
from jaxclay.compare.population import RandomScene, population, solved
from jaxclay.compare.solves import Limit, Way, prepared, seconds_of
from jaxclay.contour import contour_error
from jaxclay.methods import METHODS
from jaxclay.solution import Solution, Status

Row = dict[str, Any]
NO_TRUTH = "no truth"  # the limit of scenes of which no answer is good enough
_TRUE = 10.0  # estimate over the tolerance, of answers good enough to measure errors from


class Effort(NamedTuple):
    """How much is run.

    Attributes
    ----------
    scenes : int
        Of the random population.
    slow : int
        The first so many also by the methods other than newton.
    slices, few : tuples of int
        Grids of newton on the paper's scheme, and of the other methods.
    second : tuple of int
        Numbers of slices on the second-order schemes, equal and placed.
    elements : tuple of int
        Equal spans on each side, for degree 5; every other for degrees 3 and 4, the middle one
        for methods other than newton.
    truth : float
        Tolerance of the answers that errors are measured from.
    seconds : float
        Of timed repeats that a solve gets.
    """

    scenes: int
    slow: int
    slices: tuple[int, ...]
    few: tuple[int, ...]
    second: tuple[int, ...]
    elements: tuple[int, ...]
    truth: float
    seconds: float

    @property
    def total(self) -> int:
        """How many solves are to be timed."""
        return sum(len(ways(self, index < self.slow)) for index in range(self.scenes))


THOROUGH = Effort(
    scenes=60,
    slow=12,
    slices=(32, 64, 128, 256, 512, 1024, 2048, 4096),
    few=(32, 64, 128),
    second=(32, 64, 128, 256, 512, 1024),
    elements=(2, 4, 8, 16, 32),
    truth=1e-7,
    seconds=0.1,
)
QUICK = THOROUGH._replace(
    scenes=2, slow=1, slices=(32, 64), few=(32,), second=(32, 64), elements=(2, 8),
    truth=1e-5, seconds=0.01,
)  # fmt: skip


def ways(effort: Effort, others: bool) -> list[Way]:
    """Every way that a scene is solved in; ``others`` are the methods beside newton."""
    chosen = [Way("paper", "newton", 0, False, n) for n in effort.slices]
    for scheme in ("equal", "placed"):
        chosen += [Way(scheme, "newton", 0, False, n) for n in effort.second]
    for degree in (3, 4, 5):
        elements = effort.elements if degree == 5 else effort.elements[::2]
        chosen += [Way("spline", "newton", degree, False, count) for count in elements]
    if others:
        names = [name for name in METHODS if name != "newton"]
        chosen += [Way("paper", name, 0, False, n) for name in names for n in effort.few]
        spans = effort.elements[len(effort.elements) // 2]
        able = [name for name in names if METHODS[name].splines]
        chosen += [Way("spline", name, 5, False, spans) for name in able]
    return chosen


def run(
    effort: Effort, seed: int = 0, tick: Callable[[str], None] = lambda _: None
) -> Iterator[Row]:
    """Yield rows as they are measured; ``tick`` hears of every solve as it begins.

    Way by way, so that what a way has compiled can be let go.
    """
    known: list[tuple[RandomScene, Solution]] = []
    few = set()
    for index, scene in enumerate(population(effort.scenes, seed)):
        exact = truth(scene, effort.truth)
        if float(exact.error_estimate or np.inf) <= _TRUE * effort.truth:
            known.append((scene, exact))
            few |= {scene.number} if index < effort.slow else set()
        else:
            missing = {"method": "newton", "status": "skipped", "limit": NO_TRUTH}
            yield {"scene": scene.number, **missing}
    by_newton = ways(effort, False)
    for way in ways(effort, True):
        for scene, exact in known:
            if scene.number in few or way in by_newton:
                tick(f"scene {scene.number} {way.scheme} {way.method} {way.size:g}")
                yield row_of(scene, way, exact, effort.seconds)
        let_go()


def truth(scene: RandomScene, tolerance: float) -> Solution:
    """The answer that errors are measured from; its own is in ``error_estimate``.

    Of the answers to this tolerance and to looser ones, the best by its estimate: too tight
    a one may find no end.
    """
    looser = (tolerance, 4 * tolerance, 20 * tolerance)
    answers = [solved(scene.clay, scene.squash, scene.material, each) for each in looser]
    return min(answers, key=lambda answer: float(answer.error_estimate or np.inf))


def row_of(scene: RandomScene, way: Way, exact: Solution, seconds: float) -> Row:
    """One scene solved in one way, or the limit that forbids it."""
    row: Row = {"scene": scene.number, "worked": scene.worked, "snake": scene.snake}
    row |= {**way._asdict(), "truth_error": float(exact.error_estimate or 0)}
    missing = {"error": np.nan, "unknowns": np.nan, "iterations": np.nan, "status": "skipped"}
    try:
        ready = prepared(scene, way)
    except Limit as limit:
        return row | missing | {"solve_s": np.nan, "call_s": np.nan, "limit": str(limit)}
    answer = ready.call()
    unresolved = answer.status is Status.UNRESOLVED and not way.adaptive
    shapeless = answer.status is Status.NON_FINITE or (unresolved and way.scheme == "spline")
    refused = way.method == "newton" and not answer.certificate.accepted
    limit = "rounding" if unresolved and not shapeless else "refused" if refused else ""
    return row | {
        "error": np.nan if shapeless else contour_error(answer.clay, exact.clay),
        "unknowns": int(answer.unknowns),
        "iterations": int(answer.iterations),
        "status": str(answer.status),
        "solve_s": seconds_of(ready.solve, seconds),
        "call_s": seconds_of(ready.call, seconds),
        "limit": limit,
    }
