"""What charts draw into one panel, and the figures behind it: rows in, lines and bands out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import NullLocator

from jaxclay.experiments.charts.shared import even_ticks, log_axes, style
from jaxclay.experiments.results import groups, select

GAP, CONTOUR = "gap_relative", "contour_error_continuum"
ERRORS = {GAP: "energy gap / E_free", CONTOUR: "contour error / l, from the continuum's"}
ROUNDING = 1e-16  # errors below it are drawn there
LOW, HIGH = 0.1, 0.9  # the band around a median
_TIME = "time of the call (ms), compiling apart"
_ROOM = 1 / 9  # of an axis, for a number of slices
Draw = Callable[[Axes, Any], None]


def bands(rows: pd.DataFrame, by: list[str], column: str, **others: Any) -> pd.DataFrame:
    """Columns low, middle and high of a column's size, and ``others``, a row for each group."""
    sized = select(rows, rows[column].notna()).assign(sized=lambda kept: kept[column].abs())
    return sized.groupby(by, dropna=False).agg(
        low=("sized", lambda values: values.quantile(LOW)),
        middle=("sized", "median"),
        high=("sized", lambda values: values.quantile(HIGH)),
        **others,
    )


def ladder(rows: pd.DataFrame, error: str, by: list[str]) -> pd.DataFrame:
    """Seconds and the band of the errors for each value of ``by``, from the largest error down."""
    rungs = bands(rows, by, error, solve_s=("solve_s", "median"))
    return rungs.sort_values(["middle", "solve_s"], ascending=[False, True]).reset_index()


def exponent(slices: Any, seconds: Any) -> float:
    """p of the line through the logarithms, seconds = c slices^p; not a number from one grid."""
    if len(np.unique(slices)) < 2:
        return float("nan")
    return float(np.polyfit(np.log(slices), np.log(seconds), 1)[0])


def work_precision(error: str) -> Draw:
    """Errors against time: medians and bands, a rung for each setting or each size.

    Each size has the setting of the least median error.
    """
    by = ["settings"] if error == GAP else ["slices", "elements", "tolerance", "degree"]

    def draw(ax: Axes, rows: pd.DataFrame) -> None:
        for series, part in groups(rows, "family"):
            if error != GAP:
                medians = bands(part, [*by, "settings"], error).reset_index()
                best = medians.sort_values("middle").drop_duplicates(subset=by)
                part = part.merge(best[[*by, "settings"]])
            rungs, look = ladder(part, error, by), style(str(series))
            ms, errors = rungs.solve_s * 1e3, rungs[["low", "middle", "high"]].clip(lower=ROUNDING)
            ax.plot(ms, errors.middle, **look)
            ax.vlines(ms, errors.low, errors.high, color=look["color"], alpha=0.4, lw=1.5)
            if (np.diff(ms) > 0).all():  # else the band would fold
                shade(ax, ms, errors, look)
        log_axes(ax, xlabel=_TIME, ylabel=ERRORS[error])

    return draw


def shade(ax: Axes, x: Any, errors: Any, look: dict[str, Any]) -> None:
    """The band from the column low to high, in the colour of a line."""
    ax.fill_between(x, errors.low, errors.high, color=look["color"], alpha=0.15, lw=0)


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
    log_axes(ax, xlabel=_TIME, ylabel="(E - minimum) / E_free")


def times_to_solve(rows: pd.DataFrame, error: str, within: float, problem: str) -> pd.DataFrame:
    """Seconds of each family's quickest run whose error is ``within``, a row for each problem.

    ``problem`` names the column that tells problems apart; those that nobody solves are there.
    """
    solved = rows.assign(solve_s=rows.solve_s.where(rows[error].abs() <= within))
    return solved.groupby([problem, "family"]).solve_s.min().unstack("family")


def performance_profile(seconds: pd.DataFrame) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The share of problems that a solver solves within a factor of the quickest's time.

    After E. Dolan and J. More, Mathematical Programming 91, 2002.

    Parameters
    ----------
    seconds : DataFrame
        A row for each problem, a column for each solver; NaN where it did not solve it.

    Returns
    -------
    dict
        For each solver the factors at which its share rises, in order, and the shares from there
        on, both beginning at a factor of 1.
    """
    ratio = seconds.div(seconds.min(axis=1), axis=0)
    curves = {}
    for name in ratio:
        factors = np.sort(ratio[name].dropna().to_numpy())
        steps = np.unique(np.append(1.0, factors))
        curves[str(name)] = steps, np.searchsorted(factors, steps, side="right") / len(ratio)
    return curves


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
        shade(ax, ms.index, ms, look)
        if len(ms) > 1:
            power = exponent(part.slices, part.solve_s)
            ends.append((ms.index[-1], ms.middle.iloc[-1], power, look["color"]))
    ax.set(xscale="log", yscale="log", xlabel="slices n", ylabel=_TIME)
    grids = sorted(rows.slices.unique())
    span = max(2.0, grids[-1] / grids[0])
    ax.set_xlim(grids[0] / span**0.05, grids[-1] * span**0.18)  # room for the exponents
    shown = grids[:1]
    for n in grids:
        if n / shown[-1] >= span**_ROOM:
            shown.append(n)
    ax.set_xticks(shown, [str(n) for n in shown])
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
