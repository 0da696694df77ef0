"""Heat maps of marks over two inputs, wherever rows hold all combinations of some values."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from jaxclay.experiments.charts.panels import ROUNDING
from jaxclay.experiments.charts.shared import Chart, Mark, cells, grid, marked, panelled
from jaxclay.experiments.results import groups, records, select
from jaxclay.experiments.scenes import SNAKE_SLICES
from jaxclay.files.plots import COLOURS
from jaxclay.schemes.base import DECREMENT

_NAMES = {
    "displacement": "displacement d / l", "band_ratio": "tool's radius over the piece's",
    "band_height": "height of the band / l", "mu": "mu / k", "alpha": "alpha / k",
    "beta": "beta / k", "slices": "slices n", "method": "",
}  # fmt: skip
_INPUTS = [*_NAMES][:6]
_OTHERS = ["scene", "radius", "height", "k", "squashes", "band_bottom", "scheme", "spacing"]
_FEWEST = 6  # cells of a map
_MARKS = {str(mark): mark for mark in Mark}
_CELL = 0.27  # inches
_SNAKE = {1 / SNAKE_SLICES**2: "1/64²", 1 / SNAKE_SLICES**4: "1/64⁴"}
_READING = (
    "The small figure is the decimal exponent of the energy above the certified minimum of "
    "another method, over E_free: -3 is a thousandth of it."
)


def mark_maps(rows: pd.DataFrame) -> Iterator[Chart]:
    """A map for each two inputs that were varied together, of slices, and what float32 says."""
    # Of a cylinder: what the band's clay loses in height the clay above moves up.
    moved = np.where(rows.source == "cylinder", rows.band_height * (1 - rows.band_ratio**2), np.nan)
    rows = marked(rows).assign(displacement=np.round(moved, 9))
    drawn: set[int] = set()
    for x, y in itertools.combinations(_INPUTS, 2):
        fixed = [n for n in _INPUTS if n not in (x, y) and {n, x} != {"displacement", "band_ratio"}]
        by = [*_OTHERS, "units", "precision", "slices", *fixed]
        for _, part in groups(select(rows, ~rows.index.isin(drawn)), by):
            part = select(part, part[x].notna() & part[y].notna())
            if _is_product(part, x, y):
                drawn |= set(part.index)
                yield _map(part, *((y, x) if x == "alpha" else (x, y)))
    for _, part in groups(rows, [*_OTHERS, *_INPUTS[1:]]):
        part = select(part, part.slices > 0)
        if part.slices.nunique() > 1 and part.budget.max() > 0:
            yield _over_slices(part)
    single = select(rows, rows.single_energy.notna())
    if len(single):
        yield (
            "float32",
            "What float32 says at the minimum that float64 has certified: the error of the energy "
            "and of its gradient, and what the certificate would read. Where there is no point "
            "the certificate sees no positive curvature at all.",
            panelled([(f"{u} units", part) for u, part in groups(single, "units")], _rounding,
                     2, 4.6, 3.6),
        )  # fmt: skip


def _is_product(part: pd.DataFrame, x: str, y: str) -> bool:
    """Whether nearly all combinations of several values are there."""
    xs, ys = part[x].nunique(), part[y].nunique()
    there = len(part.drop_duplicates(subset=[x, y]))
    return bool(min(xs, ys) > 1 and there >= max(_FEWEST, 0.9 * xs * ys))


def _map(part: pd.DataFrame, x: str, y: str) -> Chart:
    first, floor = part.iloc[0], ""
    figure = _figure(part, "series", x, y, columns=4)
    if (x, y) == ("displacement", "mu"):
        floor = ("Beyond the dashed line 2|d|mu/k = 1 the thicknesses of eq. 14 fall below zero, "
                 "and the floor takes over. ")  # fmt: skip
        for ax in figure.axes:
            _floor_line(ax, *(sorted(set(part[name])) for name in (x, y)))
    caption = (
        f"{_NAMES[y]} against {_NAMES[x]}, {first.scene}, {first.units} units, {first.slices} "
        f"slices. {floor}{_READING}"
    )
    return f"map-{x}-{y}-{first.units}-{first.slices}", caption, figure


def _over_slices(part: pd.DataFrame) -> Chart:
    """Methods against slices, where a scene was tried on many."""
    caption = (
        f"Number of slices: {part.scene.iloc[0]}, in float64 and where asked for in float32, "
        "with answers checked in float64. But for newton, a method that is out of time is not "
        f"tried on finer grids. {_READING}"
    )
    part = part.assign(panel=part.units + " units, " + part.precision)
    figure = _figure(part, "panel", "slices", "method", columns=2)
    return f"map-slices-{part.scene.iloc[0]}", caption, figure


def _figure(rows: pd.DataFrame, panel: str, x: str, y: str, columns: int) -> Figure:
    """A heat map for each value of ``panel``, with a cell for each of x and y."""
    xs = sorted(set(rows[x]))
    ys = [*dict.fromkeys(rows.method)][::-1] if y == "method" else sorted(set(rows[y]))
    parts = list(groups(rows, panel))
    size = _CELL * len(xs) + 0.4, _CELL * len(ys) + 0.8
    figure, axes = grid(len(parts), columns, *size, sharex=True, sharey=True)
    wide, high = figure.get_size_inches()
    figure.set_size_inches(max(wide + 1.2, 5.5), high + 0.8)
    for ax, (title, part) in zip(axes, parts, strict=True):
        _heat_map(ax, part.assign(i=part[y].map(ys.index), j=part[x].map(xs.index)), xs, ys)
        ax.set_title(title, fontsize=9)
        ax.set_xticks(range(len(xs)), [_tick(v) for v in xs], rotation=90)
        ax.set_yticks(range(len(ys)), ys if y == "method" else [_tick(v) for v in ys])
        ax.tick_params(labelsize=7)
    for ax in axes[-columns:]:
        ax.set_xlabel(_NAMES[x])
    figure.supylabel(_NAMES[y], fontsize=10)
    handles = [
        Patch(facecolor=mark.colour, edgecolor="#888888", label=f"{mark.symbol}  {mark}")
        for name, mark in _MARKS.items()
        if (rows.mark == name).any()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), fontsize=8)
    return figure


def _heat_map(ax: Axes, rows: pd.DataFrame, xs: list, ys: list) -> None:
    """A coloured cell with the mark's symbol for each row of the table."""
    codes = np.full((len(ys), len(xs)), np.nan)
    for row in records(rows):
        mark = _MARKS[row.mark]
        codes[row.i, row.j] = [*Mark].index(mark)
        missed = mark not in (Mark.SOLVED, Mark.REFUSED) and row.gap_relative > 0
        exponent = f"{np.floor(np.log10(row.gap_relative)):.0f}" if missed else ""
        middle: dict[str, Any] = {"ha": "center", "va": "center"}
        middle["color"] = "white" if mark in (Mark.SOLVED, Mark.WRONG) else "black"
        ax.text(row.j, row.i + 0.16 * missed, mark.symbol, fontsize=8, **middle)
        ax.text(row.j, row.i - 0.26, _minus(exponent), fontsize=5.5, **middle)
    colours = ListedColormap([mark.colour for mark in Mark])
    cells(ax, codes, cmap=colours, vmin=-0.5, vmax=len(Mark) - 0.5, lw=0.5)


