"""Profiles: contours that come with the package, and CSV files of them.

A CSV file has a header with the columns ``height`` and ``radius``, one length
unit, from bottom to top; lines that start with # are comments.  Files that
jaxclay writes also carry each slice's ``thickness`` and ``top`` and, as comments,
l and r0, so that reading them back gives the same slices.
"""

from __future__ import annotations

import csv
import os
import tempfile
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from jaxclay.checks import check_positive, check_slices
from jaxclay.clay import Clay

# The Utah teapot's body (M. Newell 1975): cubic Bezier control points (radius, height).
_TEAPOT_BODY = (
    ((1.5, 0.0), (1.5, 0.075), (2.0, 0.3), (2.0, 0.75)),
    ((2.0, 0.75), (2.0, 1.2), (1.75, 1.725), (1.5, 2.25)),
)
_POINTS = 129
_COLUMNS = ("height", "radius", "thickness", "top")


def _teapot() -> tuple[np.ndarray, np.ndarray]:
    s = np.linspace(0, 1, _POINTS)[:, None]
    pieces = []
    for a, b, c, d in np.array(_TEAPOT_BODY):
        ends = (1 - s) ** 3 * a + s**3 * d
        pieces.append(ends + 3 * s * (1 - s) * ((1 - s) * b + s * c))
    points = np.concatenate([pieces[0], pieces[1][1:]])
    return points[:, 1], points[:, 0]


def _amphora() -> tuple[np.ndarray, np.ndarray]:
    """A belly between a foot and a neck of the same radius, and a lip."""
    y = np.linspace(0, 1, _POINTS)
    belly = 0.19 * np.sin(np.pi * np.minimum(y / 0.82, 1)) ** 2
    lip = 0.03 * np.maximum((y - 0.82) / 0.18, 0) ** 2
    return y, 0.08 + belly + lip


def _bowl() -> tuple[np.ndarray, np.ndarray]:
    """A quarter of a sine on a foot."""
    y = np.linspace(0, 0.6, _POINTS)
    return y, 0.2 + 0.4 * np.sin(np.pi / 2 * y / 0.6)


PROFILES: dict[str, Callable[[], tuple[np.ndarray, np.ndarray]]] = {
    "teapot": _teapot,
    "amphora": _amphora,
    "bowl": _bowl,
}


def load_profile(
    source: str | os.PathLike, slices: int | None = None, minimum_radius: float | None = None
) -> Clay:
    """Clay from a packaged profile or a CSV file.

    Parameters
    ----------
    source : str or path
        "teapot", "amphora", "bowl", or a CSV file with columns height and radius.
    slices : int, optional
        64 if not given; for a file that jaxclay wrote, the slices it has.
    minimum_radius : float, optional
        Radii below it are raised to it, to clip a pointed tip.

    Raises
    ------
    ValueError
        An unknown name, or a bad line of the file: which, and what is allowed.
    OSError
        The file cannot be read.
    """
    if str(source) in PROFILES:
        heights, radii = PROFILES[str(source)]()
        return Clay.from_profile(heights, radii, 64 if slices is None else slices, minimum_radius)
    path = Path(source)
    if not path.exists() and path.suffix != ".csv":
        raise ValueError(
            f"no profile {str(source)!r}: choose from {', '.join(PROFILES)}, or name a CSV file"
        )
    try:
        table, marks = _read_csv(path)
        if marks and minimum_radius is None:
            return _saved_clay(table, marks, slices)
        slices = 64 if slices is None else slices
        return Clay.from_profile(table["height"], table["radius"], slices, minimum_radius)
    except ValueError as error:  # of which a UnicodeDecodeError is one
        raise ValueError(f"{path}: {error}") from None


