"""Profiles: contours that come with the package, and CSV files of them.

A CSV file has a header with the columns ``height`` and ``radius``, one length
unit, from bottom to top; lines that start with # are comments.  Files that
jaxclay writes carry more, so that reading them back gives the same clay: l and
r0 as comments, each slice's ``thickness`` and ``top``, with its ``material`` where slices are
of unequal volume, and the edges of tools as comments.
"""

from __future__ import annotations

import csv
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from jaxclay.clay.clay import Clay, Converted
from jaxclay.clay.contour import check_rises, polyline, slice_points
from jaxclay.clay.slicing import clip_radii
from jaxclay.files.replacing import replacing
from jaxclay.files.tables import COLUMNS, Comment, as_finite, read_table
from jaxclay.numerics.checks import check_positive
from jaxclay.numerics.distance import farthest

# The Utah teapot's body (M. Newell 1975): cubic Bezier control points (radius, height).
_TEAPOT_BODY = (
    ((1.5, 0.0), (1.5, 0.075), (2.0, 0.3), (2.0, 0.75)),
    ((2.0, 0.75), (2.0, 1.2), (1.75, 1.725), (1.5, 2.25)),
)
_POINTS = 129
_FEWEST, _MOST = 64, 2048  # slices, where nobody says how many,
_NEAR = 1e-5  # of l: and how near they should be to the profile


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


def load_profile(
    source: str | os.PathLike, slices: int | None = None, minimum_radius: float | None = None
) -> Clay:
    """Clay from a packaged profile or a CSV file.

    Parameters
    ----------
    source : str or path
        "teapot", "amphora", "bowl", or a CSV file with columns height and radius.
    slices : int, optional
        If not given, those of the clay in a file that jaxclay wrote, and for other profiles 64
        or twice as many until the contour is within 1e-5 l of the profile's, 2048 at most.
    minimum_radius : float, optional
        Radii below it are raised to it, to clip a pointed tip.

    Raises
    ------
    ValueError
        An unknown name, or a bad line of the file: which, and what is allowed.
    OSError
        The file cannot be read.
    """
    return loaded(source, slices, minimum_radius).clay


def loaded(
    source: str | os.PathLike, slices: int | None = None, minimum_radius: float | None = None
) -> Converted:
    """The clay of :func:`load_profile`, and how far its contour is off the profile's, over l."""
    if str(source) in PROFILES:
        return _cut(*PROFILES[str(source)](), slices, minimum_radius)
    path = Path(source)
    if not path.exists() and path.suffix != ".csv":
        raise ValueError(
            f"no profile {str(source)!r}: choose from {', '.join(PROFILES)}, or name a CSV file"
        )
    try:
        table, comments = read_table(path)
        saved = _saved_clay(table, comments) if minimum_radius is None else None
        if saved is None:
            return _cut(table["height"], table["radius"], slices, minimum_radius)
    except ValueError as error:  # of which a UnicodeDecodeError is one
        raise ValueError(f"{path}: {error}") from None
    return Converted(saved, 0.0) if slices in (None, saved.slices) else saved.resliced(slices)


def _cut(
    heights: np.ndarray, radii: np.ndarray, slices: int | None, minimum_radius: float | None
) -> Converted:
    """The profile in slices of equal volume, as many as bring it near if that was not said."""
    count = _FEWEST if slices is None else slices
    while True:
        clay = Clay.from_profile(heights, radii, count, minimum_radius)
        points = np.stack([clip_radii(radii, minimum_radius), heights - heights[0]], axis=1)
        outline = np.pad(points, ((1, 1), (0, 0)))
        outline[-1, 1] = points[-1, 1]
        contour = polyline(clay)
        error = max(farthest(contour, outline), farthest(outline, contour)) / float(clay.unit)
        if slices is not None or error <= _NEAR or count >= _MOST:
            return Converted(clay, error)
        count *= 2


def _saved_clay(table: dict, comments: list[Comment]) -> Clay | None:
    """The clay of a file that jaxclay wrote; None of another's."""
    found = {c.name: c for c in comments if c.name in ("unit", "r0")}
    if len(found) < 2 or not set(COLUMNS[:4]) <= set(table):
        return None
    marks = {}
    for name, comment in found.items():
        marks[name] = as_finite(comment.line, name, comment.value)
        check_positive(f"line {comment.line}: {name}", marks[name])
    return _saved_slices(table, marks, [c for c in comments if c.name == "edge"])


def _saved_slices(table: dict, marks: dict, comments: list[Comment]) -> Clay:
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
    return clay


def save_profile(clay: Clay, path: str | os.PathLike) -> None:
    """Write the contour as CSV, in the clay's length unit.

    Rows of height, radius, thickness and top, and of material where the slices' volumes differ:
    the slices, radius at mid-height, top and material (the fraction of the
    volume below it) of their upper boundary, with rows of no thickness at the edges of tools
    and at either end, where the contour turns to the axis.  The sum of pi radius^2
    thickness is the clay's volume to rounding; the smooth solid through the same
    points differs by O(h^2).  The file appears whole or not at all.

    Raises
    ------
    ValueError
        A contour that does not rise.
    OSError
        The file cannot be written.
    """
    check_rises(clay)
    comments = [f"# unit = {float(clay.unit)!r}", f"# r0 = {float(clay.r0)!r}"]
    comments += [f"# edge = {float(u)!r} {float(radius)!r}" for u, radius in clay.edges]
    columns = _rows(clay)
    with replacing(path) as temporary, temporary.open("w", newline="") as file:
        file.write("\n".join(comments) + "\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        for row in zip(*columns.values(), strict=True):
            writer.writerow([repr(float(v)) for v in row])


def _rows(clay: Clay) -> dict[str, np.ndarray]:
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


def _rising(y: np.ndarray) -> np.ndarray:
    """Heights of rows that rise: where the radius jumps, its upper value is a rounding higher."""
    return np.where(np.append(False, np.diff(y) <= 0), np.nextafter(y, np.inf), y)
