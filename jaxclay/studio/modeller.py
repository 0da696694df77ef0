"""The modeller: strokes of a tool in, shapes out; undo, pieces, and what there is to read off.

Plain Python, without a browser::

    modeller = Modeller(jaxclay.Clay.cylinder(0.4))
    modeller.draw(Stroke("right", 0.3, 0.12, [(0.5, 0.45), (0.5, 0.3), (0.7, 0.3)]))
    modeller.undo()
"""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterable, Sequence

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.clay.contour import area_error
from jaxclay.files.piece import Piece
from jaxclay.files.stroke import Solver, Stroke
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash
from jaxclay.solve.solution import Solution
from jaxclay.studio.reading import Reading, reading_of
from jaxclay.studio.solving import (
    MOVING,
    RESTING,
    SIZES,
    check_offered,
    follow,
    is_certified,
    press,
    settled,
    smoothed,
)
from jaxclay.studio.starts import MATERIAL
from jaxclay.studio.tool import STEP, Place, Way, contact, is_near

KEPT = 256  # strokes that can be undone
MOST_POINTS = 20_000  # of a stroke's way
THINNEST = 0.02  # over l: the tool comes no nearer to the axis
TALLEST = 12.0  # over l: a squash that would raise the piece higher is refused
_FIRST = 64  # slices that a stroke begins on
_PRESSES = 3  # in one place, where pressed clay comes up against the face elsewhere
_SMOOTHS_WITHIN = 0.05  # over l: from the face to the clay
_FAR = 20.0  # over l: where no tool stands
_LEAST, _MOST = 1e-3, 100.0  # over l: heights and radii of pieces
_FAR_ON = 0.25  # steps from the last whole one: the tool is not shown there any more
_EASY = 6.0  # times within the tolerance: half as many slices may do


class _Drawing:
    """A stroke under way."""

    def __init__(self, stroke: Stroke, solver: Solver, material: Material, clay: Clay):
        self.stroke, self.solver, self.material = stroke, solver, material
        self.clay = clay  # as the last whole step has left it
        self.previous, self.stepped = clay, False  # before that step
        self.path = [Place(*stroke.path[0])]
        self.way = Way(_bounded(self.path[0], clay), float(clay.unit))
        self.shown: Solution | None = None  # between two steps
        self.first, self.changed = _FIRST, False


