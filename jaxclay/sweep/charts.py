"""The charts of a sweep, from its results alone.

Times come from timing runs only: what ran beside others, or in a batch, has none worth drawing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxclay.compare.charts import style
from jaxclay.compare.results import select
from jaxclay.plots import COLOURS
from jaxclay.sweep.statistics import (
    HIGH,
    LOW,
    exponent,
    ladder,
    performance_profile,
    times_to_solve,
)

Chart = tuple[str, str, Figure]
_ROUNDING = 1e-16  # errors below it are drawn there
_TIME = "solve time (ms), compiling apart"
_UNITS = {"snake": "snake units", "printed": "constants as printed"}
_GAP, _CONTOUR = "gap_relative", "contour_error_continuum"
_ERRORS = {_GAP: "energy gap / E_free", _CONTOUR: "contour error / l, from the continuum's"}
# Column, tolerance, column of the problem, title.
_GOALS = (
    (_GAP, 1e-4, "problem", "gap within 1e-4 of E_free"),
    (_GAP, 1e-8, "problem", "gap within 1e-8 of E_free"),
    (_CONTOUR, 1e-2, "recipe", "contour within 1e-2 of the continuum's"),
    (_CONTOUR, 1e-3, "recipe", "contour within 1e-3 of the continuum's"),
)
_WITH_UNITS = ["units", "slices"]


def prepared(table: pd.DataFrame) -> pd.DataFrame:
    """The rows with a column for their line in the charts, and one that tells problems apart."""
    return table.assign(
        series=np.where(table.scheme == "spline", "spline", table.method),
        problem=table.recipe + "-" + table.slices.astype(str),
    )


def timing_charts(rows: pd.DataFrame, traces: xr.Dataset) -> Iterator[Chart]:
    """Name, caption and figure of each chart of timing runs; the caller closes the figures."""
    for error, label in _ERRORS.items():
        known = select(rows, rows[error].notna() & (rows.solve_s > 0))
        if error == _GAP:
            known = select(known, known.scheme == "paper")
        if known.empty:
            continue
        left_out = len(rows if error == _CONTOUR else rows[rows.scheme == "paper"]) - len(known)
        name = "work-precision" + ("-contour" if error == _CONTOUR else "")
        panels = _WITH_UNITS if error == _GAP else ["units"]
        yield (
            name,
            f"Work and precision: {label} against time. A point is a setting, a tolerance or a "
            f"number of slices, at the medians over the scenes; the band holds {LOW:.0%} to "
            f"{HIGH:.0%} of the scenes. Down and left is better. {_missing(left_out)}",
            _panels(known, panels, lambda ax, part, e=error: _work_precision(ax, part, e)),
        )
    if traces.sizes.get("stop"):
        yield (
            "energy",
            "Energy against time: fresh runs ended after more and more iterations, a line for each "
            "scene that has a certified minimum; energies are above that minimum, over E_free.",
            _panels(_traced(rows, traces), _WITH_UNITS, _energy),
        )
    if rows.series.nunique() > 1 and (profiled := _profiles(rows)) is not None:
        yield (
            "profile",
            "Performance profiles (Dolan and More): the share of problems, which are scenes on a "
            "grid, that a method solves within a factor of the time of the quickest one, with its "
            "quickest setting that reaches the goal. Up and left is better. Problems without a "
            "certified minimum count as solved by none.",
            profiled,
        )
    grids = select(rows, (rows.scheme == "paper") & (rows.solve_s > 0))
    if grids.slices.nunique() > 1:
        yield (
            "scaling",
            "Scaling: time against slices, medians over scenes and settings, with the exponent of "
            f"the fitted power of n; the band holds {LOW:.0%} to {HIGH:.0%}.",
            _panels(grids, ["units"], _scaling),
        )


def throughput_charts(rows: pd.DataFrame) -> Iterator[Chart]:
    """The charts of throughput runs: how near the answers are; no times."""
    for error, label in _ERRORS.items():
        known = select(rows, rows[error].notna())
        if error == _GAP:
            known = select(known, known.scheme == "paper")
        if known.empty:
            continue
        left_out = len(rows if error == _CONTOUR else rows[rows.scheme == "paper"]) - len(known)
        yield (
            "errors" + ("-contour" if error == _CONTOUR else ""),
            f"The share of tasks whose {label} is below a bound. Up and left is better. "
            f"{_missing(left_out)}",
            _panels(known, _WITH_UNITS, lambda ax, part, e=error: _distribution(ax, part, e)),
        )


def _missing(count: int) -> str:
    """What is not in a chart, and why."""
    return f"{count} tasks without a certified minimum are left out." if count else ""


def _panels(rows: pd.DataFrame, by: list[str], draw: Callable[[Axes, pd.DataFrame], None]):
    """A panel for each value of the columns ``by``, one legend for all."""
    groups = list(rows.groupby(by, sort=True))
    columns = min(3, len(groups))
    lines = -(-len(groups) // columns)
    figure, axes = plt.subplots(
        lines, columns, figsize=(max(4.6 * columns, 6.0), 3.9 * lines), layout="constrained",
        squeeze=False,
    )  # fmt: skip
    for ax in axes.flat[len(groups) :]:
        ax.axis("off")
    for ax, (values, part) in zip(axes.flat, groups, strict=False):
        draw(ax, part)
        ax.set_title(_title(dict(zip(by, values, strict=True))), fontsize=10)
        ax.grid(True, which="major", alpha=0.3)
    _legend(figure, axes)
    return figure


def _legend(figure: Figure, axes: np.ndarray) -> None:
    shown = {h.get_label(): h for ax in axes.flat for h in ax.get_legend_handles_labels()[0]}
    figure.legend(
        list(shown.values()), list(shown), loc="outside lower center", ncols=4, fontsize="small"
    )


def _title(values: dict) -> str:
    words = [_UNITS.get(values["units"], values["units"])]
    if "slices" in values:
        words.append(f"{values['slices']} slices" if values["slices"] else "splines")
    return ", ".join(words)


def series_style(series: str) -> dict:
    """Colour and marker of a method, the same in all charts; splines are black and dashed."""
    if series != "spline":
        return style(series)
    black = {"color": COLOURS[6], "linestyle": "--", "marker": "*"}
    return {"label": "spline, to a tolerance", "markersize": 7, "linewidth": 1.3} | black


def _work_precision(ax: Axes, rows: pd.DataFrame, error: str) -> None:
    for series, part in rows.groupby("series"):
        rungs = ladder(part, error)
        look = series_style(str(series))
        low, median, high = (
            np.maximum(v, _ROUNDING) for v in (rungs.low, rungs.median, rungs.high)
        )
        ax.plot(rungs.seconds * 1e3, median, **look)
        if len(median) > 1:
            ax.fill_between(rungs.seconds * 1e3, low, high, color=look["color"], alpha=0.15, lw=0)
        else:
            ax.vlines(rungs.seconds * 1e3, low, high, color=look["color"], alpha=0.4)
    ax.set(xscale="log", yscale="log", xlabel=_TIME, ylabel=_ERRORS[error])


def _traced(rows: pd.DataFrame, traces: xr.Dataset) -> pd.DataFrame:
    """The rows that have a trace, certified, with its times and gaps."""
    where = {key: i for i, key in enumerate(traces.key.values)}
    seconds, energy = traces.trace_s.values, traces.trace_energy.values
    known = select(rows, rows.energy_minimum.notna() & (rows.energy_free > 0))
    places = [where[key] for key in known.key]
    has = np.array([bool(np.isfinite(seconds[i]).any()) for i in places], bool)
    known, places = known[has], [i for i, good in zip(places, has, strict=True) if good]
    gaps = [
        (energy[i] - minimum) / free
        for i, minimum, free in zip(places, known.energy_minimum, known.energy_free, strict=True)
    ]
    return known.assign(trace_s=[seconds[i] for i in places], trace_gap=gaps)


def _energy(ax: Axes, rows: pd.DataFrame) -> None:
    faint = max(0.15, 1 / np.sqrt(len(rows)))
    for series, part in rows.groupby("series"):
        look = series_style(str(series))
        for j, (seconds, gap) in enumerate(zip(part.trace_s, part.trace_gap, strict=True)):
            label = {"label": look["label"] if j == 0 else None}
            small = {"markersize": 3, "linewidth": 1.0, "alpha": faint}
            ax.plot(seconds * 1e3, np.maximum(gap, _ROUNDING), **(look | small | label))
    ax.set(xscale="log", yscale="log", xlabel=_TIME, ylabel="(E - minimum) / E_free")


def _profiles(rows: pd.DataFrame) -> Figure | None:
    goals = [goal for goal in _GOALS if rows[goal[0]].notna().any()]
    if not goals:
        return None
    figure, axes = plt.subplots(
        1, len(goals), figsize=(max(4.2 * len(goals), 6.0), 3.9), layout="constrained",
        squeeze=False, sharey=True,
    )  # fmt: skip
    for ax, (error, within, problem, title) in zip(axes.flat, goals, strict=True):
        who = rows if error == _CONTOUR else rows[rows.scheme == "paper"]
        curves = performance_profile(times_to_solve(who, error, within, problem))
        for series, (factors, shares) in curves.items():
            look = series_style(series)
            ends = np.append(factors, max(c[0][-1] for c in curves.values()) * 1.3)
            ax.step(ends, np.append(shares, shares[-1]), where="post",
                    **(look | {"marker": None, "linewidth": 1.8}))  # fmt: skip
        ax.set(xscale="log", ylim=(-0.02, 1.04), xlabel="time / time of the quickest")
        ax.set_title(title, fontsize=10)
        ax.grid(True, alpha=0.3)
    axes[0, 0].set_ylabel("share of problems solved")
    _legend(figure, axes)
    return figure


def _scaling(ax: Axes, rows: pd.DataFrame) -> None:
    for series, part in rows.groupby("series"):
        bands = part.groupby("slices").solve_s.quantile([LOW, 0.5, HIGH]).unstack() * 1e3
        look = series_style(str(series))
        power = exponent(part.slices, part.solve_s)
        ax.plot(bands.index, bands[0.5], **look)
        ax.fill_between(bands.index, bands[LOW], bands[HIGH], color=look["color"], alpha=0.15, lw=0)
        end = bands.iloc[-1]
        ax.annotate(
            f"$n^{{{power:.2f}}}$", (end.name, end[0.5]), textcoords="offset points",
            xytext=(6, 0), color=look["color"], fontsize=9, va="center",
        )  # fmt: skip
    grids = sorted(rows.slices.unique())
    ax.set(xscale="log", yscale="log", xlabel="slices n", ylabel=_TIME)
    ax.set_xticks(grids, [str(n) for n in grids])
    ax.set_xticks([], minor=True)
    ax.set_xlim(grids[0] / 1.1, grids[-1] * 1.35)


def _distribution(ax: Axes, rows: pd.DataFrame, error: str) -> None:
    for series, part in rows.groupby("series"):
        values = np.maximum(np.sort(part[error].abs()), _ROUNDING)
        shares = np.arange(1, len(values) + 1) / len(values)
        look = series_style(str(series)) | {"marker": None, "linewidth": 1.8}
        ax.step(values, shares, where="post", **look)
    ax.set(xscale="log", ylim=(-0.02, 1.04), xlabel=_ERRORS[error], ylabel="share of tasks")
