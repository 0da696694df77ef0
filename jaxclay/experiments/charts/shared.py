"""What charts share: figures of panels, ticks and cells, names and looks of lines, and marks."""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator

from jaxclay.experiments.contestants import contestant
from jaxclay.experiments.results import groups, select
from jaxclay.files.plots import COLOURS

Chart = tuple[str, str, Figure]  # name, caption and figure, which the caller closes
_FEWEST, _MOST = 3, 6  # marks on an axis
_STEPS = (1, 2, 5), (1, 3), (1,)  # of marks within a decade, the densest that are not too many
_PLAIN = 1e-3, 1e4  # within which powers of ten are written out
# Two certified minima of a scene are the same where their energies differ by less, over E_free.
# The certificate itself lets 1e-10 pass.
SAME = 1e-8
_MOST_SETTINGS = 3  # settings of a method that get a line each; of a longer ladder one is taken
_SCHEMES = {"paper": "paper's sums", "equal": "equal slices", "placed": "placed slices",
            "spline": "splines"}  # fmt: skip
DERIVED = ("way", "family", "problem", "series")  # columns that are added


def grid(count: int, columns: int, width: float, height: float, **how: Any):
    """A figure with ``count`` panels, so many side by side, each so large in inches."""
    columns = min(columns, count)
    lines = -(-count // columns)
    how |= {"figsize": (width * columns, height * lines), "layout": "constrained"}
    figure, axes = plt.subplots(lines, columns, squeeze=False, **how)
    for ax in axes.flat[count:]:
        ax.remove()
    for ax in axes.flat[max(count - columns, 0) : count]:  # the lowest of each column
        ax.tick_params(labelbottom=True)
    return figure, axes.ravel()[:count]


def panelled(
    parts: Iterable[tuple[str, Any]], draw: Callable[[Axes, Any], None], columns: int,
    width: float, height: float,
) -> Figure:  # fmt: skip
    """A panel for each title and what is drawn below it, one legend for all."""
    parts = list(parts)
    figure, axes = grid(len(parts), columns, width, height)
    for ax, (title, part) in zip(axes, parts, strict=True):
        ax.set_title(title, fontsize=10)
        ax.grid(True, which="major", alpha=0.3)
        draw(ax, part)
    legend(figure)
    return figure


def legend(figure: Figure, **look: Any) -> None:
    """One legend below all panels, each name once."""
    each = [zip(*ax.get_legend_handles_labels(), strict=True) for ax in figure.axes]
    shown = {name: handle for pairs in each for handle, name in pairs}
    names = sorted(shown)  # whichever of them the first panel has
    look = {"loc": "outside lower center", "ncols": 4, "fontsize": "small"} | look
    figure.legend([shown[name] for name in names], names, **look)


def cells(ax: Axes, values: Any, **look: Any) -> Any:
    """A coloured cell for each number of a matrix, centred on whole numbers; nan is left open."""
    across, up = (np.arange(n + 1) - 0.5 for n in np.shape(values)[::-1])
    known = np.ma.masked_invalid(np.asarray(values, float))
    return ax.pcolormesh(across, up, known, edgecolors="white", **look)


def log_axes(ax: Axes, **look: Any) -> None:
    """Both axes logarithmic, with what else Axes.set takes."""
    ax.set(xscale="log", yscale="log", **look)
    even_ticks(ax.xaxis, ax.yaxis)


def even_ticks(*axes: Axis) -> None:
    """Numbers on logarithmic axes, few enough not to touch, whatever their range."""
    for axis in axes:
        marks = _marks(*axis.get_view_interval())
        powers = np.log10(marks)
        plain = _PLAIN[0] <= marks[0] and marks[-1] <= _PLAIN[1]
        labels = [f"{mark:g}" for mark in marks]
        if np.allclose(powers, powers.round(), atol=1e-9) and not plain:
            labels = [f"$10^{{{power:.0f}}}$" for power in powers]
        axis.set_ticks(marks, labels)
        axis.set_minor_locator(NullLocator())


def _marks(low: float, high: float) -> np.ndarray:
    """Round numbers from ``low`` to ``high``, even on a logarithmic axis."""
    powers = np.arange(np.floor(np.log10(low)), np.floor(np.log10(high)) + 1)
    stride = -(-len(powers) // _MOST)
    candidates = [
        *(np.outer(10.0**powers, steps).ravel() for steps in _STEPS),
        10.0 ** powers[powers % stride == 0],
        # So little of a decade is seen that its marks stand about evenly.
        np.asarray(MaxNLocator(4, steps=[1, 2, 5, 10]).tick_values(low, high)),
    ]
    within = [marks[(low <= marks) & (marks <= high)] for marks in candidates]
    return next((marks for marks in within if _FEWEST <= len(marks) <= _MOST), within[-1])


class Mark(enum.Enum):
    """How an attempt ended, apart from what the method says of itself: symbol, colour, meaning."""

    SOLVED = "✓", "#0072B2", "certified, and the certified answer of another method lies no lower"
    STALLED = "s", "#E69F00", "the method stopped by its own rule where the certificate refuses"
    OUT_OF_TIME = "t", "#F5D9A0", "still going on when its time was over"
    ITERATION_LIMIT = "i", "#D9C58B", "still going on when its iterations were used up"
    REFUSED = "r", "#B0B0B0", "no answer, and the message says why"
    NON_FINITE = "∞", "#CC79A7", "energy or step became infinite or not a number"
    WRONG = "X", "#000000", "called converged, but a certified minimum lies lower"

    def __init__(self, symbol: str, colour: str, meaning: str):
        self.symbol, self.colour, self.meaning = symbol, colour, meaning

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ").replace("non finite", "non-finite")


def mark_of(status: str, gap: float) -> Mark:
    """The mark of an answer whose energy lies ``gap`` above another method's certified minimum.

    ``gap`` is over E_free, nan where no such minimum is known.
    """
    if status == "converged":
        return Mark.WRONG if gap > SAME else Mark.SOLVED
    return {str(mark): mark for mark in Mark}.get(status, Mark.REFUSED)


def marked(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with their marks."""
    pairs = zip(rows.status, rows.gap_relative, strict=True)
    return rows.assign(mark=[str(mark_of(status, gap)) for status, gap in pairs])


def prepared(table: pd.DataFrame) -> pd.DataFrame:
    """The rows with columns for their family, method and scheme, and for their problem."""
    way = np.where(table.scheme == "slices", table.spacing, table.scheme)
    told = pd.Series([_SCHEMES.get(one, one) for one in way], table.index)
    family = table.method + np.where(table.scheme == "paper", "", " (" + told + ")")
    family += np.where(table.precision == "float64", "", ", " + table.precision)
    sizes = [table[name].astype(str) for name in ("slices", "elements", "tolerance", "degree")]
    problem = table.specification.str.cat([*sizes, pd.Series(way, table.index)], sep="-")
    found = table.assign(way=way, family=family, problem=problem, series=family)
    found.attrs = {}  # or pandas copies them at every step
    return found


def told_apart(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with a series for each of a method's settings.

    Of a ladder with more than a few the default is taken, or what is tightest.
    """
    parts = []
    for family, part in groups(rows, "family"):
        settings = sorted(part.settings.unique(), key=_tightness)
        if len(settings) > _MOST_SETTINGS:
            settings = [""] if "" in settings else settings[:1]
        kept = select(part, part.settings.isin(settings))
        several = len(settings) > 1
        named = (family + " " + kept.settings.replace("", "default")) if several else family
        parts.append(kept.assign(series=named))
    return pd.concat(parts) if parts else rows


def default_rows(rows: pd.DataFrame) -> pd.DataFrame:
    """Those with the methods' own settings; all of a method that was run with others alone."""
    own = rows.settings == ""
    return select(rows, own | ~rows.family.isin(rows.family[own]))


def _tightness(settings: str) -> list[Any]:
    return [float(one.partition("=")[2] or "inf") for one in settings.split(", ")]


def style(series: str) -> dict[str, Any]:
    """Colour, marker and line: a method's own in all charts, hollow or dashed on other schemes."""
    looks = contestant(series.split(" ")[0].rstrip(","))
    line = "--" if "splines" in series else looks.line  # as that of peers
    if "slices)" in series:
        line = ":" if "equal" in series else "-"
    hollow = {"markerfacecolor": "white"} if line == "--" or "slices)" in series else {}
    return {
        "label": series, "markersize": 5, "linewidth": 1.3, "linestyle": line,
        "color": COLOURS[looks.colour], "marker": looks.marker, **hollow,
    }  # fmt: skip
