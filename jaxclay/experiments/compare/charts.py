"""The comparison's charts, from its results alone."""

from __future__ import annotations

from collections.abc import Iterator

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxclay.experiments.compare.peers import PEERS
from jaxclay.experiments.compare.plan import DEFAULT_METHODS
from jaxclay.experiments.compare.results import records, select
from jaxclay.experiments.compare.runner import Overlay
from jaxclay.files.plots import COLOURS, contour
from jaxclay.methods import METHODS

_ROUNDING = 1e-16  # gaps below it are drawn there
_MARKERS = "osD^vP*Xph<>d"
_UNITS = {
    "snake": "snake units (raw differences at 64 slices)",
    "printed": "as printed (alpha = beta = 1, eq. 21)",
    "move": "E_move alone (alpha = beta = 0)",
}


def charts(table: pd.DataFrame, overlays: list[Overlay]) -> Iterator[tuple[str, str, Figure]]:
    """Name, caption and figure of each chart; the caller closes the figures."""
    ladder = select(table, table.experiment == "ladder")
    for scene in ladder.scene.unique():
        rows = select(ladder, ladder.scene == scene)
        yield (
            f"gap-{scene}",
            f"(a) {scene}: energy gap to the certified minimum against time, each method over a "
            "ladder of steps or tolerances, every point a fresh run; down and left is better.",
            _panels(rows, scene, gap_panel),
        )
    grids = select(table, table.experiment.isin(["answer", "grid"]))
    for scene in select(grids, grids.contour_error_finest.notna()).scene.unique():
        rows = select(grids, (grids.scene == scene) & grids.solve_s.notna())
        yield (
            f"contour-{scene}",
            f"(b) {scene}: contour error against the finest certified grid against time, over the "
            "number of slices (the small figures): where methods end in one point, what is left "
            "is the discretisation's error.",
            _panels(rows, scene, contour_panel),
        )
    for units in dict.fromkeys(overlay.units for overlay in overlays):
        chosen = [overlay for overlay in overlays if overlay.units == units]
        yield (
            f"overlay-{units}",
            f"(c) The shape before the squash, the start, greedy's answer and the minimum, "
            f"{_UNITS[units]}.",
            overlay_figure(chosen),
        )
    trace = select(table, table.experiment == "trace")
    for scene in trace.scene.unique():
        rows = select(trace, trace.scene == scene)
        yield (
            f"energy-{scene}",
            f"(d) {scene}: E_total against time, runs stopped after more and more iterations.",
            _panels(rows, scene, energy_panel),
        )


def _panels(rows: pd.DataFrame, scene: str, draw) -> Figure:
    """One panel for each of the units that the scene was run in, side by side."""
    units = list(dict.fromkeys(rows.units))
    figure, axes = plt.subplots(
        1, len(units), figsize=(5.2 * len(units), 4.4), layout="constrained", squeeze=False
    )
    for ax, name in zip(axes[0], units, strict=True):
        draw(ax, select(rows, rows.units == name))
        slices = sorted(select(rows, rows.units == name).slices.unique())
        grid = f"{slices[0]} slices" if len(slices) == 1 else f"{slices[0]} to {slices[-1]} slices"
        ax.set_title(f"{scene}, {grid}\n{_UNITS[name]}", fontsize=10)
        ax.grid(True, which="major", alpha=0.3)
    lines = {line.get_label(): line for ax in axes[0] for line in ax.get_legend_handles_labels()[0]}
    figure.legend(
        list(lines.values()), list(lines), loc="outside lower center", ncols=6, fontsize="small"
    )
    return figure


def _lines(rows: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame, dict]]:
    for method in dict.fromkeys(rows.method):
        yield method, select(rows, rows.method == method), style(method)


def style(method: str) -> dict:
    """Every method has its colour and marker in all charts; peers are dashed and hollow."""
    style = {"label": method, "markersize": 5, "linewidth": 1.3}
    if method in PEERS:
        j = list(PEERS).index(method)
        dashed = {"linestyle": "--", "markerfacecolor": "white"}
        return style | dashed | {"color": COLOURS[6 - j], "marker": _MARKERS[7 - j]}
    # Those that run unless told otherwise come first, and so never share a colour.
    order = [*DEFAULT_METHODS, *(name for name in METHODS if name not in DEFAULT_METHODS)]
    j = order.index(method)
    line = "-" if j < len(COLOURS) else "-."
    return style | {"linestyle": line, "color": COLOURS[j % 8], "marker": _MARKERS[j]}


