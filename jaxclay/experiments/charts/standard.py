"""The charts of a folder, from its results alone: which there are, and their captions.

Times come from timing runs only: what ran beside others, or in a batch, has none worth drawing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxclay.experiments.charts import panels
from jaxclay.experiments.charts.maps import mark_maps
from jaxclay.experiments.charts.panels import CONTOUR, ERRORS, GAP, HIGH, LOW, ROUNDING
from jaxclay.experiments.charts.population import accuracy_charts, failure_charts
from jaxclay.experiments.charts.shared import Chart, default_rows, panelled, told_apart
from jaxclay.experiments.results import groups, select
from jaxclay.files.plots import COLOURS

_UNITS = {
    "snake": "snake units",
    "printed": "constants as printed",
    "move": "E_move alone (alpha = beta = 0)",
}
_BAND = f"{LOW:.0%} to {HIGH:.0%}"
_SHAPES: Any = (  # method, which contour of it, label, look
    ("newton", "before", "before", {"color": COLOURS[7], "linestyle": ":"}),
    ("newton", "start", "start (rough shape)", {"color": COLOURS[4], "linestyle": "--"}),
    ("greedy", "contour", "greedy", {"color": COLOURS[1], "linestyle": "-."}),
    ("newton", "contour", "minimum (newton)", {"color": COLOURS[0]}),
)
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
    """Each chart; the caller closes the figures."""
    tried = select(rows, rows.status != "skipped")
    if tried.empty:
        return
    if kind == "timing":
        yield from accuracy_charts(tried)
        yield from timing_charts(tried, curves)
        yield from _shape_charts(tried, curves)
    else:
        yield from _throughput_charts(tried)
    yield from mark_maps(told_apart(rows))
    yield from failure_charts(told_apart(rows))


def timing_charts(rows: pd.DataFrame, traces: xr.Dataset) -> Iterator[Chart]:
    """The charts of timing runs."""
    timed = select(rows, (rows.solve_s > 0) & (rows.budget == 0))
    yield from _work_precision_charts(timed)
    traced = _traced(rows, traces)
    if len(traced):
        yield (
            "energy",
            "Energy against time: fresh runs ended after more and more iterations, a faint line "
            "for each scene that has a certified minimum, a strong one through the medians; "
            "energies are above that minimum, over E_free.",
            _panels(traced, _GRIDS, panels.energy),
        )
    goals = []  # that two methods or more can be compared by
    for error, within, problem, title in _GOALS:
        those = _comparable(timed, error)
        if select(those, those[error].notna()).family.nunique() > 1:
            goals.append((title, panels.times_to_solve(those, error, within, problem)))
    if goals:
        yield (
            "profile",
            "Performance profiles (Dolan and More): the share of problems, which are scenes on a "
            "grid, that a method solves within a factor of the time of the quickest one, with its "
            "quickest setting that reaches the goal; for contours a problem is a scene, on "
            "whatever grid. Up and left is better. Problems without a certified minimum count as "
            "solved by none.",
            panelled(goals, panels.profile, 2, 4.8, 3.7),
        )
    grids = told_apart(select(timed, timed.slices > 0))
    if grids.slices.nunique() > 1:
        yield (
            "scaling",
            "Scaling: time against slices, medians over scenes, with the exponent of "
            f"the fitted power of n; the band holds {_BAND}. A method that gives up early looks "
            "quick here: whether it got there the other charts say.",
            _panels(grids, ["units"], panels.scaling),
        )


def _work_precision_charts(timed: pd.DataFrame) -> Iterator[Chart]:
    """Gaps where a method was run with several settings; contours on several sizes."""
    for error, known, left_out in _measured(timed):
        name, by, of = "work-precision-contour", "specification", "problem"
        point, grids = "a number of slices or of spans", ["units"]
        if error == GAP:
            name, by, of = "work-precision", "problem", "settings"
            point, grids = "a setting of the method", _GRIDS
        counts: Any = known.groupby([by, "family"])[of].transform("nunique")
        for where, part in _scenes(select(known, known[by].isin(known.loc[counts > 1, by]))):
            yield (
                name + where,
                f"Work and precision: {ERRORS[error]} against time. A point is {point}, at the "
                "medians over the scenes; bars, and bands where times rise from point to point, "
                f"hold {_BAND} of them. Down and left is better. {left_out}",
                _panels(part, grids, panels.work_precision(error)),
            )


def _throughput_charts(rows: pd.DataFrame) -> Iterator[Chart]:
    """How near the answers are; no times."""
    for error, known, left_out in _measured(told_apart(rows)):
        yield (
            "errors" + ("-contour" if error == CONTOUR else ""),
            f"The share of tasks whose {ERRORS[error]} is below a bound, those below "
            f"{ROUNDING:g} drawn there. Up and left is better. {left_out}",
            _panels(known, _GRIDS, panels.distribution(error)),
        )


def _shape_charts(rows: pd.DataFrame, curves: xr.Dataset) -> Iterator[Chart]:
    """Shapes before the squash, at the start, of greedy and of newton, each scene on one grid."""
    own = default_rows(rows)
    own = select(own, (own.scheme == "paper") & own.method.isin(["newton", "greedy"]))
    own = select(own, (own.squashes <= 1) & (own.budget == 0))
    both: Any = own.groupby(["units", "scene", "slices"]).method.transform("nunique")
    own = select(own, both == 2)
    by_key = curves.set_index(task="key")

    def draw(ax: Axes, part: pd.DataFrame) -> None:
        keys = part.drop_duplicates("method").set_index("method").key
        for method, what, label, look in _SHAPES:
            one = by_key.sel(task=keys[method])
            r, y = one[f"{what}_radius"].values, one[f"{what}_height"].values
            r, y = r[np.isfinite(r)], y[np.isfinite(r)]
            ax.plot(np.append(r, -r[::-1]), np.append(y, y[::-1]), label=label, **look)
        ax.grid(False)
        ax.set(xlabel="radius", ylabel="height", aspect="equal")
        ax.locator_params(axis="x", nbins=3)

    for units, part in groups(own, "units"):
        if part.scene.nunique() <= _MOST_SHAPES:
            titled = []
            for scene, same in groups(part, "scene"):  # on the fewest slices, from 64 up if it can
                sizes = set(same.slices)
                n = min([size for size in sizes if size >= 64] or sizes)
                titled.append((f"{scene}\n{n} slices", select(same, same.slices == n)))
            yield (
                f"shapes-{units}",
                "The shape before the squash, the start, greedy's answer and the minimum, "
                f"{_UNITS[units]}.",
                panelled(titled, draw, 5, 3.1, 3.4),
            )


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
        left = len(those) - len(known)
        if len(known):
            yield error, known, f"{left} tasks have no certified minimum." if left else ""


def _traced(rows: pd.DataFrame, traces: xr.Dataset) -> pd.DataFrame:
    """The rows that have a trace, certified, with its times and gaps."""
    known = told_apart(select(rows, rows.energy_minimum.notna() & (rows.energy_free > 0)))
    mine = traces.set_index(task="key").sel(task=list(known.key))
    minimum, scale = (known[name].to_numpy()[:, None] for name in ("energy_minimum", "energy_free"))
    gaps = (mine.trace_energy.values - minimum) / scale
    found = known.assign(trace_s=list(mine.trace_s.values), trace_gap=list(gaps))
    return select(found, np.isfinite(mine.trace_s.values).any(axis=1))


def _panels(rows: pd.DataFrame, by: list[str], draw: Callable[[Axes, Any], None]) -> Figure:
    """A panel for each value of the columns ``by``, units first."""
    order = list(_UNITS).index
    parts = sorted(groups(rows, by), key=lambda part: (order(part[0][0]), *part[0][1:]))
    titled = [
        (", ".join([_UNITS[units], *(f"{n} slices" if n else "splines" for n in slices)]), part)
        for (units, *slices), part in parts
    ]
    return panelled(titled, draw, 3, max(4.6, 6.0 / min(3, len(parts))), 3.9)


def _comparable(rows: pd.DataFrame, error: str) -> pd.DataFrame:
    """Splines minimise the integral, not the sum: their energies are compared with none."""
    return select(rows, rows.scheme != "spline") if error == GAP else rows
