"""What a page is told: the shape and what is read off it, the target, files."""

from __future__ import annotations

import math

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.clay.contour import slice_points
from jaxclay.files.units import UNITS
from jaxclay.studio.checked import Message
from jaxclay.studio.modeller import Modeller
from jaxclay.studio.reading import Reading
from jaxclay.studio.solving import Compilations

DRAWN = 256  # points of a contour at most
_SLUMPS = 0.05  # over l: clay that sinks so far by itself slumps
Answer = tuple[Message, list[bytes]]


def shape(
    modeller: Modeller, reading: Reading, compilations: Compilations, done: bool = False
) -> Answer:
    """What is shown and read off it; ``done``: it stays, and there is time to look closer."""
    clay, unit = reading.clay, float(reading.clay.unit)
    zone = None if reading.zone is None else [height / unit for height in reading.zone]
    told: Message = {
        "type": "shape", "done": done, "unit": unit, "height": float(clay.height),
        "diameter": 2 * float(clay.radii.max()), "volume": float(clay.volume),
        "slices": clay.slices, "certified": reading.certified, "message": reading.message,
        "error": _finite(reading.error), "zone": zone, "reach": reading.reach,
        "floored": reading.floored, "solve": reading.milliseconds, "undo": modeller.undoable,
        "redo": modeller.redoable, "strokes": len(modeller.piece.strokes),
    }  # fmt: skip
    if reading.late and not compilations.whole:
        told["message"] = ""  # nothing to be mended: it will be met in a moment
    if reading.terms is not None:
        told["energy"] = {name: float(v) for name, v in reading.terms._asdict().items()}
    if done:
        told |= {
            "match": _finite(modeller.match()),
            "slumps": compilations.most > 0 and modeller.slump() > _SLUMPS,
            "millimetres": UNITS.get(modeller.piece.length_unit or "") or 100.0,
        }
    return told, [contour(clay).tobytes()]


def target(clay: Clay | None, unit: float) -> Answer:
    """The outline to be met, or that there is none."""
    if clay is None:
        return {"type": "target"}, []
    return {"type": "target"}, [_thinned(slice_points(clay) / unit).astype("<f4").tobytes()]


def file(name: str, mime: str, data: bytes) -> Answer:
    """A file to be saved."""
    return {"type": "file", "name": name, "mime": mime}, [data]


def contour(clay: Clay) -> np.ndarray:
    """(m, 2) float32 points (radius, height) over l to be drawn, 256 at most."""
    return _thinned(slice_points(clay) / float(clay.unit)).astype("<f4")


def _thinned(points: np.ndarray) -> np.ndarray:
    if len(points) <= DRAWN:
        return points
    return points[np.round(np.linspace(0, len(points) - 1, DRAWN)).astype(int)]


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
