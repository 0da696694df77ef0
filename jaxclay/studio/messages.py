"""What a page may ask of a modeller, and who may; ``answers`` says what it is told.

A message is an object with a ``type``, a ``view`` (who asks), an ``id`` (a number that grows) and
perhaps buffers.  Lengths in buffers are float32, over the unit l: places of the tool as pairs
(height, radius), contours as pairs (radius, height).  Whatever is wrong with a message, the piece
stays, and the answer has the type "refused" and says why.
"""

from __future__ import annotations

import dataclasses
import logging
import threading
import time
import uuid
from collections.abc import Callable
from typing import Any

import numpy as np

from jaxclay.files.piece import piece_of_json, piece_to_json
from jaxclay.files.stroke import Stroke
from jaxclay.numerics.checks import REFUSALS
from jaxclay.studio import answers, checked
from jaxclay.studio.answers import Answer, contour
from jaxclay.studio.checked import Message
from jaxclay.studio.exports import EXPORTS
from jaxclay.studio.modeller import Modeller, replay
from jaxclay.studio.reading import Reading
from jaxclay.studio.solving import SIZES, Compilations
from jaxclay.studio.starts import STARTS, piece_of

_MOST_REPLAYED = 20_000  # points of a way that a page may have replayed: a minute or two
ABANDONED = 3.0  # seconds without a word: another view may go on


