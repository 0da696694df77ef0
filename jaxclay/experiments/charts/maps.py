"""Heat maps of marks over two inputs, wherever rows hold all combinations of some values."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from jaxclay.experiments.charts.marks import Mark, mark_of
from jaxclay.experiments.charts.panels import ROUNDING
from jaxclay.experiments.frames import groups, records, select
from jaxclay.experiments.scenes import SNAKE_SLICES
from jaxclay.files.plots import COLOURS
from jaxclay.schemes.base import DECREMENT

_INPUTS = ("displacement", "band_ratio", "band_height", "mu", "alpha", "beta")
_NAMES = {
    "displacement": "displacement d / l", "band_ratio": "tool's radius over the piece's",
    "band_height": "height of the band / l", "mu": "mu / k", "alpha": "alpha / k",
    "beta": "beta / k", "slices": "slices n",
}  # fmt: skip
_OTHERS = ["scene", "units", "radius", "height", "k", "squashes", "band_bottom", "scheme",
           "spacing", "precision"]  # fmt: skip
_FEWEST = 6  # cells of a map
_MARKS = list(Mark)
_COLUMNS = 4
_CELL = 0.27  # inches
_SNAKE = {1 / SNAKE_SLICES**2: "1/64²", 1 / SNAKE_SLICES**4: "1/64⁴"}
_READING = (
    "The small figure is the decimal exponent of the energy above the certified minimum of "
    "another method, over E_free: -3 is a thousandth of it."
)
Chart = tuple[str, str, Figure]


def marked(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with their marks."""
    pairs = zip(rows.status, rows.gap_relative, strict=True)
    return rows.assign(mark=[str(mark_of(status, gap)) for status, gap in pairs])


def mark_maps(rows: pd.DataFrame) -> Iterator[Chart]:
    """Name, caption and figure of each map; the caller closes the figures."""
    # Of a cylinder: what the band's clay loses in height the clay above moves up.
    moved = np.where(rows.source == "cylinder", rows.band_height * (1 - rows.band_ratio**2), np.nan)
    rows = marked(rows).assign(displacement=np.round(moved, 9))
    drawn: set[int] = set()
    for x, y in itertools.combinations(_INPUTS, 2):
        fixed = [n for n in _INPUTS if n not in (x, y) and {n, x} != {"displacement", "band_ratio"}]
        for _, part in groups(select(rows, ~rows.index.isin(drawn)), [*_OTHERS, *fixed, "slices"]):
            part = select(part, part[x].notna() & part[y].notna())
            if _is_product(part, x, y):
                drawn |= set(part.index)
                across, up = (y, x) if x == "alpha" else (x, y)
                yield _map(part, across, up)
    yield from _over_slices(rows)
    yield from _roundings(rows)


def _is_product(part: pd.DataFrame, x: str, y: str) -> bool:
    """Whether nearly all combinations of several values are there."""
    counts = part[x].nunique(), part[y].nunique()
    there = len(part.drop_duplicates(subset=[x, y]))
    return bool(min(counts) > 1 and there >= max(_FEWEST, 0.9 * counts[0] * counts[1]))


def _map(part: pd.DataFrame, x: str, y: str) -> Chart:
    first = part.iloc[0]
    both = f"{_NAMES[y]} against {_NAMES[x]}"
    line = {x, y} == {"displacement", "mu"}
    caption = f"{both}, {first.scene}, {first.units} units, {first.slices} slices. " + (
        "Beyond the dashed line 2|d|mu/k = 1 the thicknesses of eq. 14 fall below zero, and the "
        "floor takes over. " if line else ""
    ) + _READING  # fmt: skip
    name = f"map-{x}-{y}-{first.units}-{first.slices}"
    return name, caption, _by_series(part, x, y, _floor_line if line else lambda *_: None)


def _over_slices(rows: pd.DataFrame) -> Iterator[Chart]:
    """Methods against slices, where a scene was tried on many."""
    by = [name for name in _OTHERS if name not in ("units", "precision")]
    for _, part in groups(rows, [*by, *(n for n in _INPUTS if n not in ("displacement",))]):
        part = select(part, part.slices > 0)
        if part.slices.nunique() < 2 or part.budget.max() == 0:
            continue
        caption = (
            f"Number of slices: {part.scene.iloc[0]}, in float64 and where asked for in float32, "
            "with answers checked in float64. But for newton, a method that is out of time is not "
            f"tried on finer grids. {_READING}"
        )
        yield f"map-slices-{part.scene.iloc[0]}", caption, _by_panel(part)


