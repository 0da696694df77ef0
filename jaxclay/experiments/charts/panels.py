"""What a sweep's charts draw into one panel: rows in, lines and bands on an Axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import MaxNLocator, NullLocator

from jaxclay.experiments.charts.series import style
from jaxclay.experiments.charts.statistics import (
    HIGH,
    LOW,
    best_settings,
    exponent,
    ladder,
    performance_profile,
)
from jaxclay.experiments.frames import groups

GAP, CONTOUR = "gap_relative", "contour_error_continuum"
ERRORS = {GAP: "energy gap / E_free", CONTOUR: "contour error / l, from the continuum's"}
TIME = "time of the call (ms), compiling apart"
ROUNDING = 1e-16  # errors below it are drawn there
_FEWEST, _MOST = 3, 6  # marks on an axis
_STEPS = (1, 2, 5), (1, 3), (1,)  # of marks within a decade, the densest that are not too many
_PLAIN = 1e-3, 1e4  # within which powers of ten are written out
_ROOM = 1 / 9  # of an axis, for a number of slices
Draw = Callable[[Axes, Any], None]


def work_precision(error: str) -> Draw:
    """Errors against time: medians and bands, a rung for each setting or each size."""
    by = ["settings"] if error == GAP else ["slices", "elements", "tolerance", "degree"]

    def draw(ax: Axes, rows: pd.DataFrame) -> None:
        for series, part in groups(rows, "family"):
            kept = part if error == GAP else best_settings(part, error, by)
            rungs, look = ladder(kept, error, by), style(str(series))
            milliseconds = rungs.seconds * 1e3
            low, median, high = (
                np.maximum(each, ROUNDING) for each in (rungs.low, rungs.median, rungs.high)
            )
            ax.plot(milliseconds, median, **look)
            ax.vlines(milliseconds, low, high, color=look["color"], alpha=0.4, lw=1.5)
            if (np.diff(milliseconds) > 0).all():  # else the band would fold
                ax.fill_between(milliseconds, low, high, color=look["color"], alpha=0.15, lw=0)
        ax.set(xscale="log", yscale="log", xlabel=TIME, ylabel=ERRORS[error])
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
        for each, gap in zip(seconds, gaps, strict=True):
            ax.plot(each, gap, **(look | faint))
        # A run that has ended stays where it ended.
        middle = [pd.DataFrame(values).ffill(axis=1).median() for values in (seconds, gaps)]
        ax.plot(*middle, **(look | {"linewidth": 2.0, "markersize": 4}))
    ax.set(xscale="log", yscale="log", xlabel=TIME, ylabel="(E - minimum) / E_free")
    even_ticks(ax.xaxis, ax.yaxis)


def profile(ax: Axes, seconds: pd.DataFrame) -> None:
    """Dolan and More's profile of a table of times, a row for each problem."""
    curves = performance_profile(seconds)
    most = max([2.0, *(factors[-1] * 1.3 for factors, _ in curves.values())])
    for series, (factors, shares) in curves.items():
        look = style(series) | {"marker": None, "linewidth": 1.8}
        ax.step(np.append(factors, most), np.append(shares, shares[-1]), where="post", **look)
    ax.set(xscale="log", xlim=(0.97, most), ylim=(-0.02, 1.04))
    ax.set(xlabel="time / time of the quickest", ylabel="share of problems solved")
    even_ticks(ax.xaxis)


def scaling(ax: Axes, rows: pd.DataFrame) -> None:
    """Time against slices, with the exponent of the line through the logarithms."""
    ends = []
    for series, part in groups(rows, "series"):
        bands = part.groupby("slices").solve_s.quantile([LOW, 0.5, HIGH]).unstack() * 1e3
        look = style(str(series))
        ax.plot(bands.index, bands[0.5], **look)
        ax.fill_between(bands.index, bands[LOW], bands[HIGH], color=look["color"], alpha=0.15, lw=0)
        if len(bands) > 1:
            power = exponent(part.slices, part.solve_s)
            ends.append((bands.index[-1], bands[0.5].iloc[-1], power, look["color"]))
    ax.set(xscale="log", yscale="log", xlabel="slices n", ylabel=TIME)
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


def distribution(error: str) -> Draw:
    """The share of tasks whose error is below a bound."""

    def draw(ax: Axes, rows: pd.DataFrame) -> None:
        for series, part in groups(rows, "series"):
            values = np.maximum(np.sort(part[error].abs()), ROUNDING)
            shares = np.arange(1, len(values) + 1) / len(values)
            look = style(str(series)) | {"marker": None, "linewidth": 1.8}
            ax.step(values, shares, where="post", **look)
        ax.set(xscale="log", ylim=(-0.02, 1.04), xlabel=ERRORS[error], ylabel="share of tasks")
        even_ticks(ax.xaxis)

    return draw


def even_ticks(*axes: Axis) -> None:
    """Numbers on logarithmic axes, few enough not to touch, whatever their range."""
    for axis in axes:
        marks = _marks(*axis.get_view_interval())
        powers = np.log10(marks)
        if np.allclose(powers, powers.round(), atol=1e-9) and not _plain(marks):
            labels = [f"$10^{{{power:.0f}}}$" for power in powers]
        else:
            labels = [f"{mark:g}" for mark in marks]
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


def _plain(marks: np.ndarray) -> bool:
    return bool(_PLAIN[0] <= marks[0] and marks[-1] <= _PLAIN[1])
