"""The charts of a folder, from its results alone: which there are, and their captions.

Times come from timing runs only: what ran beside others, or in a batch, has none worth drawing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxclay.experiments.charts import panels
from jaxclay.experiments.charts.accuracy import accuracy_charts
from jaxclay.experiments.charts.heat import failure_charts
from jaxclay.experiments.charts.maps import mark_maps
from jaxclay.experiments.charts.panels import CONTOUR, ERRORS, GAP, ROUNDING
from jaxclay.experiments.charts.series import default_rows, told_apart
from jaxclay.experiments.charts.statistics import HIGH, LOW, times_to_solve
from jaxclay.experiments.frames import groups, select
from jaxclay.files.plots import COLOURS

Chart = tuple[str, str, Figure]
_UNITS = {
    "snake": "snake units",
    "printed": "constants as printed",
    "move": "E_move alone (alpha = beta = 0)",
}
_BAND = f"{LOW:.0%} to {HIGH:.0%}"
_GRIDS = ["units", "slices"]
_FEW = 3  # scenes that get a chart each where there are no more
_MOST_SHAPES = 20
# Column, tolerance, column of the problem, title.
_GOALS = (
    (GAP, 1e-4, "problem", "gap within 1e-4 of E_free"),
    (GAP, 1e-8, "problem", "gap within 1e-8 of E_free"),
    (CONTOUR, 3e-2, "specification", "contour within 3e-2 of the continuum's"),
    (CONTOUR, 1e-3, "specification", "contour within 1e-3 of the continuum's"),
)


def all_charts(kind: str, rows: pd.DataFrame, curves: xr.Dataset) -> Iterator[Chart]:
    """Name, caption and figure of each chart; the caller closes the figures."""
    tried = select(rows, ~rows.status.isin(["skipped"]))
    if tried.empty:
        return
    if kind == "timing":
        yield from accuracy_charts(tried)
        yield from timing_charts(tried, curves)
        yield from shape_charts(tried, curves)
    else:
        yield from throughput_charts(tried)
    yield from mark_maps(told_apart(rows))
    yield from failure_charts(told_apart(rows))


def timing_charts(rows: pd.DataFrame, traces: xr.Dataset) -> Iterator[Chart]:
    """The charts of timing runs."""
    timed = select(rows, (rows.solve_s > 0) & (rows.budget == 0))
    for error, known, left_out in _measured(timed):
        known = _with_rungs(known, error)
        by = _GRIDS if error == GAP else ["units"]
        for where, part in _scenes(known):
            yield (
                "work-precision" + ("-contour" if error == CONTOUR else "") + where,
                f"Work and precision: {ERRORS[error]} against time. A point is "
                + ("a setting of the method" if error == GAP else "a number of slices or of spans")
                + f", at the medians over the scenes; bars, and bands where times rise from point "
                f"to point, hold {_BAND} of them. Down and left is better. {left_out}",
                _panels(part, by, panels.work_precision(error)),
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
    grids = told_apart(select(timed, timed.scheme != "spline"))
    grids = select(grids, grids.slices > 0)
    if grids.slices.nunique() > 1:
        yield (
            "scaling",
            "Scaling: time against slices, medians over scenes, with the exponent of "
            f"the fitted power of n; the band holds {_BAND}. A method that gives up early looks "
            "quick here: whether it got there the other charts say.",
            _panels(grids, ["units"], panels.scaling),
        )


def throughput_charts(rows: pd.DataFrame) -> Iterator[Chart]:
    """The charts of throughput runs: how near the answers are; no times."""
    for error, known, left_out in _measured(told_apart(rows)):
        yield (
            "errors" + ("-contour" if error == CONTOUR else ""),
            f"The share of tasks whose {ERRORS[error]} is below a bound, those below "
            f"{ROUNDING:g} drawn there. Up and left is better. {left_out}",
            _panels(known, _GRIDS, panels.distribution(error)),
        )


def shape_charts(rows: pd.DataFrame, curves: xr.Dataset) -> Iterator[Chart]:
    """Shapes before the squash, at the start, of greedy and of newton, each scene on one grid."""
    own = default_rows(rows)
    own = select(own, (own.scheme == "paper") & own.method.isin(["newton", "greedy"]))
    own = select(own, (own.slices > 0) & (own.squashes <= 1) & (own.budget == 0))
    for units, part in groups(own, "units"):
        if not {"newton", "greedy"} <= set(part.method) or part.scene.nunique() > _MOST_SHAPES:
            continue
        yield (
            f"shapes-{units}",
            "The shape before the squash, the start, greedy's answer and the minimum, "
            f"{_UNITS[units]}.",
            _shapes([least for _, each in groups(part, "scene") for least in [_coarsest(each)]],
                    curves),
        )  # fmt: skip


def _coarsest(rows: pd.DataFrame) -> pd.DataFrame:
    sizes = rows.groupby("slices").method.nunique()
    both = sizes[sizes == sizes.max()].index
    preferred = [n for n in both if n >= 64]
    return select(rows, rows.slices == min(preferred or both))


def _shapes(parts: list[pd.DataFrame], curves: xr.Dataset) -> Figure:
    where = {key: i for i, key in enumerate(curves.key.values)}
    figure, axes = _grid(len(parts), min(5, len(parts)), 3.1, 3.4)
    for ax, part in zip(axes.flat, parts, strict=False):
        newton = where[part.key[part.method == "newton"].iloc[0]]
        greedy = where[part.key[part.method == "greedy"].iloc[0]]
        _outline(ax, curves, newton, "before", "before", color=COLOURS[7], linestyle=":")
        _outline(ax, curves, newton, "start", "start (rough shape)", color=COLOURS[4],
                 linestyle="--")  # fmt: skip
        _outline(ax, curves, greedy, "contour", "greedy", color=COLOURS[1], linestyle="-.")
        _outline(ax, curves, newton, "contour", "minimum (newton)", color=COLOURS[0])
        first = part.iloc[0]
        ax.set_title(f"{first.scene}\n{first.slices} slices", fontsize=9)
        ax.set(xlabel="radius", ylabel="height", aspect="equal")
        ax.locator_params(axis="x", nbins=3)
    _legend(figure, axes)
    return figure


def _outline(ax: Axes, curves: xr.Dataset, i: int, name: str, label: str, **look: Any) -> None:
    """Both halves of a contour of slices."""
    radii, heights = (curves[f"{name}_{what}"].values[i] for what in ("radius", "height"))
    known = np.isfinite(radii)
    radii, heights = radii[known], heights[known]
    ax.plot(np.append(radii, -radii[::-1]), np.append(heights, heights[::-1]), label=label, **look)


def _with_rungs(rows: pd.DataFrame, error: str) -> pd.DataFrame:
    """Gaps where a method was run with several settings; contours on several sizes."""
    by, of = ("problem", "settings") if error == GAP else ("specification", "problem")
    counts: Any = rows.groupby([by, "family"])[of].transform("nunique")
    return select(rows, rows[by].isin(rows[by][counts > 1]))


def _scenes(rows: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """A few scenes apart, each with the end of its chart's name; many together."""
    if rows.scene.nunique() <= _FEW and rows.squashes.max() == 0:
        yield from ((f"-{scene}", part) for scene, part in groups(rows, "scene"))
    elif len(rows):
        yield "", rows


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
    known = told_apart(known)
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
    parts = sorted(
        groups(rows, by), key=lambda part: (list(_UNITS).index(part[0][0]), *part[0][1:])
    )
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
        if select(those, those[error].notna()).family.nunique() > 1:
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