def _by_series(rows: pd.DataFrame, x: str, y: str, decorate: Callable[..., None]) -> Figure:
    """A heat map for each method; axes are shared."""
    series = list(dict.fromkeys(rows.series))
    xs, ys = sorted(set(rows[x])), sorted(set(rows[y]))
    figure, axes = _maps(len(series), _COLUMNS, len(xs), len(ys))
    for ax, who in zip(axes.flat, series, strict=False):
        _heat_map(ax, select(rows, rows.series == who), x, xs, y, ys)
        decorate(ax, *((xs, ys) if x == "displacement" else (ys, xs)))
        ax.set_title(who, fontsize=9)
    for ax in axes[:, 0]:
        ax.set_yticks(range(len(ys)), [_tick(v) for v in ys])
    figure.supylabel(_NAMES[y], fontsize=10)
    _bottom(axes, len(series), [_tick(v) for v in xs], _NAMES[x])
    _legend(figure, rows)
    return figure


def _by_panel(rows: pd.DataFrame) -> Figure:
    """A heat map of methods against slices for each of the units and precisions."""
    parts = list(groups(rows, ["precision", "units"]))[::-1]
    methods, xs = list(dict.fromkeys(rows.method))[::-1], sorted(set(rows.slices))
    figure, axes = _maps(len(parts), 2, len(xs), len(methods))
    for ax, ((precision, units), part) in zip(axes.flat, parts, strict=False):
        _heat_map(ax, part, "slices", xs, "method", methods)
        ax.set_title(f"{units} units, {precision}", fontsize=9)
    for ax in axes[:, 0]:
        ax.set_yticks(range(len(methods)), methods)
    _bottom(axes, len(parts), [f"{n:g}" for n in xs], "slices n")
    _legend(figure, rows)
    return figure


