"""The charts of a sweep, from its results alone.

Times come from timing runs only: what ran beside others, or in a batch, has none worth drawing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.figure import Figure

from jaxclay.experiments.compare.results import groups, select
from jaxclay.experiments.sweep import panels
from jaxclay.experiments.sweep.panels import CONTOUR, ERRORS, GAP, ROUNDING
from jaxclay.experiments.sweep.statistics import HIGH, LOW, times_to_solve

Chart = tuple[str, str, Figure]
_UNITS = {"snake": "snake units", "printed": "constants as printed"}
_BAND = f"{LOW:.0%} to {HIGH:.0%}"
_GRIDS = ["units", "slices"]
# Column, tolerance, column of the problem, title.
_GOALS = (
    (GAP, 1e-4, "problem", "gap within 1e-4 of E_free"),
    (GAP, 1e-8, "problem", "gap within 1e-8 of E_free"),
    (CONTOUR, 3e-2, "recipe", "contour within 3e-2 of the continuum's"),
    (CONTOUR, 1e-3, "recipe", "contour within 1e-3 of the continuum's"),
)


def prepared(table: pd.DataFrame) -> pd.DataFrame:
    """The rows with a column for their line in the charts, and one that tells problems apart."""
    return table.assign(
        series=np.where(
            table.scheme == "spline",
            "spline",
            table.method + np.where(table.scheme == "slices", " (second order)", ""),
        ),
        problem=table.recipe + "-" + table.slices.astype(str) + table.scheme,
    )


def timing_charts(rows: pd.DataFrame, traces: xr.Dataset) -> Iterator[Chart]:
    """Name, caption and figure of each chart of timing runs; the caller closes the figures."""
    timed = select(rows, rows.solve_s > 0)
    for error, known, left_out in _measured(timed):
        yield (
            "work-precision" + ("-contour" if error == CONTOUR else ""),
            f"Work and precision: {ERRORS[error]} against time. A point is "
            + ("a setting of the method" if error == GAP else "a number of slices or of spans")
            + f", at the medians over the scenes; bars, and bands where times rise from point to "
            f"point, hold {_BAND} of them. Down and left is better. {left_out}",
            _panels(known, _GRIDS if error == GAP else ["units"], panels.work_precision(error)),
        )
    traced = _traced(rows, traces)
    if len(traced):
        yield (
            "energy",
            "Energy against time: fresh runs ended after more and more iterations, a faint line "
            "for each scene that has a certified minimum, a strong one through the medians; "
            "energies are above that minimum, over E_free.",
            _panels(traced, _GRIDS, panels.energy),
        )
    goals = _goals(timed)
    if goals:
        yield (
            "profile",
            "Performance profiles (Dolan and More): the share of problems, which are scenes on a "
            "grid, that a method solves within a factor of the time of the quickest one, with its "
            "quickest setting that reaches the goal; for contours a problem is a scene, on "
            "whatever grid. Up and left is better. Problems without a certified minimum count as "
            "solved by none.",
            _profiles(goals),
        )
    grids = select(timed, timed.scheme != "spline")
    if grids.slices.nunique() > 1:
        yield (
            "scaling",
            "Scaling: time against slices, medians over scenes and settings, with the exponent of "
            f"the fitted power of n; the band holds {_BAND}. A method that gives up early looks "
            "quick here: whether it got there the other charts say.",
            _panels(grids, ["units"], panels.scaling),
        )


def throughput_charts(rows: pd.DataFrame) -> Iterator[Chart]:
    """The charts of throughput runs: how near the answers are; no times."""
    for error, known, left_out in _measured(rows):
        yield (
            "errors" + ("-contour" if error == CONTOUR else ""),
            f"The share of tasks whose {ERRORS[error]} is below a bound, those below "
            f"{ROUNDING:g} drawn there. Up and left is better. {left_out}",
            _panels(known, _GRIDS, panels.distribution(error)),
        )


def _measured(rows: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame, str]]:
    """Each kind of error, the rows that have it, and in words how many have not."""
    for error in ERRORS:
        those = _comparable(rows, error)
        known = select(those, those[error].notna())
        if len(known):
            left = len(those) - len(known)
            yield error, known, f"{left} tasks have no certified minimum." if left else ""


def _traced(rows: pd.DataFrame, traces: xr.Dataset) -> pd.DataFrame:
    """The rows that have a trace, certified, with its times and gaps."""
    known = select(rows, rows.energy_minimum.notna() & (rows.energy_free > 0))
    where = {key: i for i, key in enumerate(traces.key.values)}
    seconds, energy = traces.trace_s.values, traces.trace_energy.values
    places = np.array([where[key] for key in known.key], int)
    has = np.isfinite(seconds[places]).any(axis=1)
    known, places = select(known, has), places[has]
    above = energy[places] - known.energy_minimum.to_numpy()[:, None]
    gaps = above / known.energy_free.to_numpy()[:, None]
    return known.assign(trace_s=list(seconds[places]), trace_gap=list(gaps))


def _panels(rows: pd.DataFrame, by: list[str], draw: Callable[..., None]) -> Figure:
    """A panel for each value of the columns ``by``, one legend for all."""
    parts = list(groups(rows, by))
    columns = min(3, len(parts))
    figure, axes = _grid(len(parts), columns, max(4.6, 6.0 / columns), 3.9)
    for ax, (values, part) in zip(axes.flat, parts, strict=False):
        ax.set_title(_title(dict(zip(by, values, strict=True))), fontsize=10)
        ax.grid(True, which="major", alpha=0.3)
        draw(ax, part)
    _legend(figure, axes)
    return figure


def _profiles(goals: list[tuple[str, pd.DataFrame]]) -> Figure:
    """A panel for each goal, given its title and the times to it."""
    figure, axes = _grid(len(goals), min(2, len(goals)), 4.8, 3.7)
    for ax, (title, seconds) in zip(axes.flat, goals, strict=False):
        panels.profile(ax, seconds)
        ax.set_title(title, fontsize=10)
        ax.grid(True, alpha=0.3)
    _legend(figure, axes)
    return figure


def _goals(rows: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """The goals that two methods or more can be compared by: title, and times to reach it."""
    found = []
    for error, within, problem, title in _GOALS:
        those = _comparable(rows, error)
        if select(those, those[error].notna()).series.nunique() > 1:
            found.append((title, times_to_solve(those, error, within, problem)))
    return found


def _comparable(rows: pd.DataFrame, error: str) -> pd.DataFrame:
    """Splines minimise the integral, not the sum: their energies are compared with none."""
    return select(rows, rows.scheme != "spline") if error == GAP else rows


def _grid(count: int, columns: int, width: float, height: float) -> tuple[Figure, np.ndarray]:
    lines = -(-count // columns)
    size = width * columns, height * lines
    figure, axes = plt.subplots(lines, columns, figsize=size, layout="constrained", squeeze=False)
    for ax in axes.flat[count:]:
        ax.axis("off")
    return figure, axes


def _legend(figure: Figure, axes: np.ndarray) -> None:
    shown = {str(h.get_label()): h for ax in axes.flat for h in ax.get_legend_handles_labels()[0]}
    names = sorted(shown)  # whichever of them the first panel has
    figure.legend(
        [shown[name] for name in names], names, loc="outside lower center", ncols=4,
        fontsize="small",
    )  # fmt: skip


def _title(values: dict[str, Any]) -> str:
    words = [_UNITS[values["units"]]]
    if "slices" in values:
        words.append(f"{values['slices']} slices" if values["slices"] else "splines")
    return ", ".join(words)
