"""A stroke under way: what whole steps of the tool do to the clay, and what is shown between them.

A whole step is a squash from nothing, and waits until there is time for it: until nobody asks
(:meth:`Drawing.work_ahead`), or the next step ends.  So whoever moves the tool waits for one answer
close to the last one only.  What steps do depends on the tool's way, never on when they are done.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterable

from jaxclay.clay.clay import Clay
from jaxclay.files.stroke import Solver, Stroke
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash
from jaxclay.solve.solution import Solution
from jaxclay.studio.reading import Reading, reading_of
from jaxclay.studio.solving import (
    MOVING,
    RESTING,
    SIZES,
    Near,
    follow,
    is_certified,
    press,
    smoothed,
)
from jaxclay.studio.tool import Place, Way, contact, is_near

THINNEST = 0.02  # over l: the tool comes no nearer to the axis
TALLEST = 12.0  # over l: a squash that would raise the piece higher is refused
_FIRST = 64  # slices that a stroke begins on
_PRESSES = 3  # in one place, where pressed clay comes up against the face elsewhere
_SMOOTHS_WITHIN = 0.05  # over l: from the face to the clay
_FAR = 20.0  # over l: where no tool stands
_EASY = 6.0  # times within the tolerance: half as many slices may do


class Drawing:
    """A stroke under way.

    Attributes
    ----------
    clay : Clay
        As the last whole step that was done has left it.
    reading : Reading
        Of the last answer.
    changed : bool
        Whether any step has changed the clay.
    """

    def __init__(self, stroke: Stroke, solver: Solver, material: Material, clay: Clay):
        self.clay, self.reading, self.changed = clay, Reading(clay), False
        self._stroke, self._solver, self._material = stroke, solver, material
        self._path = [Place(*stroke.path[0])]
        self._way = Way(_bounded(self._path[0], clay), float(clay.unit))
        self._waiting: Place | None = None  # a whole step that has ended there is to be done
        self._previous, self._stepped = clay, False  # before the last step
        self._shown: Solution | None = None  # the tool where it has come to, a step behind or not
        self._near: Near | None = None
        self._refused = ""  # why a step was, until it has been told
        self._first = _FIRST

    @property
    def stroke(self) -> Stroke:
        """The stroke so far."""
        return dataclasses.replace(
            self._stroke, path=tuple(self._path), material=self._material, solver=self._solver
        )

    @property
    def points(self) -> int:
        """How many points the way has."""
        return len(self._path)

    def go(self, points: Iterable[Place], shown: bool) -> Reading:
        """Along the points; read off what is shown where the way has come to, if it is."""
        begin = time.perf_counter()
        for point in points:
            self._path.append(Place(point.height, max(point.radius, 0.0)))
            for place in self._way.to(_bounded(point, self.clay)):
                self.work_ahead()
                self._waiting = place
        if self._stroke.kind == "smooth":
            self.work_ahead()
        if shown:
            self._show(MOVING)
        return self._read(begin)

    def work_ahead(self) -> None:
        """Do the step that waits."""
        if self._waiting is not None:
            place, self._waiting = self._waiting, None
            self._step(place, MOVING)

    def rest(self) -> Reading:
        """Read off where the tool stands, as exactly as when it lets go."""
        begin = time.perf_counter()
        self.work_ahead()
        self._show(RESTING)
        return self._read(begin)

    def end(self) -> Reading:
        """The last step, where the tool stands."""
        begin = time.perf_counter()
        self.work_ahead()
        if not self._way.has_moved:  # the last whole step ended here: once more, more exactly
            self.clay = self._previous
        if self._way.has_moved or self._stepped:
            self._step(self._way.place, RESTING)
        return self._read(begin)

    def _step(self, place: Place, tolerance: float) -> None:
        """What the tool does to the clay where a step of its way ends."""
        self._previous, self._stepped, self._shown = self.clay, True, None
        if self._stroke.kind == "smooth":
            self._smooth(place)
        else:
            self._press(place, tolerance)

    def _press(self, place: Place, tolerance: float) -> None:
        for _ in range(_PRESSES):
            squash = contact(self.clay, place, self._stroke.face)
            answer = squash and self._answer(self.clay, squash, tolerance)
            if not answer:
                self._refused = self.reading.message if squash else ""
                return
            self._near, self.clay, self.changed = Near(answer, self.clay), answer.clay, True
            self._first = _next_first(answer, tolerance)

    def _smooth(self, place: Place) -> None:
        clay, size = self.clay, self._stroke.size
        if not is_near(clay, place, size, _SMOOTHS_WITHIN):
            return
        low, high = place.height - size / 2, place.height + size / 2
        found = smoothed(clay, self._material, low, high, self._solver.most)
        self.reading = Reading(found.clay, found.certified, terms=found.terms)
        if not found.certified:
            self.reading = Reading(clay, False, "not smoothed: stalled", found.terms)
        elif found.clay is not clay:
            self.clay, self.changed = found.clay, True

    def _show(self, tolerance: float) -> None:
        """Find what the clay would be like with the tool where it has come to."""
        self._shown = None
        if self._stroke.kind == "smooth" or not (self._waiting or self._way.has_moved):
            return  # it is like that
        squash = contact(self.clay, self._way.place, self._stroke.face)
        if squash is None:
            self.work_ahead()  # nothing hides what the last step does
            return
        self._shown = self._answer(self.clay, squash, tolerance, self._near)
        if self._shown is not None:
            self._near = Near(self._shown, self.clay)

    def _answer(
        self, clay: Clay, squash: Squash, tolerance: float, near: Near | None = None
    ) -> Solution | None:
        """The answer, or None where it is refused; either way there is something to read."""
        solver, top = self._solver, float(squash.top)
        if top > TALLEST * float(clay.unit):
            self.reading = Reading(clay, False, f"the piece would be {top:.3g} tall: not pressed")
            return None
        if near is None or tolerance != MOVING:
            answer = press(solver, clay, squash, self._material, tolerance, self._first)
        else:
            answer = follow(solver, clay, squash, self._material, near, self._first)
        if not is_certified(answer, solver):
            self.reading = Reading(clay, False, f"not pressed: {answer.status}")
            return None
        self.reading = reading_of(answer, None if tolerance == RESTING else self.reading.floored)
        return answer

    def _read(self, begin: float) -> Reading:
        clay = self.clay if self._shown is None else self._shown.clay
        taken, said = 1e3 * (time.perf_counter() - begin), self.reading.message or self._refused
        self.reading = dataclasses.replace(
            self.reading, clay=clay, message=said, milliseconds=taken
        )
        self._refused = ""
        return self.reading


def _next_first(answer: Solution, tolerance: float) -> int:
    """Slices to begin the next step on: half of the last one's, or a quarter where that will do."""
    slices, error = answer.clay.slices, answer.error_estimate
    near = error is not None and float(error) < tolerance / _EASY
    return max(slices // (4 if near else 2), SIZES[0])


def _bounded(place: Place, clay: Clay) -> Place:
    """The place, no nearer to the axis than the tool comes, and not beyond all bounds."""
    unit = float(clay.unit)
    far = _FAR * unit
    return Place(min(max(place.height, -far), far), min(max(place.radius, THINNEST * unit), far))
