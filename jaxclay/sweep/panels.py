"""What a sweep's charts draw into one panel: rows in, lines and bands on an Axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from jaxclay.compare.charts import style
from jaxclay.compare.results import groups
from jaxclay.plots import COLOURS
from jaxclay.sweep.statistics import (
    HIGH,
    LOW,
    best_settings,
    exponent,
    ladder,
    performance_profile,
)

GAP, CONTOUR = "gap_relative", "contour_error_continuum"
ERRORS = {GAP: "energy gap / E_free", CONTOUR: "contour error / l, from the continuum's"}
_TIME = "solve time (ms), compiling apart"
_ROUNDING = 1e-16  # errors below it are drawn there
_FEW_DECADES = 150.0  # ratio of an axis's ends up to which 2 and 5 are marked too
Draw = Callable[[Axes, Any], None]


def series_style(series: str) -> dict:
    """Colour and marker of a method, the same in all charts; splines are black and dashed."""
    if series != "spline":
        return style(series)
    black = {"color": COLOURS[6], "linestyle": "--", "marker": "*"}
    return {"label": "spline, to a tolerance", "markersize": 7, "linewidth": 1.3} | black


def work_precision(error: str) -> Draw:
    """Errors against time: medians and bands, a rung for each setting or each size."""
    by = ["settings"] if error == GAP else ["slices", "tolerance"]

    def draw(ax: Axes, rows: pd.DataFrame) -> None:
        for series, part in groups(rows, "series"):
            kept = part if error == GAP else best_settings(part, error, by)
            rungs, look = ladder(kept, error, by), series_style(str(series))
            milliseconds = rungs.seconds * 1e3
            low, median, high = (
                np.maximum(each, _ROUNDING) for each in (rungs.low, rungs.median, rungs.high)
            )
            ax.plot(milliseconds, median, **look)
            if len(median) > 1:
                ax.fill_between(milliseconds, low, high, color=look["color"], alpha=0.15, lw=0)
            ax.vlines(milliseconds, low, high, color=look["color"], alpha=0.4, lw=1)
        ax.set(xscale="log", yscale="log", xlabel=_TIME, ylabel=ERRORS[error])
        even_ticks(ax)

    return draw


def energy(ax: Axes, rows: pd.DataFrame) -> None:
    """Energies above the minimum against time, a faint line each and one through the medians."""
    faint = {"marker": None, "linewidth": 0.8, "label": None}
    faint["alpha"] = max(0.12, 0.6 / np.sqrt(len(rows)))
    for series, part in groups(rows, "series"):
        look = series_style(str(series))
        seconds = np.stack([*part.trace_s]) * 1e3
        gaps = np.maximum(np.stack([*part.trace_gap]), _ROUNDING)
        for each, gap in zip(seconds, gaps, strict=True):
            ax.plot(each, gap, **(look | faint))
        # A run that has ended stays where it ended.
        middle = [pd.DataFrame(values).ffill(axis=1).median() for values in (seconds, gaps)]
        ax.plot(*middle, **(look | {"linewidth": 2.0, "markersize": 4}))
    ax.set(xscale="log", yscale="log", xlabel=_TIME, ylabel="(E - minimum) / E_free")
    even_ticks(ax)


def profile(ax: Axes, seconds: pd.DataFrame) -> None:
    """Dolan and More's profile of a table of times, a row for each problem."""
    curves = performance_profile(seconds)
    most = max([2.0, *(factors[-1] * 1.3 for factors, _ in curves.values())])
    for series, (factors, shares) in curves.items():
        look = series_style(series) | {"marker": None, "linewidth": 1.8}
        ax.step(np.append(factors, most), np.append(shares, shares[-1]), where="post", **look)
    ax.set(xscale="log", xlim=(0.97, most), ylim=(-0.02, 1.04))
    ax.set(xlabel="time / time of the quickest", ylabel="share of problems solved")
    even_ticks(ax)


def scaling(ax: Axes, rows: pd.DataFrame) -> None:
    """Time against slices, with the exponent of the line through the logarithms."""
    exponents = []
    for series, part in groups(rows, "series"):
        bands = part.groupby("slices").solve_s.quantile([LOW, 0.5, HIGH]).unstack() * 1e3
        look = series_style(str(series))
        ax.plot(bands.index, bands[0.5], **look)
        ax.fill_between(bands.index, bands[LOW], bands[HIGH], color=look["color"], alpha=0.15, lw=0)
        exponents.append((bands[0.5].iloc[-1], exponent(part.slices, part.solve_s), look["color"]))
    grids = sorted(rows.slices.unique())
    ax.set(xscale="log", yscale="log", xlabel="slices n", ylabel=_TIME)
    ax.set_xticks(grids, [str(n) for n in grids])
    ax.xaxis.set_minor_locator(NullLocator())
    ax.set_xlim(grids[0] / 1.1, grids[-1] * 1.45)
    _label_ends(ax, grids[-1], exponents)


def _label_ends(ax: Axes, x: float, exponents: list[tuple[float, float, str]]) -> None:
    """The exponents beside the ends of their lines, moved apart where they would touch."""
    figure: Any = ax.figure
    figure.draw_without_rendering()
    least, last = 13.0, -np.inf  # points
    for y, power, colour in sorted(exponents):
        here = ax.transData.transform((x, y))[1] * 72 / figure.dpi
        up = max(0.0, last + least - here)
        last = here + up
        ax.annotate(f"$n^{{{power:.2f}}}$", (x, y), textcoords="offset points", xytext=(6, up),
                    color=colour, fontsize=9, va="center")  # fmt: skip


def distribution(error: str) -> Draw:
    """The share of tasks whose error is below a bound."""

    def draw(ax: Axes, rows: pd.DataFrame) -> None:
        for series, part in groups(rows, "series"):
            values = np.maximum(np.sort(part[error].abs()), _ROUNDING)
            shares = np.arange(1, len(values) + 1) / len(values)
            look = series_style(str(series)) | {"marker": None, "linewidth": 1.8}
            ax.step(values, shares, where="post", **look)
        ax.set(xscale="log", ylim=(-0.02, 1.04), xlabel=ERRORS[error], ylabel="share of tasks")
        ax.xaxis.set_major_locator(LogLocator(numticks=7))

    return draw


def even_ticks(ax: Axes) -> None:
    """Plain numbers on the axis across, few enough not to touch."""
    low, high = ax.get_xlim()
    subs = (1.0, 2.0, 5.0) if high / low < _FEW_DECADES else (1.0,)
    ax.xaxis.set_major_locator(LogLocator(subs=subs, numticks=12))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_locator(NullLocator())