def _floor_line(ax: Axes, xs: list[float], ys: list[float]) -> None:
    """2|d|mu/k = 1 on the axes' places."""
    depths = [x for x in xs if x > 0]
    frictions = np.array([y for y in ys if y > 0])
    if len(depths) > 1 and len(frictions) > 1:
        fine = np.geomspace(depths[0], depths[-1], 200)
        j = np.interp(fine, depths, [xs.index(x) for x in depths])
        places = [ys.index(y) for y in frictions]
        i = np.interp(np.log(1 / (2 * fine)), np.log(frictions), places, np.nan, np.nan)
        ax.plot(j, i, color="black", linestyle="--", linewidth=1.2)


def _tick(value: float) -> str:
    if value and abs(value) < 1e-2:
        return _SNAKE.get(value, _minus(f"1e{np.round(np.log10(abs(value))):.0f}"))
    return _minus(f"{value:g}")


def _minus(text: str) -> str:
    return text.replace("-", "\N{MINUS SIGN}")


def _rounding(ax: Axes, rows: pd.DataFrame) -> None:
    """Errors of float32 against slices."""
    here = rows.drop_duplicates(subset=["slices"]).sort_values("slices")
    lines = {
        "single_energy": ("energy, relative", "o-"),
        "single_gradient": ("gradient / h(mu + k)", "s--"),
        "single_decrement": ("certificate's decrement / E_free", "D:"),
    }
    for colour, (column, (label, look)) in zip(COLOURS, lines.items(), strict=False):
        values = here[column].where(np.isfinite(here[column])).clip(lower=ROUNDING)
        ax.plot(here.slices, values, look, color=colour, label=label, markersize=5)
    ax.axhline(DECREMENT, color="#555555", linewidth=1, label="certificate's bar")
    ax.set(xscale="log", yscale="log", xlabel="slices n", ylabel="error of float32")
    ax.set_xticks(here.slices, map(str, here.slices))
    ax.minorticks_off()
