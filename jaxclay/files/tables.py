"""Reading CSV files of contours: columns of numbers, and comments that may mean something."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np

COLUMNS = ("height", "radius", "thickness", "top", "material")


class Comment(NamedTuple):
    """A line "# name = value" of a file."""

    line: int
    name: str
    value: str


def read_table(path: Path) -> tuple[dict[str, np.ndarray], list[Comment]]:
    """The columns of a CSV file that are known, and its comments.

    Raises
    ------
    ValueError
        Names the line that is wrong and what is allowed.
    """
    comments: list[Comment] = []
    header: list[str] | None = None
    rows: list[dict[str, float]] = []
    with path.open(newline="", encoding="utf-8-sig") as file:
        for number, line in enumerate(file, 1):
            text = line.strip()
            if text.startswith("#"):
                name, _, value = text[1:].partition("=")
                comments.append(Comment(number, name.strip(), value))
                continue
            if not text:
                continue
            try:
                cells = [cell.strip() for cell in next(csv.reader([text]))]
            except csv.Error as error:
                raise ValueError(f"line {number} is no CSV: {error}") from None
            if header is None:
                header = _checked_header(number, cells)
                continue
            if len(cells) != len(header):
                raise ValueError(
                    f"line {number}: {text!r} has {len(cells)} values, but the header names "
                    f"{len(header)}: {','.join(header)}"
                )
            named = dict(zip(header, cells, strict=True))
            row = {name: as_finite(number, name, named[name]) for name in COLUMNS if name in named}
            _check_row(number, row, rows[-1] if rows else None)
            rows.append(row)
    if header is None or len(rows) < 2:
        raise ValueError("a profile needs a header height,radius and at least 2 lines")
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}, comments


def _checked_header(number: int, cells: list[str]) -> list[str]:
    header = [cell.lower() for cell in cells]
    for name in COLUMNS:
        if header.count(name) > 1:
            raise ValueError(f"line {number}: the header names {name} twice")
    if not {"height", "radius"} <= set(header):
        raise ValueError(
            f"line {number}: the header {','.join(cells)!r} must name the columns height and radius"
        )
    return header


def _check_row(number: int, row: dict[str, float], before: dict[str, float] | None) -> None:
    if row["radius"] < 0:
        raise ValueError(f"line {number}: radius is {row['radius']:g}, must be positive")
    if not 0 <= row.get("material", 0.0) <= 1:
        raise ValueError(f"line {number}: material is {row['material']:g}, must be from 0 to 1")
    if row.get("thickness", 0.0) < 0:
        raise ValueError(f"line {number}: thickness is {row['thickness']:g}, must be at least 0")
    if before and not row["height"] > before["height"]:
        raise ValueError(
            f"line {number}: height {row['height']:g} does not increase: the line before has "
            f"{before['height']:g}"
        )


def as_finite(number: int, name: str, text: str) -> float:
    """The number in ``text``, or an error that names the line and what it stands for."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise ValueError(f"line {number}: {name} {text.strip()!r} is not a finite number")
    return value
