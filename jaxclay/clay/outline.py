"""From the points of a drawing to an outline: one radius, or two at a step, for each height.

Points come as people have them: from the rim down, on the left of the axis, on both sides of it,
with rows that close foot and lid.  What is no outline of a solid of clay is refused, by the row.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from jaxclay.numerics.arrays import Array, Float
from jaxclay.numerics.checks import check_positive

_LEAST = 0.03  # of the largest radius: what a tip is clipped to, as smoothing cannot resolve less
_AXIS = 1e-9  # of the largest radius: on the axis but for rounding
_LARGEST = 1e60  # length whose powers are still numbers
_HOLLOW = 0.5  # of the height: what both an outer and an inner line rise over
Name = Callable[[int], str]


@dataclasses.dataclass(frozen=True)
class Outline:
    """What a solid of clay is cut from.

    Attributes
    ----------
    heights, radii : (m,) arrays, length
        From bottom to top: heights never fall; one that is there twice is a step.
    told : tuple of str
        What was made of the points, in words.
    altered : tuple of str
        Those of the words by which the outline is no longer that of the points.
    """

    heights: Float[Array, "m"]
    radii: Float[Array, "m"]
    told: tuple[str, ...]
    altered: tuple[str, ...] = ()

    def clipped(self) -> Outline:
        """With tips on the axis raised to what clay can have."""
        least = _LEAST * self.radii.max()
        low = self.radii == 0
        if not low.any():
            return self
        ends = " and ".join(name for name, i in (("foot", 0), ("top", -1)) if low[i])
        said = f"radius 0 at the {ends} clipped to the floor {least:g}"
        radii = np.where(low, least, self.radii)
        return Outline(self.heights, radii, (*self.told, said), (*self.altered, said))


def outline(
    heights: Float[Array, "m"], radii: Float[Array, "m"], minimum: float | None = None,
    name: Name | None = None,
) -> Outline:  # fmt: skip
    """The outline that points describe.

    Parameters
    ----------
    heights, radii : (m,) arrays, same length unit
        From bottom to top or from top to bottom.  Radii to the left of the axis are negative; of
        points on both sides the mean is taken.
    minimum : float, optional
        Radii below it are raised to it; if not given, a tip on the axis to three hundredths of the
        largest.
    name : i -> str, optional
        What messages call point i, such as "line 7".

    Raises
    ------
    ValueError
        Names the first point that is wrong, why, and what to do: walls that overhang, an inner
        line beside the outer one, a radius of 0 between two ends, fewer than two heights.
    """
    name = name or "point {}".format
    for what, values in (("height", heights), ("radius", radii)):
        if not np.isfinite(values).all():
            i = int(np.argmin(np.isfinite(values)))
            raise ValueError(f"{name(i)}: {what} is {values[i]:g}, but it must be finite")
        if (large := np.abs(values) > _LARGEST).any():
            i = int(np.argmax(large))
            raise ValueError(f"{name(i)}: {what} is {values[i]:g}, but at most {_LARGEST:g} fits")
    if 0 < np.ptp(heights) < 1 / _LARGEST or 0 < np.abs(radii).max() < 1 / _LARGEST:
        raise ValueError(f"{name(0)}: heights or radii span less than {1 / _LARGEST:g}")
    axis = _AXIS * np.abs(radii).max(initial=0.0)
    side = np.where(np.abs(radii) <= axis, 0, np.sign(radii)).astype(int)
    size, told = np.where(side == 0, 0.0, np.abs(radii)), []
    if minimum is not None:
        check_positive("minimum_radius", minimum)
        told += [f"radii below {minimum:g} raised to it"] if (size < minimum).any() else []
        size = np.maximum(size, minimum)
    if (side < 0).any() and (side > 0).any():
        found = _both(heights, radii, size, side, name)
    else:
        found = _half(heights, size, np.arange(len(size)), name)
        told += ["mirrored from the left half"] if (side < 0).any() else []
    return dataclasses.replace(found, told=(*told, *found.told)).clipped()


def _both(
    heights: np.ndarray, radii: np.ndarray, size: np.ndarray, side: np.ndarray, name: Name
) -> Outline:
    """The mean of both halves over the heights that both have."""
    rows = np.flatnonzero(side)
    after = np.searchsorted(rows, np.arange(len(side)))
    next_side = side[rows[np.minimum(after, len(rows) - 1)]] * (after < len(rows))
    last_side = side[rows[np.maximum(after - 1, 0)]] * (after > 0)
    halves = []
    for word, sign in (("left", -1), ("right", 1)):
        # A point of the axis is that of the halves beside it.
        own = (side == sign) | ((side == 0) & ((next_side == sign) | (last_side == sign)))
        rows = np.flatnonzero(own)
        if len(np.unique(heights[rows])) < 2:
            i = int(np.flatnonzero(side == sign)[0])
            raise ValueError(
                f"{name(i)}: radius is {radii[i]:g}, alone on the {word} of the axis: a radius is "
                "positive, and of both halves of a drawing each needs 2 heights or more"
            )
        try:
            halves.append(_half(heights[rows], size[rows], rows, name))
        except ValueError as error:
            raise ValueError(f"{word} half: {error}") from None
    left, right = halves
    low = max(left.heights[0], right.heights[0])
    high = min(left.heights[-1], right.heights[-1])
    if low >= high:
        raise ValueError("the left and the right half have no height in common")
    at = np.union1d(left.heights, right.heights)
    at = at[(at >= low) & (at <= high)]
    sides = [np.stack(_seen(half, at), axis=1).ravel() for half in halves]  # below and above
    found = _tidy(np.repeat(at, 2), (sides[0] + sides[1]) / 2)
    apart = float(np.abs(sides[0] - sides[1]).max())
    said = f"both halves averaged, whose radii differ by up to {apart:.3g}"
    ends = [left.heights[0] - right.heights[0], left.heights[-1] - right.heights[-1]]
    if any(ends):
        said += f" and whose ends by {np.abs(ends).max():.3g}, which was left out"
    return Outline(*found, (said,), (said,))


def _seen(half: Outline, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Radii as seen from below and from above each height."""
    y, r = half.heights, half.radii
    found = []
    for side in ("left", "right"):
        j = np.clip(np.searchsorted(y, at, side=side), 1, len(y) - 1)
        step = y[j] - y[j - 1]
        share = np.where(step > 0, (at - y[j - 1]) / np.where(step > 0, step, 1.0), 1.0)
        between = r[j - 1] + share * (r[j] - r[j - 1])
        found.append(np.where(share == 1, r[j], between))
    below, above = found
    return np.where(at <= y[0], above, below), np.where(at >= y[-1], below, above)


