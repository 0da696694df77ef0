"""Profiles: contours that come with the package, and CSV files of them.

A CSV file has a header with the columns ``height`` and ``radius``, one length
unit, from bottom to top; lines that start with # are comments.  Files that
jaxclay writes carry more, so that reading them back gives the same clay: l and
r0 as comments, and either each slice's ``thickness`` and ``top``, with its ``material``
where slices are of unequal volume and the edges of tools as comments, or, as comments, the
pieces of the function Y(u).
"""

from __future__ import annotations

import csv
import os
import tempfile
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import overload

import numpy as np

from jaxclay.bernstein import DEGREE
from jaxclay.checks import check_positive, check_slices
from jaxclay.clay import Clay, equal_nodes, on_nodes
from jaxclay.contour import polyline, slice_points
from jaxclay.distance import farthest
from jaxclay.smooth_clay import SmoothClay
from jaxclay.tables import COLUMNS, Comment, as_finite, read_table

# The Utah teapot's body (M. Newell 1975): cubic Bezier control points (radius, height).
_TEAPOT_BODY = (
    ((1.5, 0.0), (1.5, 0.075), (2.0, 0.3), (2.0, 0.75)),
    ((2.0, 0.75), (2.0, 1.2), (1.75, 1.725), (1.5, 2.25)),
)
_POINTS = 129
_ROWS_WITHIN = 1e-6  # of l, from the contour of a function


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
"""Heights and radii (m,) of the packaged profiles, of their own length units, by name."""


@overload
def load_profile(
    source: str | os.PathLike, slices: int, minimum_radius: float | None = None
) -> Clay: ...


@overload
def load_profile(
    source: str | os.PathLike, slices: None = None, minimum_radius: float | None = None
) -> Clay | SmoothClay: ...


def load_profile(
    source: str | os.PathLike, slices: int | None = None, minimum_radius: float | None = None
) -> Clay | SmoothClay:
    """Clay from a packaged profile or a CSV file.

    Parameters
    ----------
    source : str or path
        "teapot", "amphora", "bowl", or a CSV file with columns height and radius.
    slices : int, optional
        64 if not given; for a file that jaxclay wrote, the clay it has, in
        slices or as a function.
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
        table, comments = read_table(path)
        saved = _saved_clay(table, comments, slices) if minimum_radius is None else None
        if saved is not None:
            return saved
        slices = 64 if slices is None else slices
        return Clay.from_profile(table["height"], table["radius"], slices, minimum_radius)
    except ValueError as error:  # of which a UnicodeDecodeError is one
        raise ValueError(f"{path}: {error}") from None


def _saved_clay(table: dict, comments: list[Comment], slices: int | None):
    """The clay of a file that jaxclay wrote; None of another's."""
    found = {c.name: c for c in comments if c.name in ("unit", "r0")}
    pieces = [c for c in comments if c.name == "piece"]
    if len(found) < 2 or not (pieces or set(COLUMNS[:4]) <= set(table)):
        return None
    marks = {}
    for name, comment in found.items():
        marks[name] = as_finite(comment.line, name, comment.value)
        check_positive(f"line {comment.line}: {name}", marks[name])
    if not pieces:
        edges = [c for c in comments if c.name == "edge"]
        return _saved_slices(table, marks, edges, slices)
    clay = _saved_function(table, marks, pieces)
    return clay if slices is None else clay.sliced(slices).clay


def _saved_function(table: dict, marks: dict, pieces: list[Comment]) -> SmoothClay:
    """The function whose pieces the comments hold, if the rows are points of it."""
    numbers = []
    for comment in pieces:
        words = comment.value.split()
        if len(words) != DEGREE + 2:
            raise ValueError(
                f"line {comment.line}: a piece has its first u and {DEGREE + 1} heights, not "
                f"{len(words)} numbers"
            )
        numbers.append([as_finite(comment.line, "piece", word) for word in words])
    values = np.array(numbers)
    clay = SmoothClay(np.append(values[:, 0], 1.0), values[:, 1:], marks["r0"], marks["unit"])
    rows = np.stack([table["radius"], table["height"]], axis=1)
    contour = polyline(clay)[1:-1]
    apart = max(farthest(rows, contour), farthest(contour, rows))
    if apart > 2 * _ROWS_WITHIN * clay.unit:
        raise ValueError(
            f"the rows are up to {apart:g} away from the pieces in the comments: a file edited by "
            "hand must not keep the lines that start with # piece"
        )
    return clay