class Desk:
    """A modeller, and all views of it: they see one piece and share its strokes.

    Parameters
    ----------
    modeller : Modeller
    compilations : Compilations
        What is ready: no stroke begins before its solver is.
    """

    def __init__(self, modeller: Modeller, compilations: Compilations):
        self.modeller, self.compilations = modeller, compilations
        self.session = uuid.uuid4().hex
        self._owner, self._heard = "", 0.0  # the view whose stroke is under way, and when
        self._lock = threading.RLock()
        self._last: dict[str, int] = {}  # id of each view's last message
        self._actions: dict[str, Callable[[Message, list], list[Answer]]] = {
            "hello": self._hello, "begin": self._begin, "move": self._move, "rest": self._rest,
            "end": self._end, "cancel": self._cancel, "undo": self._undo, "redo": self._redo,
            "reset": self._reset, "start": self._start, "profile": self._profile,
            "target": self._target, "save": self._save, "open": self._open,
            "replay": self._replay, "export": self._export,
        }  # fmt: skip

    def answer(self, message: Any, buffers: Any = ()) -> list[Answer]:
        """What to tell the views; never raises, from any thread."""
        with self._lock:
            return self._answer(message, buffers)

    def _answer(self, message: Any, buffers: Any) -> list[Answer]:
        view, number = checked.who(message)
        try:
            action = self._actions.get(checked.text(message, "type", 32))
            if action is None:
                known = ", ".join(self._actions)
                raise ValueError(f"no message of type {message['type']!r}: one of {known}")
            if message["type"] != "hello" and number <= self._last.get(view, -1):
                raise ValueError(f"message {number} comes after {self._last[view]}: out of order")
            self._remember(view, number)
            answers = action(message, list(buffers))
        except (*REFUSALS, ImportError) as error:  # ImportError: of an extra that is missing
            answers = [({"type": "refused", "message": str(error)[:500]}, [])]
        except Exception:
            logging.getLogger("jaxclay.studio").exception("a fault inside")
            text = "a fault inside, not in what was asked: the piece is kept"
            answers = [({"type": "refused", "message": text}, [])]
        return [(content | {"view": view, "id": number}, sent) for content, sent in answers]

    def work_ahead(self) -> None:
        """Use the time until the next message; never raises."""
        with self._lock:
            try:
                self.modeller.work_ahead()
            except Exception:
                logging.getLogger("jaxclay.studio").exception("a fault inside")

    def left(self, view: str) -> list[Answer]:
        """A view is gone: what it was drawing is done."""
        with self._lock:
            self._last.pop(view, None)
            if view != self._owner or not self.modeller.drawing:
                return []
            self._owner = ""
            return [self._shape(self.modeller.end(), done=True)]

    def state(self) -> Message:
        """What views show beside the shape."""
        m = self.modeller
        ready = {"ready": self.compilations.has(m.solver), "most": self.compilations.most}
        return ready | {
            "all": self.compilations.whole, "sizes": len(SIZES), "starts": list(STARTS),
            "exports": list(EXPORTS), "session": self.session,
        }  # fmt: skip

    # Strokes.

    def _hello(self, message: Message, buffers: list) -> list[Answer]:
        told = [({"type": "state"} | self.state(), []), self._shape(self.modeller.reading, True)]
        return told if self.modeller.target is None else [*told, self._target_told()]

    def _begin(self, message: Message, buffers: list) -> list[Answer]:
        view = message.get("view")
        m = self.modeller
        if m.drawing:
            self._check_owner(message)
        if not self.compilations.has(m.solver):
            raise ValueError("still preparing the solver: the tool works in a moment")
        if m.drawing:
            m.end()
        unit = float(m.clay.unit)
        size, face = (checked.number(message, name, 1e-3, 10.0) * unit for name in ("size", "face"))
        solver = dataclasses.replace(m.solver, most=self.compilations.most)
        stroke = Stroke(
            checked.text(message, "side", 8), size, min(face, size), self._path(buffers, 1),
            checked.text(message, "kind", 8), m.material, solver,
        )  # fmt: skip
        reading = m.begin(stroke)
        self._owner, self._heard = str(view), time.monotonic()
        return [self._shape(reading)]

    def _move(self, message: Message, buffers: list) -> list[Answer]:
        self._check_owner(message)
        return [self._shape(self.modeller.move(self._path(buffers, 0)))]

    def _rest(self, message: Message, buffers: list) -> list[Answer]:
        self._check_owner(message)
        return [self._shape(self.modeller.rest())]

    def _end(self, message: Message, buffers: list) -> list[Answer]:
        self._check_owner(message)
        if buffers:
            self.modeller.move(self._path(buffers, 0))
        self._owner = ""
        return self._done(self.modeller.end())

    def _cancel(self, message: Message, buffers: list) -> list[Answer]:
        if self.modeller.drawing:
            self._check_owner(message)
        self._owner = ""
        return [self._shape(self.modeller.cancel(), True)]

    def _undo(self, message: Message, buffers: list) -> list[Answer]:
        self._check_free(message)
        return self._done(self.modeller.undo())

    def _redo(self, message: Message, buffers: list) -> list[Answer]:
        self._check_free(message)
        return self._done(self.modeller.redo())

    def _reset(self, message: Message, buffers: list) -> list[Answer]:
        self._check_free(message)
        return self._done(self.modeller.reset())

    # Pieces and files.

    def _start(self, message: Message, buffers: list) -> list[Answer]:
        self._check_free(message)
        name = checked.text(message, "name", 32)
        if name not in STARTS:
            raise ValueError(f"no shape {name!r} to start from: one of {', '.join(STARTS)}")
        return self._done(self.modeller.open(STARTS[name]()))

    def _profile(self, message: Message, buffers: list) -> list[Answer]:
        self._check_free(message)
        profile = checked.profile_of(message, buffers)
        told = {"type": "said", "message": profile.said}
        return [*self._done(self.modeller.open(piece_of(profile))), (told, [])]

    def _target(self, message: Message, buffers: list) -> list[Answer]:
        self.modeller.target = checked.profile_of(message, buffers).cut().clay if buffers else None
        return [self._target_told(), self._shape(self.modeller.reading, True)]

    def _save(self, message: Message, buffers: list) -> list[Answer]:
        text = piece_to_json(self.modeller.piece)
        return [answers.file("piece.json", "application/json", text.encode())]

    def _open(self, message: Message, buffers: list) -> list[Answer]:
        self._check_free(message)
        piece = piece_of_json(checked.text(message, "text", checked.MOST_TEXT))
        return [*self._done(self.modeller.open(piece)), ({"type": "material"}, [])]

    def _replay(self, message: Message, buffers: list) -> list[Answer]:
        """Contours after each stroke, and whether the last is the piece's, bit for bit."""
        self._check_free(message)
        piece = self.modeller.piece
        if sum(len(stroke.path) for stroke in piece.strokes) > _MOST_REPLAYED:
            raise ValueError(f"replaying more than {_MOST_REPLAYED} points would take minutes")
        again = dataclasses.replace(piece, clay=piece.start, strokes=())
        frames = [contour(again.clay)]
        for stroke in piece.strokes:
            made = replay(dataclasses.replace(again, strokes=(stroke,)))
            again = dataclasses.replace(again, clay=made.clay)
            frames.append(contour(again.clay))
        same = np.array_equal(again.clay.heights, piece.clay.heights)
        return [({"type": "replay", "exact": same}, [points.tobytes() for points in frames])]

    def _export(self, message: Message, buffers: list) -> list[Answer]:
        kind = checked.text(message, "kind", 8)
        if kind not in EXPORTS:
            raise ValueError(f"no export {kind!r}: one of {', '.join(EXPORTS)}")
        millimetres = checked.number(message, "millimetres", 1e-3, 1e5)
        wall = checked.number(message, "wall", 0.0, 1e5) if message.get("wall") else None
        mime, made = EXPORTS[kind]
        return [answers.file(f"clay.{kind}", mime, made(self.modeller.piece, millimetres, wall))]

    # Inside.

    def _check_owner(self, message: Message) -> None:
        if not self.modeller.drawing:
            raise ValueError("no stroke is under way: begin one first")
        if message.get("view") == self._owner:
            self._heard = time.monotonic()
        elif time.monotonic() - self._heard < ABANDONED:
            raise ValueError("the piece is being shaped in another view")
        else:
            self.modeller.end()
            raise ValueError("a stroke of another view has ended here: once more, please")

    def _check_free(self, message: Message) -> None:
        if self.modeller.drawing:
            self._check_owner(message)
            self.modeller.cancel()
            self._owner = ""

    def _remember(self, view: str, number: int) -> None:
        self._last.pop(view, None)
        self._last[view] = number
        if len(self._last) > 64:
            del self._last[next(iter(self._last))]

    def _path(self, buffers: list, least: int) -> tuple[tuple[float, float], ...]:
        points = checked.pairs(buffers)
        if len(points) < least:
            raise ValueError("a stroke begins at a place of the tool: a pair of float32")
        unit = float(self.modeller.clay.unit)
        return tuple((height * unit, max(radius, 0.0) * unit) for height, radius in points)

    def _done(self, reading: Reading) -> list[Answer]:
        """The shape, and what a page keeps of it in case that this process ends."""
        kept = dataclasses.replace(self.modeller.piece, start=None, strokes=())
        return [self._shape(reading, True), ({"type": "kept", "text": piece_to_json(kept)}, [])]

    def _target_told(self) -> Answer:
        return answers.target(self.modeller.target, float(self.modeller.clay.unit))

    def _shape(self, reading: Reading, done: bool = False) -> Answer:
        return answers.shape(self.modeller, reading, self.compilations, done)