def _maps(count: int, most: int, width: int, height: int) -> tuple[Figure, np.ndarray]:
    """A figure with room for so many heat maps, at most so many side by side."""
    columns = min(most, count)
    lines = -(-count // columns)
    size = (
        max(_CELL * width * columns + 0.25 * columns + 1.0, 5.5),
        (_CELL * height + 0.35) * lines + 1.4,
    )
    figure, axes = plt.subplots(
        lines, columns, figsize=size, layout="constrained", squeeze=False, sharex=True, sharey=True
    )
    for ax in axes.flat[count:]:
        ax.axis("off")
    return figure, axes


def _bottom(axes: np.ndarray, count: int, ticks: list[str], label: str) -> None:
    """Tick labels under the lowest heat map of each column."""
    columns = axes.shape[1]
    for j in range(columns):
        lowest = axes[(count - 1 - j) // columns][j]
        lowest.set_xticks(range(len(ticks)), ticks, rotation=90)
        lowest.tick_params(labelbottom=True)
        if lowest is axes[-1][j]:
            lowest.set_xlabel(label)
        else:  # the place below is empty: no room has to be made
            for text in lowest.get_xticklabels():
                text.set_in_layout(False)


def _heat_map(ax: Axes, rows: pd.DataFrame, x: str, xs: list, y: str, ys: list) -> None:
    """A coloured cell with the mark's symbol for each row of the table."""
    codes = np.full((len(ys), len(xs)), np.nan)
    by_name = {str(mark): mark for mark in _MARKS}
    for row in records(rows):
        i, j, mark = ys.index(getattr(row, y)), xs.index(getattr(row, x)), by_name[row.mark]
        codes[i, j] = _MARKS.index(mark)
        exponent = _exponent(row, mark)
        colour = "white" if mark in (Mark.SOLVED, Mark.WRONG) else "black"
        middle: dict[str, Any] = {"ha": "center", "va": "center", "color": colour}
        ax.text(j, i + (0.16 if exponent else 0.0), mark.symbol, fontsize=8, **middle)
        ax.text(j, i - 0.26, exponent, fontsize=5.5, **middle)
    colours = ListedColormap([mark.colour for mark in _MARKS])
    across, up = np.arange(len(xs) + 1) - 0.5, np.arange(len(ys) + 1) - 0.5
    scale: dict[str, Any] = {"cmap": colours, "vmin": -0.5, "vmax": len(_MARKS) - 0.5}
    ax.pcolormesh(across, up, np.ma.masked_invalid(codes), edgecolors="white", lw=0.5, **scale)
    ax.tick_params(labelsize=7)


def _exponent(row, mark: Mark) -> str:
    """The gap's decimal exponent where the minimum was missed."""
    if mark in (Mark.SOLVED, Mark.REFUSED) or not row.gap_relative > 0:
        return ""
    return f"{int(np.floor(np.log10(row.gap_relative)))}".replace("-", "\N{MINUS SIGN}")


def _floor_line(ax: Axes, xs: list[float], ys: list[float]) -> None:
    """2|d|mu/k = 1 on the axes' places."""
    depths = [x for x in xs if x > 0]
    frictions = np.array([y for y in ys if y > 0])
    if len(depths) < 2 or len(frictions) < 2:
        return
    fine = np.geomspace(depths[0], depths[-1], 200)
    j = np.interp(fine, depths, [xs.index(x) for x in depths])
    wanted = np.log(1 / (2 * fine))
    i = np.interp(wanted, np.log(frictions), [ys.index(y) for y in frictions], np.nan, np.nan)
    ax.plot(j, i, color="black", linestyle="--", linewidth=1.2)


def _legend(figure: Figure, rows: pd.DataFrame) -> None:
    marks = [mark for mark in _MARKS if (rows.mark == str(mark)).any()]
    handles = [
        Patch(facecolor=mark.colour, edgecolor="#888888", label=f"{mark.symbol}  {mark}")
        for mark in marks
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(marks), fontsize=8)


def _tick(value: float) -> str:
    if value in _SNAKE:
        return _SNAKE[value]
    if value and abs(value) < 1e-2:
        return f"1e{int(np.round(np.log10(abs(value))))}".replace("-", "\N{MINUS SIGN}")
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")


def _roundings(rows: pd.DataFrame) -> Iterator[Chart]:
    """What float32 says at the certified minima, where that was asked for."""
    rows = select(rows, rows.single_energy.notna())
    if len(rows):
        yield (
            "float32",
            "What float32 says at the minimum that float64 has certified: the error of the energy "
            "and of its gradient, and what the certificate would read. Where there is no point "
            "the certificate sees no positive curvature at all.",
            _rounding(rows),
        )


def _rounding(rows: pd.DataFrame) -> Figure:
    """Errors against slices, a panel for each of the units."""
    parts = list(groups(rows, "units"))[::-1]
    figure, axes = plt.subplots(
        1, len(parts), figsize=(4.6 * len(parts), 3.6), layout="constrained", sharey=True,
        squeeze=False,
    )  # fmt: skip
    lines = {
        "single_energy": ("energy, relative", "o-"),
        "single_gradient": ("gradient / h(mu + k)", "s--"),
        "single_decrement": ("certificate's decrement / E_free", "D:"),
    }
    for ax, (units, part) in zip(axes[0], parts, strict=True):
        here = part.drop_duplicates(subset=["slices"]).sort_values("slices")
        for j, (column, (label, look)) in enumerate(lines.items()):
            values = here[column].where(np.isfinite(here[column])).clip(lower=ROUNDING)
            ax.plot(here.slices, values, look, color=COLOURS[j], label=label, markersize=5)
        ax.axhline(DECREMENT, color="#555555", linewidth=1)
        ax.annotate("certificate's bar", (0.98, DECREMENT), xycoords=("axes fraction", "data"),
                    ha="right", va="bottom", fontsize=8, color="#555555")  # fmt: skip
        ax.set(xscale="log", yscale="log", xlabel="slices n", title=f"{units} units")
        ax.set_xticks(here.slices, [f"{n}" for n in here.slices])
        ax.minorticks_off()
        ax.grid(True, alpha=0.3)
    axes[0][0].set_ylabel("error of float32")
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    return figure