class Modeller:
    """A piece of clay under a tool.

    Parameters
    ----------
    clay : Clay or Piece
    material : Material, optional
        Of strokes to come; a piece's own if not given.
    target : Clay, optional
        What the piece is to become: see :meth:`match`.

    Attributes
    ----------
    reading : Reading
        The last one.
    solver : Solver
        Of strokes to come.
    """

    def __init__(
        self, clay: Clay | Piece, material: Material | None = None, target: Clay | None = None
    ):
        self._piece = clay if isinstance(clay, Piece) else Piece(clay, material or MATERIAL)
        _check_size(self._piece)
        self.material = material or self._piece.material
        self.target, self.solver = target, Solver()
        self._past: list[Piece] = []
        self._future: list[Piece] = []
        self._drawing: _Drawing | None = None
        self.reading = Reading(self.clay)

    @property
    def clay(self) -> Clay:
        """The clay, certified: while a stroke is under way as its last whole step has left it."""
        return self._piece.clay if self._drawing is None else self._drawing.clay

    @property
    def piece(self) -> Piece:
        """The piece before the stroke that is under way, to be saved."""
        return dataclasses.replace(self._piece, material=self.material)

    @property
    def drawing(self) -> bool:
        """Whether a stroke is under way."""
        return self._drawing is not None

    @property
    def undoable(self) -> int:
        """How many steps :meth:`undo` can take back."""
        return len(self._past)

    @property
    def redoable(self) -> int:
        """How many of them :meth:`redo` can take again."""
        return len(self._future)

    def begin(self, stroke: Stroke) -> Reading:
        """Set the tool down at the first point of the stroke's path, and go the rest of it.

        Raises
        ------
        ValueError
            Another stroke is under way, a path that is too long, a solver that is not offered.
        """
        if self._drawing is not None:
            raise ValueError("another stroke is under way: end or cancel it first")
        solver, material = stroke.solver or self.solver, stroke.material or self.material
        check_offered(solver)
        _check_points(len(stroke.path))
        self._drawing = _Drawing(stroke, solver, material, self._piece.clay)
        self.reading = Reading(self.clay)
        return self.move(stroke.path[1:])

    def move(self, points: Iterable[Sequence[float]]) -> Reading:
        """Go on along (height, radius) points, length; what is shown is where the way has come to.

        Raises
        ------
        ValueError
            No stroke is under way, a point that is not finite, a way that is too long.
        """
        drawing = self._under_way()
        path = [Place(float(height), float(radius)) for height, radius in points]
        if not all(math.isfinite(value) for point in path for value in point):
            raise ValueError("the tool goes along finite heights and radii")
        _check_points(len(drawing.path) + len(path))
        begin, steps = time.perf_counter(), 0
        for point in path:
            drawing.path.append(Place(point.height, max(point.radius, 0.0)))
            for place in drawing.way.to(_bounded(point, drawing.clay)):
                self._step(drawing, place, MOVING)
                steps += 1
        if not steps or drawing.way.rest > _FAR_ON * STEP:  # or the last step can be shown
            self._show(drawing, MOVING)
        return self._read(drawing, begin)

    def rest(self) -> Reading:
        """What is shown where the tool stands, as exact as when it lets go."""
        drawing, begin = self._under_way(), time.perf_counter()
        self._show(drawing, RESTING)
        return self._read(drawing, begin)

    def end(self) -> Reading:
        """Let go: the stroke is done, and can be undone, if it has changed anything."""
        drawing, begin = self._under_way(), time.perf_counter()
        if not drawing.way.has_moved:  # the last whole step ended here: once more, more exactly
            drawing.clay = drawing.previous
        if drawing.way.has_moved or drawing.stepped:
            self._step(drawing, drawing.way.place, RESTING)
        self._drawing = None
        if drawing.changed:
            stroke = dataclasses.replace(
                drawing.stroke, path=tuple(drawing.path), material=drawing.material,
                solver=drawing.solver,
            )  # fmt: skip
            strokes = (*self._piece.strokes, stroke)
            self._become(dataclasses.replace(self._piece, clay=drawing.clay, strokes=strokes))
        drawing.clay, drawing.shown = self._piece.clay, None
        return self._read(drawing, begin)

    def cancel(self) -> Reading:
        """Lift the tool: the clay is as it was before the stroke."""
        self._drawing = None
        return self._still()

    def draw(self, stroke: Stroke) -> Reading:
        """A whole stroke: :meth:`begin` and :meth:`end`."""
        self.begin(stroke)
        return self.end()

    def undo(self) -> Reading:
        """Take the last stroke back, or reset, or open; cancel a stroke that is under way."""
        if self._drawing is None and self._past:
            self._future.append(self._piece)
            self._piece = self._past.pop()
        return self.cancel()

    def redo(self) -> Reading:
        """What undo has taken back, bit for bit."""
        if self._drawing is None and self._future:
            self._past.append(self._piece)
            self._piece = self._future.pop()
        return self.cancel()

    def reset(self) -> Reading:
        """Back to the clay that the strokes began from."""
        if self._piece.strokes:
            self._become(dataclasses.replace(self._piece, clay=self._piece.start, strokes=()))
        return self.cancel()

    def open(self, piece: Piece | Clay) -> Reading:
        """Go on from another piece, with the material of one that has been saved.

        Raises
        ------
        ValueError
            A piece a hundred times as large as when it first became clay, or a thousandth.
        """
        new = piece if isinstance(piece, Piece) else Piece(piece, self.material)
        _check_size(new)
        self.material = new.material
        self._become(new)
        return self.cancel()

    def match(self) -> float | None:
        """Area between contour and target over the target's (:func:`jaxclay.area_error`)."""
        return None if self.target is None else area_error(self.clay, self.target)

    def slump(self) -> float:
        """How far the material lets the piece sink by itself, with no tool near, over l."""
        return float(abs(settled(self.clay, self.material, self.solver.most).shift).max())

    def _under_way(self) -> _Drawing:
        if self._drawing is None:
            raise ValueError("no stroke is under way: begin one first")
        return self._drawing

    def _become(self, piece: Piece) -> None:
        self._past.append(self._piece)
        self._future.clear()
        del self._past[:-KEPT]
        if len(piece.strokes) > KEPT:  # what cannot be undone need not be replayed either
            oldest = self._past[0]
            first = [i for i, s in enumerate(piece.strokes) if oldest.strokes[-1:] == (s,)]
            if first:
                strokes = piece.strokes[first[0] + 1 :]
                piece = dataclasses.replace(piece, start=oldest.clay, strokes=strokes)
        self._piece = piece

    def _step(self, drawing: _Drawing, place: Place, tolerance: float) -> None:
        """What the tool does to the clay where a step of its way ends."""
        drawing.shown, drawing.previous, drawing.stepped = None, drawing.clay, True
        if drawing.stroke.kind == "smooth":
            self._smooth(drawing, place)
            return
        for _ in range(_PRESSES):
            squash = contact(drawing.clay, place, drawing.stroke.face)
            if squash is None:
                return
            answer = self._pressed(drawing, squash, tolerance)
            if answer is None:
                return
            drawing.clay, drawing.changed = answer.clay, True
            drawing.first = _next_first(answer, tolerance)

    def _show(self, drawing: _Drawing, tolerance: float) -> None:
        """Find what the clay would be like with the tool where it has come to."""
        place, near = drawing.way.place, drawing.shown
        drawing.shown = None
        if drawing.stroke.kind == "smooth" or not drawing.way.has_moved:
            return
        squash = contact(drawing.clay, place, drawing.stroke.face)
        if squash is not None:
            drawing.shown = self._pressed(drawing, squash, tolerance, near)

    def _pressed(
        self, drawing: _Drawing, squash: Squash, tolerance: float, near: Solution | None = None
    ) -> Solution | None:
        """The answer, or None where it is refused; either way there is something to read."""
        clay, solver = drawing.clay, drawing.solver
        top = float(squash.top)
        if top > TALLEST * float(clay.unit):
            self.reading = Reading(clay, False, f"the piece would be {top:.3g} tall: not pressed")
            return None
        if tolerance == MOVING and near is not None:
            answer = follow(solver, clay, squash, drawing.material, near, drawing.first)
        else:
            answer = press(solver, clay, squash, drawing.material, tolerance, drawing.first)
        if not is_certified(answer, solver):
            self.reading = Reading(clay, False, f"not pressed: {answer.status}")
            return None
        self.reading = reading_of(answer, None if tolerance == RESTING else self.reading.floored)
        return answer

    def _smooth(self, drawing: _Drawing, place: Place) -> None:
        clay, half = drawing.clay, drawing.stroke.size / 2
        if not is_near(clay, place, drawing.stroke.size, _SMOOTHS_WITHIN):
            return
        low, high = place.height - half, place.height + half
        found = smoothed(clay, drawing.material, low, high, drawing.solver.most)
        self.reading = Reading(found.clay, found.certified, terms=found.terms)
        if not found.certified:
            self.reading = Reading(clay, False, "not smoothed: stalled", found.terms)
        elif found.clay is not clay:
            drawing.clay, drawing.changed = found.clay, True

    def _read(self, drawing: _Drawing, begin: float) -> Reading:
        clay = drawing.clay if drawing.shown is None else drawing.shown.clay
        taken = 1e3 * (time.perf_counter() - begin)
        self.reading = dataclasses.replace(self.reading, clay=clay, milliseconds=taken)
        return self.reading

    def _still(self) -> Reading:
        self.reading = Reading(self.clay)
        return self.reading


def replay(piece: Piece) -> Modeller:
    """The piece made anew from its start, stroke by stroke.

    Raises
    ------
    ValueError
        A stroke of a solver that the modeller does not offer, or too long a way.
    """
    modeller = Modeller(dataclasses.replace(piece, clay=piece.start, strokes=()))
    for stroke in piece.strokes:
        modeller.draw(stroke)
    return modeller


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


def _check_size(piece: Piece) -> None:
    for clay in (piece.clay, piece.start):
        sizes = np.append(clay.radii, clay.height) / float(clay.unit)
        if not (sizes.min() >= _LEAST and sizes.max() <= _MOST):
            raise ValueError(
                f"heights and radii must be {_LEAST:g} to {_MOST:g} times the unit "
                f"{float(clay.unit):g}, got {sizes.min():.3g} to {sizes.max():.3g} times"
            )


def _check_points(count: int) -> None:
    if count > MOST_POINTS:
        raise ValueError(f"a stroke has at most {MOST_POINTS} points, got {count}: let go first")