def _half(heights: np.ndarray, radii: np.ndarray, rows: np.ndarray, name: Name) -> Outline:
    told = []
    if len(heights) < 2 or heights.min() == heights.max():
        count = "a single row" if len(heights) == 1 else f"{len(heights)} rows of one height"
        raise ValueError(f"{name(0)}: {count}, but an outline needs 2 heights or more")
    way = np.sign(np.diff(heights))
    if (way <= 0).all():
        heights, radii, rows = heights[::-1], radii[::-1], rows[::-1]
        told.append("turned upside down, as heights fell")
    elif not (way >= 0).all():
        raise ValueError(_turns(heights, radii, rows, name))
    first = np.searchsorted(heights, heights[0], side="right") - 1
    last = np.searchsorted(heights, heights[-1], side="left")
    foot, lid = (_is_closing(part) for part in (radii[: first + 1], radii[last:]))
    told += [f"closed {word} left out" for word, there in (("foot", foot), ("lid", lid)) if there]
    kept = slice(first, last + 1)
    y, r = _tidy(heights[kept], radii[kept])
    inner = np.flatnonzero((radii == 0) & (heights > heights[0]) & (heights < heights[-1]))
    if len(inner):
        raise ValueError(
            f"{name(int(rows[inner[0]]))}: radius is 0 between the ends, where the piece would "
            "fall in two: take the point out if it is no wall, or give a minimum radius"
        )
    left_out = len(heights[kept]) - len(y)
    told += [f"{left_out} repeated left out"] if left_out else []
    steps = int((np.diff(y) == 0).sum())
    told += [f"{steps} step{'s' * (steps > 1)}"] if steps else []
    return Outline(y, r, tuple(told))


def _is_closing(radii: np.ndarray) -> bool:
    return len(radii) > 1 and radii.min() < radii.max()


def _tidy(y: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The first and the last point of each height, one where they are the same."""
    starts = np.append(True, np.diff(y) > 0)
    ends = np.append(np.diff(y) > 0, True)
    y, r = y[starts | ends], r[starts | ends]
    new = np.append(True, (np.diff(y) > 0) | (np.diff(r) != 0))
    return y[new], r[new]


def _turns(heights: np.ndarray, radii: np.ndarray, rows: np.ndarray, name: Name) -> str:
    """Why heights that rise and fall are no outline, and what to do."""
    moving = np.flatnonzero(np.diff(heights))
    way = np.sign(np.diff(heights))[moving]
    turn = int(moving[np.flatnonzero(np.diff(way))[0]]) + 1
    again = int(moving[moving >= turn][0]) + 1
    parts = slice(0, turn + 1), slice(turn, None)
    spans = [float(np.ptp(heights[part])) for part in parts]
    here = f"{name(int(rows[again]))}: height {heights[again]:g} follows {heights[again - 1]:g}"
    if np.sum(np.diff(way) != 0) == 1 and min(spans) >= _HOLLOW * np.ptp(heights):
        common = np.linspace(heights.max() - min(spans), heights.max(), 7)[1:-1]
        mean = [np.mean(np.interp(common, *_by_height(heights[p], radii[p]))) for p in parts]
        outer, inner = parts if mean[0] >= mean[1] else parts[::-1]
        keep, leave = rows[outer], rows[inner]
        leave = leave[~np.isin(leave, keep)]
        return (
            f"{here}: outer and inner line of a hollow vessel in one file. Clay is solid: keep the "
            f"outer line, {_span(keep, name)}, and take out {_span(leave, name)}"
            + ". Of both halves of a drawing subtract where the axis is"
            * bool(radii.min() > 0)
        )
    return (
        f"{here}: the wall overhangs, or points are out of order. Each height may have one radius, "
        "or two at a step: keep the outermost line, from foot to rim, and take out the points "
        "that turn back"
    )


def _by_height(y: np.ndarray, r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    order = np.argsort(y, kind="stable")
    return y[order], r[order]


def _span(rows: np.ndarray, name: Name) -> str:
    """As lines 3 to 8, or what the points are called."""
    first, last = name(int(rows.min())), name(int(rows.max()))
    word, _, number = first.rpartition(" ")
    return first if first == last else f"{word}s {number} to {last.rpartition(' ')[2]}"