def _saved_slices(table: dict, marks: dict, comments: list[Comment], slices: int | None) -> Clay:
    """The clay of a file that jaxclay wrote; on another grid with the heights of its function."""
    is_slice = table["thickness"] > 0
    heights = np.concatenate([[0.0], table["top"][is_slice]])
    material = table.get("material")
    if material is not None:
        material = np.concatenate([[0.0], material[is_slice]])
    edges = []
    for comment in comments:
        words = comment.value.split()
        if len(words) != 2:
            raise ValueError(f"line {comment.line}: an edge has its u and its radius, two numbers")
        edges.append([as_finite(comment.line, "edge", word) for word in words])
    clay = Clay(
        heights, table["thickness"][is_slice], marks["r0"], marks["unit"], material,
        np.array(edges).reshape(-1, 2),
    )  # fmt: skip
    wrong = ~np.isclose(clay.radii, table["radius"][is_slice], rtol=1e-9, atol=0)
    if wrong.any():
        i = int(np.argmax(wrong))
        raise ValueError(
            f"radius {table['radius'][is_slice][i]:g} of slice {i} is not that of its thickness, "
            f"{clay.radii[i]:g}: a file edited by hand must not keep the columns thickness and top"
        )
    if slices is None or slices == clay.slices:
        return clay
    check_slices(slices)
    return on_nodes(clay, equal_nodes(slices))


def save_profile(clay: Clay | SmoothClay, path: str | os.PathLike) -> None:
    """Write the contour as CSV, in the clay's length unit.

    Of clay in slices, rows of height, radius, thickness and top, and of material where their
    volumes differ: the slices, radius at mid-height, top and material (the fraction of the
    volume below it) of their upper boundary, with rows of no thickness at the edges of tools
    and at either end, where the contour turns to the axis.  The sum of pi radius^2
    thickness is the clay's volume to rounding; the smooth solid through the same
    points differs by O(h^2).

    Of a function, rows of height and radius that lie on the contour and so close
    that the line through them is within 1e-6 l of it; comments hold the function
    itself.  The file appears whole or not at all.

    Raises
    ------
    OSError
        The file cannot be written.
    """
    comments = [f"# unit = {float(clay.unit)!r}", f"# r0 = {float(clay.r0)!r}"]
    if isinstance(clay, Clay):
        comments += [f"# edge = {float(u)!r} {float(radius)!r}" for u, radius in clay.edges]
    if isinstance(clay, SmoothClay):
        comments += [
            "# piece = " + " ".join(repr(float(v)) for v in (start, *heights))
            for start, heights in zip(clay.breaks[:-1], clay.control, strict=True)
        ]
        columns = _rows_of_function(clay)
    else:
        columns = _rows_of_slices(clay)
    with replacing(path) as temporary, temporary.open("w", newline="") as file:
        file.write("\n".join(comments) + "\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            writer.writerow([repr(float(v)) for v in row])


def _rows_of_slices(clay: Clay) -> dict[str, np.ndarray]:
    points, node = slice_points(clay), np.asarray(clay.heights)
    top = np.searchsorted(node, points[:, 1])
    at_edge = node[np.minimum(top, clay.slices)] == points[:, 1]
    thickness = np.where(at_edge, 0.0, np.append(clay.thickness, 0.0)[np.maximum(top - 1, 0)])
    columns = {
        "height": _rising(points[:, 1]),
        "radius": points[:, 0],
        "thickness": thickness,
        "top": node[top],
    }
    return columns if clay.equal else columns | {"material": clay.material[top]}


def _rows_of_function(clay: SmoothClay) -> dict[str, np.ndarray]:
    X, y = polyline(clay, _ROWS_WITHIN)[1:-1].T
    return {"height": _rising(y), "radius": X}


def _rising(y: np.ndarray) -> np.ndarray:
    """Heights of rows that rise: where the radius jumps, its upper value is a rounding higher."""
    return np.where(np.append(False, np.diff(y) <= 0), np.nextafter(y, np.inf), y)


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
