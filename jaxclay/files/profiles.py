"""Profiles: contours that come with the package, and those of files.

A file is a table with the height and the radius of a contour, in the ways that people have it:
:func:`jaxclay.files.reading.read_table` takes it apart, :func:`jaxclay.files.columns.find_columns`
finds the columns, :func:`jaxclay.clay.outline.outline` makes one line from foot to rim of them.
Or it is a piece (:mod:`jaxclay.files.piece`).  What was taken for what is told.
"""

from __future__ import annotations

import csv
import dataclasses
import os
import warnings
from pathlib import Path

import numpy as np

from jaxclay.clay.clay import NEAR, Clay, Converted, cut
from jaxclay.clay.contour import check_rises, slice_points
from jaxclay.clay.outline import Outline, outline
from jaxclay.files.cells import numbers_of
from jaxclay.files.columns import find_columns
from jaxclay.files.packaged import PROFILES as PROFILES
from jaxclay.files.piece import Piece, load_piece
from jaxclay.files.reading import read_table
from jaxclay.files.replacing import replacing

_FLATTEST, _SLIMMEST = 100.0, 1000.0  # radius over height, height over radius, of one unit
_TABLES = (".csv", ".tsv", ".txt", ".json")


@dataclasses.dataclass(frozen=True)
class Profile:
    """A contour as it was read, whole.

    Attributes
    ----------
    name : str
        The packaged profile or the file.
    drawn : Outline or Piece
        The contour in the file's own heights, or the piece that the file is.
    length_unit : str, optional
        Of :data:`jaxclay.files.units.UNITS`, where the file or somebody says it.
    said : str
        What was taken for what, as "read 57 rows: semicolons, height and diameter in mm".
    """

    name: str
    drawn: Outline | Piece
    length_unit: str | None = None
    said: str = ""

    @property
    def base(self) -> float:
        """The height that the contour begins at, length."""
        drawn = self.drawn
        return drawn.base if isinstance(drawn, Piece) else float(drawn.heights[0])

    def cut(self, slices: int | None = None, near: float = NEAR) -> Converted:
        """Its clay, and how far the clay's contour is off, over l.

        In ``slices`` of equal volume, or if that is None in as many as bring the contour within
        ``near`` of l; a piece as it is.
        """
        if isinstance(self.drawn, Outline):
            return cut(self.drawn, slices, near)
        clay = self.drawn.clay
        return Converted(clay, 0.0) if slices is None else clay.resliced(slices)


def load_profile(
    source: str | os.PathLike,
    slices: int | None = None,
    minimum_radius: float | None = None,
    *,
    columns: str | None = None,
    unit: str | None = None,
) -> Clay:
    """Clay from a packaged profile or a file.

    Parameters
    ----------
    source : str or path
        "teapot", "amphora", "bowl", a table of heights and radii (CSV and its kin) or a piece
        (JSON).
    slices : int, optional
        Of equal volume.  If not given, as many as bring the contour within 1e-5 l of the
        profile's, and those of a piece.
    minimum_radius : float, optional
        Radii below it are raised to it.
    columns : str, optional
        "HEIGHT,RADIUS": the table's columns by their names, or by numbers from 1.
    unit : str, optional
        Of both columns, such as "mm".

    Raises
    ------
    ValueError
        An unknown name, or what is wrong with the file: in which line, and what to do.
    OSError
        The file cannot be read.

    Warns
    -----
    UserWarning
        The contour is not quite the file's: a tip was clipped, or two halves averaged.
    """
    profile = read_profile(source, minimum_radius, columns, unit)
    if isinstance(profile.drawn, Outline) and profile.drawn.altered:
        warnings.warn(f"{source}: {', '.join(profile.drawn.altered)}", stacklevel=2)
    return profile.cut(slices).clay


def loaded(
    source: str | os.PathLike, slices: int | None = None, minimum_radius: float | None = None
) -> Converted:
    """The clay of :func:`load_profile`, and how far its contour is off the profile's, over l."""
    return read_profile(source, minimum_radius).cut(slices)


