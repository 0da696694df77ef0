"""The atlas's charts: a heat map for each method or grid, and float32's errors."""

from __future__ import annotations

from collections.abc import Iterator

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from jaxclay.experiments.atlas.marks import Mark
from jaxclay.experiments.atlas.sweeps import DEPTH_TOP, SINGLE
from jaxclay.experiments.compare.results import records, select
from jaxclay.experiments.compare.scenes import SNAKE_SLICES
from jaxclay.files.plots import COLOURS
from jaxclay.schemes.base import DECREMENT

_MARKS = list(Mark)
_COLUMNS = 4
_CELL = 0.27  # inches
_ROUNDING = 1e-16  # errors below it are drawn there
_SNAKE = {1 / SNAKE_SLICES**2: "1/64²", 1 / SNAKE_SLICES**4: "1/64⁴"}
_READING = (
    "The small figure is the decimal exponent of the energy above the certified minimum, over "
    "E_free: -3 is a thousandth of it."
)


def charts(table: pd.DataFrame) -> Iterator[tuple[str, str, Figure]]:
    """Name, caption and figure of each chart; the caller closes the figures."""
    depth = select(table, table.sweep == "depth")
    if len(depth):
        caption = (
            "Depth and friction: the unit cylinder of radius 0.5, 64 slices, in snake units, "
            f"squashed from 0 to {DEPTH_TOP} of its height so far that the clay above moves up by "
            "d, or down where d is negative. Beyond the dashed line 2|d|mu/k = 1 the thicknesses "
            "of eq. 14 fall below zero, and the floor takes over. " + _READING
        )
        yield "depth", caption, _by_method(depth, "displacement d / l", "mu / k", _floor_line)
    smoothing = select(table, table.sweep == "smoothing")
    if len(smoothing):
        caption = (
            "Smoothing: the reference scene, 64 slices, mu/k = 1. Weights are those of differences "
            "divided by h (eq. 21), in which the paper prints alpha = beta = 1; the second value "
            "of each axis is 1 in snake units. " + _READING
        )
        yield "smoothing", caption, _by_method(smoothing, "beta / k", "alpha / k")
    slices = select(table, table.sweep == "slices")
    if len(slices):
        caption = (
            "Number of slices: the reference scene, in float64, and on some of the grids in "
            "float32, with answers checked in float64. But for newton, a method that is out of "
            "time on a grid is not tried on finer ones. " + _READING
        )
        yield "slices", caption, _by_panel(slices)
    single = select(table, table.precision == SINGLE)
    if "single_energy" in table and single.single_energy.notna().any():
        caption = (
            "What float32 says at the minimum that float64 has certified: the error of the energy "
            "and of its gradient, and what the certificate would read. Where there is no point the "
            "certificate sees no positive curvature at all."
        )
        yield "float32", caption, _rounding(single)


def _by_method(rows: pd.DataFrame, x: str, y: str, decorate=lambda *_: None) -> Figure:
    """A heat map for each method; axes are shared."""
    methods, xs, ys = list(dict.fromkeys(rows.method)), _values(rows.x), _values(rows.y)
    figure, axes = _maps(len(methods), _COLUMNS, len(xs), len(ys))
    for ax, method in zip(axes.flat, methods, strict=False):
        heat_map(ax, select(rows, rows.method == method), xs, ys, "y")
        decorate(ax, xs, ys)
        ax.set_title(method, fontsize=9)
    for ax in axes[:, 0]:
        ax.set_yticks(range(len(ys)), [_tick(v) for v in ys])
    figure.supylabel(y, fontsize=10)
    _bottom(axes, len(methods), [_tick(v) for v in xs], x)
    _legend(figure, rows)
    return figure


def _by_panel(rows: pd.DataFrame) -> Figure:
    """A heat map of methods against slices for each of the units and precisions."""
    panels, methods = list(dict.fromkeys(rows.panel)), list(dict.fromkeys(rows.method))[::-1]
    xs = _values(rows.x)
    figure, axes = _maps(len(panels), 2, len(xs), len(methods))
    for ax, panel in zip(axes.flat, panels, strict=False):
        heat_map(ax, select(rows, rows.panel == panel), xs, methods, "method")
        ax.set_title(panel, fontsize=9)
    for ax in axes[:, 0]:
        ax.set_yticks(range(len(methods)), methods)
    _bottom(axes, len(panels), [f"{int(n)}" for n in xs], "slices n")
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


def heat_map(ax: Axes, rows: pd.DataFrame, xs: list, ys: list, vertical: str) -> None:
    """A coloured cell with the mark's symbol for each row of the table."""
    codes = np.full((len(ys), len(xs)), np.nan)
    by_name = {str(mark): mark for mark in _MARKS}
    for row in records(rows):
        i, j, mark = ys.index(getattr(row, vertical)), xs.index(row.x), by_name[row.mark]
        codes[i, j] = _MARKS.index(mark)
        dark = mark in (Mark.SOLVED, Mark.WRONG)
        exponent = _exponent(row, mark)
        lift = 0.16 if exponent else 0.0
        colour = "white" if dark else "black"
        ax.text(j, i + lift, mark.symbol, ha="center", va="center", fontsize=8, color=colour)
        ax.text(j, i - 0.26, exponent, ha="center", va="center", fontsize=5.5, color=colour)
    colours = ListedColormap([mark.colour for mark in _MARKS])
    across, up = np.arange(len(xs) + 1) - 0.5, np.arange(len(ys) + 1) - 0.5
    scale = {"cmap": colours, "vmin": -0.5, "vmax": len(_MARKS) - 0.5}
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


def _rounding(rows: pd.DataFrame) -> Figure:
    """Errors against slices, a panel for each of the units."""
    panels = list(dict.fromkeys(rows.panel))
    figure, axes = plt.subplots(
        1, len(panels), figsize=(4.6 * len(panels), 3.6), layout="constrained", sharey=True,
        squeeze=False,
    )  # fmt: skip
    lines = {
        "single_energy": ("energy, relative", "o-"),
        "single_gradient": ("gradient / h(mu + k)", "s--"),
        "single_decrement": ("certificate's decrement / E_free", "D:"),
    }
    for ax, panel in zip(axes[0], panels, strict=True):
        here = select(rows, rows.panel == panel).drop_duplicates(subset=["x"]).sort_values("x")
        for j, (column, (label, style)) in enumerate(lines.items()):
            values = np.where(
                np.isfinite(here[column]), np.maximum(here[column], _ROUNDING), np.nan
            )
            ax.plot(here.x, values, style, color=COLOURS[j], label=label, markersize=5)
        ax.axhline(DECREMENT, color="#555555", linewidth=1)
        ax.annotate("certificate's bar", (0.98, DECREMENT), xycoords=("axes fraction", "data"),
                    ha="right", va="bottom", fontsize=8, color="#555555")  # fmt: skip
        ax.set(xscale="log", yscale="log", xlabel="slices n", title=panel)
        ax.set_xticks(here.x, [f"{int(n)}" for n in here.x])
        ax.minorticks_off()
        ax.grid(True, alpha=0.3)
    axes[0][0].set_ylabel("error of float32")
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    return figure


def _values(column: pd.Series) -> list[float]:
    return sorted(set(column))


def _tick(value: float) -> str:
    if value in _SNAKE:
        return _SNAKE[value]
    if value and abs(value) < 1e-2:
        return f"1e{int(np.round(np.log10(value)))}".replace("-", "\N{MINUS SIGN}")
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")
