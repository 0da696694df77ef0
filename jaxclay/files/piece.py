"""A piece: clay with all that is needed to go on from it exactly, as JSON, version 1.

An object with these keys, in the piece's own length unit and its own heights:

``version``
    1, a whole number.
``unit``
    l, length: the height of the piece when it first became clay.
``length_unit``
    What lengths are measured in, one of :data:`jaxclay.files.units.UNITS` such as "mm", or null.
``r0``, ``nodes``, ``heights``, ``thickness``, ``edges``
    The clay: r0 = sqrt(volume / pi), length^(3/2); n+1 material coordinates from 0 to 1; the n+1
    heights of these nodes, length, the first of them the height that the piece stands at; the n
    differences of heights, length, which heights alone know to rounding only (and which are
    theirs where the key is missing); rows [u, radius] of the edges of tools, radius a length.
``material``
    ``k``, ``mu``, ``alpha``, ``beta`` (as printed, eq. 21) and ``floor``, without unit.
``start``
    The clay that the strokes began from: an object with ``r0``, ``nodes``, ``heights``,
    ``thickness`` and ``edges``, of the same l, standing at the same height.
``strokes``
    A list, in order, that may be empty.  Each is an object: ``side``, "right" or "left", where
    the tool is seen; ``size``, length, the tool's height; ``face``, length, the height of its
    face that touches the clay; ``material`` as above, or null for the piece's own; ``path``,
    rows [height, radius], lengths, where the middle of the face went; ``kind``, "press" or
    "smooth"; ``solver``, an object with ``method``, ``scheme``, ``slices`` (0 for as many as the
    modeller's tolerance needs) and ``most`` (slices then), or null for the modeller's own.

Numbers are written so that they read back bit for bit.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
from pathlib import Path

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.files.checked import (
    Raw,
    as_list,
    as_number,
    as_numbers,
    as_object,
    as_pairs,
    parsed,
    short,
)
from jaxclay.files.replacing import replacing
from jaxclay.files.stroke import MOST_POINTS, Stroke, constants, material_of, stroke_of
from jaxclay.files.units import UNITS
from jaxclay.model.material import Material
from jaxclay.numerics.checks import check_increasing, check_nodes, check_positive

VERSION = 1
_MOST_BYTES = 2**26
_MOST_NODES = 2**17
_CLAY = ("r0", "nodes", "heights", "thickness", "edges")
_PIECE = ("version", "unit", "length_unit", *_CLAY, "material", "start", "strokes")
_OPTIONAL = ("length_unit", "thickness")


@dataclasses.dataclass(frozen=True, eq=False)
class Piece:
    """Clay, what it is made of and how it came about: see the module.

    Attributes
    ----------
    clay : Clay
        As it is now.  Where ``base`` is not 0 its heights are rounded to those over the base that
        the form can hold, so that a piece reads back bit for bit.
    material : Material
    start : Clay
        Before the first stroke; ``clay`` if not given.
    strokes : tuple of Stroke
    base : float, length
        The height that the piece stands at; a clay's own heights begin at 0.
    length_unit : str, optional
        What lengths are measured in.

    Raises
    ------
    ValueError
        A ``start`` of another l, an unknown length unit, a base so far off that heights are lost.
    """

    clay: Clay
    material: Material = dataclasses.field(default_factory=Material)
    start: Clay = None  # type: ignore[assignment]
    strokes: tuple[Stroke, ...] = ()
    base: float = 0.0
    length_unit: str | None = None

    def __post_init__(self):
        put = object.__setattr__
        put(self, "strokes", tuple(self.strokes))
        put(self, "base", float(self.base))
        if self.length_unit is not None and self.length_unit not in UNITS:
            raise ValueError(
                f"length_unit must be one of {', '.join(UNITS)}, got {short(self.length_unit)}"
            )
        start = self.clay if self.start is None else self.start
        if start.unit != self.clay.unit:
            raise ValueError(
                f"start must be of the piece's unit {self.clay.unit:g}, got {start.unit:g}"
            )
        put(self, "clay", _standing(self.clay, self.base))
        put(self, "start", _standing(start, self.base))


def load_piece(path: str | os.PathLike) -> Piece:
    """Read a piece.

    Raises
    ------
    ValueError
        What is wrong with it, in one line that begins with the file.
    OSError
        The file cannot be read.
    """
    with Path(path).open("rb") as file:
        data = file.read(_MOST_BYTES + 1)
    try:
        return piece_of_json(data.decode("utf-8-sig"))
    except ValueError as error:  # of which a UnicodeDecodeError is one
        raise ValueError(f"{path}: {error}") from None


def save_piece(path: str | os.PathLike, piece: Piece) -> None:
    """Write a piece; the file appears whole or not at all.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_text(piece_to_json(piece) + "\n", encoding="utf-8")