def read_profile(
    source: str | os.PathLike,
    minimum_radius: float | None = None,
    columns: str | None = None,
    unit: str | None = None,
) -> Profile:
    """The contour of a packaged profile or of a file; takes and raises as :func:`load_profile`."""
    name, path = str(source), Path(source)
    table = {"columns": columns, "unit": unit}
    if name in PROFILES:
        _refuse(name, "is no table", table)
        return Profile(name, outline(*PROFILES[name](), minimum_radius))
    if not path.exists() and path.suffix.lower() not in _TABLES:
        raise ValueError(
            f"no profile {name!r}: choose from {', '.join(PROFILES)}, or name a CSV file"
        )
    if path.suffix.lower() == ".json":
        _refuse(name, "is a piece, no table", table | {"minimum_radius": minimum_radius})
        piece = load_piece(path)
        return Profile(name, piece, piece.length_unit, f"read {_piece_words(piece)}")
    data = path.read_bytes()
    try:
        return _of_table(name, data, minimum_radius, columns, unit)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _refuse(name: str, why: str, arguments: dict) -> None:
    for key, value in arguments.items():
        if value is not None:
            raise ValueError(f"{name} {why}: {key} {value!r} has no meaning for it")


def _piece_words(piece: Piece) -> str:
    return f"a piece: {piece.clay.slices} slices, {len(piece.strokes)} strokes" + (
        f", in {piece.length_unit}" if piece.length_unit else ""
    )


def _of_table(
    name: str, data: bytes, minimum_radius: float | None, columns: str | None, unit: str | None
) -> Profile:
    table = read_table(data)
    found = find_columns(table, columns, unit)
    what = ("height", found.height), (found.quantity, found.across)
    cells = [
        (row.line, word, row.cells[place] if place < len(row.cells) else "")
        for row in found.rows
        for word, place in what
    ]
    numbers, commas = numbers_of(cells)
    heights, across = numbers.reshape(-1, 2).T
    told = [*table.told, *(["decimal commas"] if commas else []), *found.told]
    if not found.headed and not _is_sorted(heights) and _is_sorted(across):
        heights, across = across, heights
        told[-1] += ", the other way round, as only that column rises or falls"
    radii = across / {"radius": 1.0, "diameter": 2.0, "circumference": 2 * np.pi}[found.quantity]
    drawn = outline(heights, radii, minimum_radius, lambda i: f"line {found.rows[i].line}")
    if unit is None:
        _check_proportions(drawn, found.rows[int(np.argmax(np.abs(radii)))].line)
    base = float(drawn.heights[0])
    told += [*drawn.told, *([f"standing at {base:g}"] if base else [])]
    said = f"read {len(found.rows)} rows: {', '.join(told)}"
    return Profile(name, drawn, found.unit, said)


def _is_sorted(values: np.ndarray) -> bool:
    way = np.sign(np.diff(values))
    return bool((way >= 0).all() or (way <= 0).all())


def _check_proportions(drawn: Outline, line: int) -> None:
    tall, wide = float(np.ptp(drawn.heights)), float(drawn.radii.max())
    if wide > _FLATTEST * tall or tall > _SLIMMEST * wide:
        raise ValueError(
            f"line {line}: the radius is {wide:g}, but heights span {tall:g}: their units seem to "
            "differ. Bring both to one, or say --unit mm (or another) if they are in it"
        )


def save_profile(
    clay: Clay, path: str | os.PathLike, base: float = 0.0, length_unit: str | None = None
) -> None:
    """Write the contour as a table of height and radius, CSV, that any program opens.

    One row a slice, at mid-height, and one at the edges of tools and at either end; two of one
    height where the radius jumps.  Read back the table has the same contour
    (:func:`jaxclay.contour_error`) within 1e-5 l; to go on from exactly this clay save a piece
    (:func:`jaxclay.files.piece.save_piece`).  The file appears whole or not at all.

    Parameters
    ----------
    clay : Clay
        Whose contour it is, in its own length unit.
    path : str or path
        Where.
    base : float, length
        The height that the clay stands at, from which heights are counted.
    length_unit : str, optional
        For the header, as in ``height_mm``.

    Raises
    ------
    ValueError
        A contour that does not rise.
    OSError
        The file cannot be written.
    """
    check_rises(clay)
    ending = f"_{length_unit}" if length_unit else ""
    with replacing(path) as temporary, temporary.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([f"height{ending}", f"radius{ending}"])
        for radius, height in slice_points(clay):
            writer.writerow([f"{float(value):.12g}" for value in (base + height, radius)])
