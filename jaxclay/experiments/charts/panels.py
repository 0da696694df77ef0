"""What charts draw into one panel: rows in, lines and bands on an Axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from jaxclay.experiments.charts.layout import even_ticks
from jaxclay.experiments.charts.series import style
from jaxclay.experiments.charts.statistics import (
    bands,
    best_settings,
    exponent,
    ladder,
    performance_profile,
)
from jaxclay.experiments.frames import groups

GAP, CONTOUR = "gap_relative", "contour_error_continuum"
ERRORS = {GAP: "energy gap / E_free", CONTOUR: "contour error / l, from the continuum's"}
ROUNDING = 1e-16  # errors below it are drawn there
_TIME = "time of the call (ms), compiling apart"
_ROOM = 1 / 9  # of an axis, for a number of slices
Draw = Callable[[Axes, Any], None]


def work_precision(error: str) -> Draw:
    """Errors against time: medians and bands, a rung for each setting or each size."""
    by = ["settings"] if error == GAP else ["slices", "elements", "tolerance", "degree"]

    def draw(ax: Axes, rows: pd.DataFrame) -> None:
        for series, part in groups(rows, "family"):
            rungs = ladder(part if error == GAP else best_settings(part, error, by), error, by)
            look, ms = style(str(series)), rungs.solve_s * 1e3
            low, middle, high = (
                rungs[name].clip(lower=ROUNDING) for name in ("low", "middle", "high")
            )
            ax.plot(ms, middle, **look)
            ax.vlines(ms, low, high, color=look["color"], alpha=0.4, lw=1.5)
            if (np.diff(ms) > 0).all():  # else the band would fold
                ax.fill_between(ms, low, high, color=look["color"], alpha=0.15, lw=0)
        ax.set(xscale="log", yscale="log", xlabel=_TIME, ylabel=ERRORS[error])
        even_ticks(ax.xaxis, ax.yaxis)

    return draw


def energy(ax: Axes, rows: pd.DataFrame) -> None:
    """Energies above the minimum against time, a faint line each and one through the medians."""
    faint = {"marker": None, "linewidth": 0.8, "label": None}
    faint["alpha"] = max(0.12, 0.6 / np.sqrt(len(rows)))
    for series, part in groups(rows, "series"):
        look = style(str(series))
        seconds = np.stack([*part.trace_s]) * 1e3
        gaps = np.maximum(np.stack([*part.trace_gap]), ROUNDING)
        ax.plot(seconds.T, gaps.T, **(look | faint))
        # A run that has ended stays where it ended.
        middle = [pd.DataFrame(values).ffill(axis=1).median() for values in (seconds, gaps)]
        ax.plot(*middle, **(look | {"linewidth": 2.0, "markersize": 4}))
    ax.set(xscale="log", yscale="log", xlabel=_TIME, ylabel="(E - minimum) / E_free")
    even_ticks(ax.xaxis, ax.yaxis)


def profile(ax: Axes, seconds: pd.DataFrame) -> None:
    """Dolan and More's profile of a table of times, a row for each problem."""
    curves = performance_profile(seconds)
    most = max([2.0, *(factors[-1] * 1.3 for factors, _ in curves.values())])
    for series, (factors, shares) in curves.items():
        _steps(ax, series, np.append(factors, most), np.append(shares, shares[-1]))
    ax.set(xscale="log", xlim=(0.97, most), xlabel="time / time of the quickest")
    ax.set(ylim=(-0.02, 1.04), ylabel="share of problems solved")
    even_ticks(ax.xaxis)


def distribution(error: str) -> Draw:
    """The share of tasks whose error is below a bound."""

    def draw(ax: Axes, rows: pd.DataFrame) -> None:
        for series, part in groups(rows, "series"):
            values = np.maximum(np.sort(part[error].abs()), ROUNDING)
            _steps(ax, str(series), values, np.arange(1, len(values) + 1) / len(values))
        ax.set(xscale="log", ylim=(-0.02, 1.04), xlabel=ERRORS[error], ylabel="share of tasks")
        even_ticks(ax.xaxis)

    return draw


def _steps(ax: Axes, series: str, x: np.ndarray, y: np.ndarray) -> None:
    ax.step(x, y, where="post", **(style(series) | {"marker": None, "linewidth": 1.8}))


def scaling(ax: Axes, rows: pd.DataFrame) -> None:
    """Time against slices, with the exponent of the line through the logarithms."""
    ends = []
    for series, part in groups(rows, "series"):
        ms, look = bands(part, ["slices"], "solve_s") * 1e3, style(str(series))
        ax.plot(ms.index, ms.middle, **look)
        ax.fill_between(ms.index, ms.low, ms.high, color=look["color"], alpha=0.15, lw=0)
        if len(ms) > 1:
            power = exponent(part.slices, part.solve_s)
            ends.append((ms.index[-1], ms.middle.iloc[-1], power, look["color"]))
    ax.set(xscale="log", yscale="log", xlabel="slices n", ylabel=_TIME)
    first, last = rows.slices.min(), rows.slices.max()
    span = max(2.0, last / first)
    ax.set_xlim(first / span**0.05, last * span**0.18)  # room for the exponents
    grids = [first]
    for n in sorted(rows.slices.unique()):
        if n / grids[-1] >= span**_ROOM:
            grids.append(n)
    ax.set_xticks(grids, [str(n) for n in grids])
    ax.xaxis.set_minor_locator(NullLocator())
    even_ticks(ax.yaxis)
    _label_ends(ax, ends)


def _label_ends(ax: Axes, ends: list[tuple[float, float, float, str]]) -> None:
    """The exponents beside the ends of their lines, moved apart where they would touch."""
    figure: Any = ax.figure
    figure.draw_without_rendering()
    least, lower = 13.0, {}  # points, and the height of the label below at each x
    for x, y, power, colour in sorted(ends):
        here = ax.transData.transform((x, y))[1] * 72 / figure.dpi
        up = max(0.0, lower.get(x, -np.inf) + least - here)
        lower[x] = here + up
        ax.annotate(f"$n^{{{power:.2f}}}$", (x, y), textcoords="offset points", xytext=(6, up),
                    color=colour, fontsize=9, va="center")  # fmt: skip