def gap_panel(ax: Axes, rows: pd.DataFrame) -> None:
    """Relative energy gap against solve time, a line for each method."""
    for _, line, style in _lines(rows):
        line = line.sort_values("value", ascending=False)  # from loose to tight
        # What breaks a constraint may lie below the minimum: that is an error too.
        ax.plot(line.solve_s * 1e3, np.maximum(abs(line.gap_relative), _ROUNDING), **style)
    first = rows.iloc[0]
    start = (first.energy_start - first.energy_minimum) / first.energy_free
    if np.isfinite(start):
        ax.axhline(start, color="#555555", linestyle="--", linewidth=1)
        ax.annotate("rough start", (0.98, start), xycoords=("axes fraction", "data"), ha="right",
                    va="bottom", fontsize=8, color="#555555")  # fmt: skip
    ax.set(xscale="log", yscale="log")
    ax.set(xlabel="solve time (ms), compiling apart", ylabel="energy gap / E_free")


def contour_panel(ax: Axes, rows: pd.DataFrame) -> None:
    """Contour error against solve time, a line for each method, a point for each grid."""
    for _, line, style in _lines(rows):
        line = line.sort_values("slices")
        ax.plot(line.solve_s * 1e3, line.contour_error_finest, **style)
        ends = line.iloc[[0, -1]]
        for point in records(ends):
            ax.annotate(f"{point.slices}", (point.solve_s * 1e3, point.contour_error_finest),
                        textcoords="offset points", xytext=(4, 4), fontsize=7,
                        color=style["color"])  # fmt: skip
    ax.set(xscale="log", yscale="log")
    ax.set(xlabel="solve time (ms), compiling apart", ylabel="contour error / l")


def energy_panel(ax: Axes, rows: pd.DataFrame) -> None:
    """E_total against solve time, a line for each method."""
    for _, line, style in _lines(rows):
        line = line.sort_values("iterations")
        ax.plot(line.solve_s * 1e3, line.energy, **style)
    minimum = rows.energy_minimum.iloc[0]
    if np.isfinite(minimum):
        ax.axhline(minimum, color="#555555", linestyle="--", linewidth=1)
        ax.annotate("certified minimum", (0.02, minimum), xycoords=("axes fraction", "data"),
                    va="bottom", fontsize=8, color="#555555")  # fmt: skip
    wide = rows.energy.max() > 10 * rows.energy.min()
    ax.set(xscale="log", yscale="log" if wide else "linear")
    ax.set(xlabel="solve time (ms), compiling apart", ylabel="E_total (no unit)")


def overlay_figure(overlays: list[Overlay]) -> Figure:
    """A panel for each scene: before, start, greedy, minimum."""
    columns = min(5, len(overlays))
    count = -(-len(overlays) // columns)
    figure, axes = plt.subplots(
        count, columns, figsize=(3.1 * columns, 3.4 * count), layout="constrained", squeeze=False
    )
    for ax in axes.flat[len(overlays) :]:
        ax.axis("off")
    for ax, overlay in zip(axes.flat, overlays, strict=False):
        ax.set(xlabel="radius", ylabel="height")
        contour(overlay.rest, ax, color=COLOURS[7], linestyle=":", label="before")
        contour(overlay.rough, ax, color=COLOURS[4], linestyle="--", label="start (rough shape)")
        for name, colour, style in (("greedy", COLOURS[1], "-."), ("newton", COLOURS[0], "-")):
            if name in overlay.answers:
                label = "minimum (newton)" if name == "newton" else name
                contour(overlay.answers[name], ax, color=colour, linestyle=style, label=label)
        ax.set_title(f"{overlay.scene}\n{overlay.slices} slices", fontsize=9)
        ax.locator_params(axis="x", nbins=3)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize="small")
    return figure
