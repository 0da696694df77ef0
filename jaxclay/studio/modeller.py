"""The modeller: strokes of a tool in, shapes out; undo, pieces, and what there is to read off.

Plain Python, without a browser::

    modeller = Modeller(jaxclay.Clay.cylinder(0.4))
    modeller.draw(Stroke("right", 0.3, 0.12, [(0.5, 0.45), (0.5, 0.3), (0.7, 0.3)]))
    modeller.undo()
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.clay.contour import area_error
from jaxclay.files.piece import Piece
from jaxclay.files.stroke import Solver, Stroke
from jaxclay.model.material import Material
from jaxclay.studio.drawing import Drawing
from jaxclay.studio.reading import Reading
from jaxclay.studio.solving import check_offered, settled
from jaxclay.studio.starts import MATERIAL
from jaxclay.studio.tool import Place

KEPT = 256  # strokes that can be undone
MOST_POINTS = 20_000  # of a stroke's way
_LEAST, _MOST = 1e-3, 100.0  # over l: heights and radii of pieces


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
        self._drawing: Drawing | None = None
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
        return self._begun(stroke, True)

    def move(self, points: Iterable[Sequence[float]]) -> Reading:
        """Go on along (height, radius) points, length; what is shown is where the way has come to.

        Raises
        ------
        ValueError
            No stroke is under way, a point that is not finite, a way that is too long.
        """
        return self._go(points, True)

    def work_ahead(self) -> None:
        """Do, while nobody asks, what the next call would do first.

        Nothing depends on whether it is called but how long the others take.
        """
        if self._drawing is not None:
            self._drawing.work_ahead()

    def rest(self) -> Reading:
        """What is shown where the tool stands, as exact as when it lets go."""
        self.reading = self._under_way().rest()
        return self.reading

    def end(self) -> Reading:
        """Let go: the stroke is done, and can be undone, if it has changed anything."""
        drawing = self._under_way()
        self.reading, self._drawing = drawing.end(), None
        if drawing.changed:
            strokes = (*self._piece.strokes, drawing.stroke)
            self._become(dataclasses.replace(self._piece, clay=drawing.clay, strokes=strokes))
        return self.reading

    def cancel(self) -> Reading:
        """Lift the tool: the clay is as it was before the stroke."""
        self._drawing = None
        return self._still()

    def draw(self, stroke: Stroke) -> Reading:
        """A whole stroke: :meth:`begin` and :meth:`end`, with nothing shown between."""
        self._begun(stroke, False)
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

    def _begun(self, stroke: Stroke, shown: bool) -> Reading:
        if self._drawing is not None:
            raise ValueError("another stroke is under way: end or cancel it first")
        solver, material = stroke.solver or self.solver, stroke.material or self.material
        check_offered(solver)
        _check_points(len(stroke.path))
        self._drawing = Drawing(stroke, solver, material, self._piece.clay)
        try:
            return self._go(stroke.path[1:], shown)
        except ValueError:
            self._drawing = None
            raise

    def _go(self, points: Iterable[Sequence[float]], shown: bool) -> Reading:
        drawing = self._under_way()
        path = [Place(float(height), float(radius)) for height, radius in points]
        if not all(math.isfinite(value) for point in path for value in point):
            raise ValueError("the tool goes along finite heights and radii")
        _check_points(drawing.points + len(path))
        self.reading = drawing.go(path, shown)
        return self.reading

    def _under_way(self) -> Drawing:
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