def piece_to_json(piece: Piece) -> str:
    """The text of a piece, one line."""
    first = {"version": VERSION, "unit": float(piece.clay.unit), "length_unit": piece.length_unit}
    strokes = [
        dataclasses.asdict(stroke) | {"material": stroke.material and constants(stroke.material)}
        for stroke in piece.strokes
    ]
    last = {"start": _clay_raw(piece.start, piece.base), "strokes": strokes}
    first |= _clay_raw(piece.clay, piece.base) | {"material": constants(piece.material)}
    return json.dumps(first | last, allow_nan=False)


def piece_of_json(text: str) -> Piece:
    """The piece that a text says.

    Raises
    ------
    ValueError
        What is wrong, in one line: no JSON, nested or large beyond any piece, written by a newer
        version, a key that is missing, unknown, twice there or of the wrong type, numbers that
        are not finite, no clay.
    """
    if len(text) > _MOST_BYTES:
        raise ValueError(f"larger than any piece: more than {_MOST_BYTES // 2**20} MiB")
    raw = parsed(text)
    if not isinstance(raw, dict):
        raise ValueError(f"no piece: must be an object with the keys {', '.join(_PIECE)}")
    version = raw.get("version")
    if type(version) is int and version > VERSION:
        raise ValueError(
            f"a piece of version {short(version)}, but this jaxclay reads version {VERSION}: "
            "open it with a newer jaxclay"
        )
    if type(version) is not int or version != VERSION:
        raise ValueError(f"no piece: version must be {VERSION}, got {short(version)}")
    as_object(raw, "the piece", _PIECE, _OPTIONAL)
    unit = as_number(raw["unit"], "unit")
    check_positive("unit", unit)
    clay, base = _clay(raw, unit, "")
    start, foot = _clay(as_object(raw["start"], "start", _CLAY, _OPTIONAL), unit, "start.")
    if foot != base:
        raise ValueError(f"start stands at {foot:g}, but the piece at {base:g}: it does not move")
    strokes = as_list(raw["strokes"], "strokes", MOST_POINTS)
    length_unit = raw.get("length_unit")
    material = material_of(raw["material"], "material")
    if length_unit is not None and not isinstance(length_unit, str):
        raise ValueError(f"length_unit must be a text or null, got {short(length_unit)}")
    found = tuple(stroke_of(stroke, f"strokes[{i}]") for i, stroke in enumerate(strokes))
    if sum(len(stroke.path) for stroke in found) > MOST_POINTS:
        raise ValueError(f"strokes have more than {MOST_POINTS} points")
    return Piece(clay, material, start, found, base, length_unit)


def _standing(clay: Clay, base: float) -> Clay:
    """The clay with heights that base + height, rounded, keeps."""
    if not math.isfinite(base):
        raise ValueError(f"base must be finite, got {base:g}")
    if base == 0:
        return clay
    heights = np.asarray(clay.heights)
    for _ in range(3):  # the second finds the same, but where a half was rounded to even
        heights = (base + heights) - base
    if np.array_equal(heights, clay.heights):
        return clay
    if not (np.diff(heights) > 0).all():
        raise ValueError(f"heights of {heights[-1]:g} over a base of {base:g} are lost in rounding")
    return dataclasses.replace(clay, heights=heights)


def _clay_raw(clay: Clay, base: float) -> Raw:
    values = {
        "nodes": clay.material,
        "heights": base + np.asarray(clay.heights),
        "thickness": clay.thickness,
        "edges": clay.edges,
    }
    return {"r0": float(clay.r0)} | {key: np.asarray(v).tolist() for key, v in values.items()}


def _clay(raw: Raw, unit: float, where: str) -> tuple[Clay, float]:
    """The clay and the height that it stands at."""
    nodes, y = (as_numbers(raw[key], where + key, _MOST_NODES) for key in ("nodes", "heights"))
    check_nodes(f"{where}nodes", nodes)
    if len(y) != len(nodes):
        raise ValueError(f"{where}heights must be {len(nodes)}, one a node, got {len(y)}")
    check_increasing(y, f"{where}heights")
    heights, base = y - y[0], float(y[0])
    check_increasing(heights, f"{where}heights over the first")
    given = raw.get("thickness")
    thickness = (
        np.diff(heights) if given is None else as_numbers(given, f"{where}thickness", _MOST_NODES)
    )
    edges = np.reshape(as_pairs(raw["edges"], f"{where}edges", 2 * _MOST_NODES), (-1, 2))
    try:
        return Clay(
            heights, thickness, as_number(raw["r0"], f"{where}r0"), unit, nodes, edges
        ), base
    except ValueError as error:
        raise ValueError(f"{where.rstrip('.') or 'the piece'} is no clay: {error}") from None
