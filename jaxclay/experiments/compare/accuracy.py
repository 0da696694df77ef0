"""Speed against accuracy: all schemes on the random population, errors against the continuum.

Every row is one scene solved in one way: how far its contour is from that of the answer on 2048
placed slices of second order, over l, how many unknowns that took, and two times.  ``solve_s`` is
compiled code alone, from a posed problem to a certified answer; where slices are placed that is the
three solves one after the other.  ``call_s`` is what a user waits for: ``pose`` and
``minimize``, or ``deform``, the band, the nodes and Python included.  Both are medians of warm
repeats.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.clay.contour import contour_error
from jaxclay.experiments.compare.population import RandomScene, population
from jaxclay.experiments.compare.solves import Limit, Way, prepared, seconds_of
from jaxclay.methods import METHODS
from jaxclay.numerics.host import let_go
from jaxclay.solve.minimize import deform
from jaxclay.solve.solution import Status

Row = dict[str, Any]
NO_REFERENCE = "no reference"  # the limit of scenes of which no answer is good enough
_GOOD = 3e-5  # largest error of answers to measure errors from, over l


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
    reference : int
        Placed slices of the answers that errors are measured from.
    seconds : float
        Of timed repeats that a solve gets.
    """

    scenes: int
    slow: int
    slices: tuple[int, ...]
    few: tuple[int, ...]
    second: tuple[int, ...]
    elements: tuple[int, ...]
    reference: int
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
    reference=2048,
    seconds=0.1,
)
QUICK = THOROUGH._replace(
    scenes=2, slow=1, slices=(32, 64), few=(32,), second=(32, 64), elements=(2, 8),
    reference=256, seconds=0.01,
)  # fmt: skip


def ways(effort: Effort, others: bool) -> list[Way]:
    """Every way that a scene is solved in; ``others`` are the methods beside newton."""
    chosen = [Way("paper", "newton", 0, n) for n in effort.slices]
    for scheme in ("equal", "placed"):
        chosen += [Way(scheme, "newton", 0, n) for n in effort.second]
    for degree in (3, 4, 5):
        elements = effort.elements if degree == 5 else effort.elements[::2]
        chosen += [Way("spline", "newton", degree, count) for count in elements]
    if others:
        names = [name for name in METHODS if name != "newton"]
        chosen += [Way("paper", name, 0, n) for name in names for n in effort.few]
        spans = effort.elements[len(effort.elements) // 2]
        able = [name for name in names if METHODS[name].splines]
        chosen += [Way("spline", name, 5, spans) for name in able]
    return chosen


def run(
    effort: Effort, seed: int = 0, tick: Callable[[str], None] = lambda _: None
) -> Iterator[Row]:
    """Yield rows as they are measured; ``tick`` hears of every solve as it begins.

    Way by way, so that what a way has compiled can be let go.
    """
    known: list[tuple[RandomScene, Reference]] = []
    few = set()
    for index, scene in enumerate(population(effort.scenes, seed)):
        exact = reference(scene, effort.reference)
        if exact.error <= _GOOD:
            known.append((scene, exact))
            few |= {scene.number} if index < effort.slow else set()
        else:
            missing = {"method": "newton", "status": "skipped", "limit": NO_REFERENCE}
            yield {"scene": scene.number, **missing}
    by_newton = ways(effort, False)
    for way in ways(effort, True):
        for scene, exact in known:
            if scene.number in few or way in by_newton:
                tick(f"scene {scene.number} {way.scheme} {way.method} {way.size:g}")
                yield row_of(scene, way, exact, effort.seconds)
        let_go()


class Reference(NamedTuple):
    """The clay that errors are measured from, and about how far it is off itself, over l."""

    clay: Clay
    error: float


def reference(scene: RandomScene, slices: int) -> Reference:
    """The answer on so many placed slices.

    Of second order: its error is about a third of the way from the answer on half as many.
    """
    whole = scene.clay, scene.squash, scene.material
    half, full = (deform(*whole, slices=n) for n in (slices // 2, slices))
    certified = half.status is full.status is Status.CONVERGED
    return Reference(full.clay, contour_error(half.clay, full.clay) / 3 if certified else np.inf)


def row_of(scene: RandomScene, way: Way, exact: Reference, seconds: float) -> Row:
    """One scene solved in one way, or the limit that forbids it."""
    row: Row = {"scene": scene.number, "worked": scene.worked, "snake": scene.snake}
    row |= {**way._asdict(), "reference_error": exact.error}
    missing = {"error": np.nan, "unknowns": np.nan, "iterations": np.nan, "status": "skipped"}
    try:
        ready = prepared(scene, way)
    except Limit as limit:
        return row | missing | {"solve_s": np.nan, "call_s": np.nan, "limit": str(limit)}
    answer = ready.call()
    unresolved = answer.status is Status.UNRESOLVED
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