def _saved_clay(table: dict, marks: dict, slices: int | None) -> Clay:
    """The clay of a file that jaxclay wrote; on another grid each slice keeps its radius."""
    is_slice = table["thickness"] > 0
    heights = np.concatenate([[0.0], table["top"][is_slice]])
    clay = Clay(heights, table["thickness"][is_slice], marks["r0"], marks["unit"])
    wrong = ~np.isclose(clay.radii, table["radius"][is_slice], rtol=1e-9, atol=0)
    if wrong.any():
        i = int(np.argmax(wrong))
        raise ValueError(
            f"radius {table['radius'][is_slice][i]:g} of slice {i} is not that of its thickness, "
            f"{clay.radii[i]:g}: a file edited by hand must not keep the columns thickness and top"
        )
    if slices in (None, clay.slices):
        return clay
    check_slices(slices)
    old, new = (np.arange(n + 1) / n for n in (clay.slices, slices))
    heights = np.interp(new, old, heights)
    return Clay(heights, np.diff(heights), clay.r0, clay.unit)


def save_profile(clay: Clay, path: str | os.PathLike) -> None:
    """Write the contour as CSV: columns height, radius, thickness, top; the clay's length unit.

    Rows are the slices, radius at mid-height, top their upper boundary, with a
    row of no thickness at either end, where the contour turns to the axis.  The sum of pi radius^2
    thickness is the clay's volume to rounding; the smooth solid through the same
    points differs by O(h^2).  The file appears whole or not at all.
    """
    y, t, X = (np.asarray(v) for v in (clay.heights, clay.thickness, clay.radii))
    heights = np.concatenate([[0.0], (y[:-1] + y[1:]) / 2, [y[-1]]])
    radii, thickness = np.concatenate([X[:1], X, X[-1:]]), np.concatenate([[0.0], t, [0.0]])
    tops = np.concatenate([y, y[-1:]])
    with replacing(path) as temporary, temporary.open("w", newline="") as file:
        file.write(f"# unit = {float(clay.unit)!r}\n# r0 = {float(clay.r0)!r}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["height", "radius", "thickness", "top"])
        for row in zip(heights, radii, thickness, tops, strict=True):
            writer.writerow([repr(float(v)) for v in row])


@contextmanager
def replacing(path: str | os.PathLike):
    """A temporary file beside ``path`` that takes its place when the block ends well."""
    path = Path(path)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o666 & ~_umask())
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _read_csv(path: Path) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """The file's columns as numbers; l and r0 too if jaxclay wrote it."""
    comments: dict[str, tuple[int, str]] = {}
    header: list[str] | None = None
    rows: list[dict[str, float]] = []
    with path.open(newline="", encoding="utf-8-sig") as file:
        for number, line in enumerate(file, 1):
            text = line.strip()
            if text.startswith("#"):
                name, _, value = text[1:].partition("=")
                comments[name.strip()] = number, value
                continue
            if not text:
                continue
            cells = [cell.strip() for cell in next(csv.reader([text]))]
            if header is None:
                header = _checked_header(number, cells)
                continue
            if len(cells) != len(header):
                raise ValueError(
                    f"line {number}: {text!r} has {len(cells)} values, but the header names "
                    f"{len(header)}: {','.join(header)}"
                )
            named = dict(zip(header, cells, strict=True))
            row = {
                name: _as_number(number, name, named[name]) for name in _COLUMNS if name in named
            }
            _check_row(number, row, rows[-1] if rows else None)
            rows.append(row)
    if header is None or len(rows) < 2:
        raise ValueError("a profile needs a header height,radius and at least 2 lines")
    marks: dict[str, float] = {}
    if set(_COLUMNS) <= set(header) and {"unit", "r0"} <= set(comments):
        for name in ("unit", "r0"):
            number, value = comments[name]
            marks[name] = _as_number(number, name, value)
            check_positive(f"line {number}: {name}", marks[name])
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}, marks


def _checked_header(number: int, cells: list[str]) -> list[str]:
    header = [cell.lower() for cell in cells]
    for name in _COLUMNS:
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
    if row.get("thickness", 0.0) < 0:
        raise ValueError(f"line {number}: thickness is {row['thickness']:g}, must be at least 0")
    if before and not row["height"] > before["height"]:
        raise ValueError(
            f"line {number}: height {row['height']:g} does not increase: the line before has "
            f"{before['height']:g}"
        )


def _as_number(number: int, name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise ValueError(f"line {number}: {name} {text.strip()!r} is not a finite number")
    return value
