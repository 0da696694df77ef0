"""The picture of speed against accuracy, from the rows of :mod:`.accuracy` alone."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxclay.experiments.compare.accuracy_tables import line_of, order, summary
from jaxclay.experiments.compare.results import records
from jaxclay.files.plots import COLOURS
from jaxclay.methods import METHODS

_LOWEST = 1e-6  # errors down to which the dashed line goes
_BLUE, _RED, _GREEN, _PINK, _ORANGE, _SKY, _BLACK, _GREY = COLOURS
_MARKERS = "sD^vP*Xh<>"


def speed_and_accuracy(table: pd.DataFrame) -> Figure:
    """Contour error against time, and against unknowns."""
    points = summary(table)
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(11.5, 5.4), width_ratios=(1.5, 1), layout="constrained", sharey=True
    )
    for ax, x in ((left, "solve_s"), (right, "unknowns")):
        _lines(ax, points, x)
        ax.set(xscale="log", yscale="log")
        ax.grid(True, which="major", alpha=0.25, linewidth=0.6)
    _others(left, points)
    time = "compiled time of one squash, ms (placed: its three solves), without posing"
    left.set(xlabel=time, ylabel="contour error over the height l")
    left.set_title("speed: down and left is better", fontsize=10)
    right.set(xlabel="unknowns")
    right.set_title("unknowns", fontsize=10)
    handles, labels = left.get_legend_handles_labels()
    others = bool(set(labels) & set(METHODS))
    figure.legend(
        handles, labels, loc="outside lower center", ncols=4, fontsize=8.5, frameon=False,
        title="thin lines, grey and yellow: other methods on the paper's sums" if others else None,
        title_fontsize=8.5,
    )  # fmt: skip
    return figure


def _lines(ax: Axes, points: pd.DataFrame, x: str) -> None:
    scale = 1e3 if x == "solve_s" else 1.0
    paper, equal, placed = (line_of(points, name) for name in ("paper", "equal", "placed"))
    _line(ax, paper, x, scale, _RED, "o", "the paper's sums, n slices", band=True)
    _beyond(ax, paper, x, scale)
    style = {"linestyle": (0, (1, 1)), "markerfacecolor": "white"}
    _line(ax, equal, x, scale, _GREEN, "P", "second order, n equal slices", **style)
    label = "second order, n slices placed"
    _line(ax, placed, x, scale, _GREEN, "P", label, band=True, linewidth=2.2, markersize=7)
    for degree, colour, marker in ((3, _SKY, "^"), (4, _PINK, "D"), (5, _BLUE, "s")):
        label = f"splines of degree {degree}, 2 to 32 equal spans"
        _line(ax, line_of(points, "spline", degree=degree), x, scale, colour, marker, label)
    sizes = (paper, (4, 4), "left", _RED), (placed, (-6, -9), "right", _GREEN)
    for line, offset, side, colour in sizes if x == "solve_s" else ():
        for point in records(line):
            ax.annotate(
                f"{point.size:.0f}", (getattr(point, x) * scale, point.error), offset,
                textcoords="offset points", fontsize=7.5, color=colour, ha=side,
            )  # fmt: skip


def _line(ax: Axes, line: pd.DataFrame, x, scale, colour, marker, label, band=False, **style):
    if line.empty:
        return
    at = line[x] * scale
    style = {"color": colour, "marker": marker, "markersize": 5, "linewidth": 1.5} | style
    ax.plot(at, line.error, label=label, **style)
    if band:
        ax.fill_between(at, line.low, line.high, color=colour, alpha=0.15, linewidth=0)


def _beyond(ax: Axes, paper: pd.DataFrame, x: str, scale: float) -> None:
    """The paper's scheme where no grid was solved: dashed, by the order of its medians."""
    if len(paper) < 3:
        return
    last, p, q = paper.iloc[-1], order(paper, "error"), order(paper, x)
    n = np.geomspace(1.0, (_LOWEST / last.error) ** (1 / p), 2)
    style = {"color": _RED, "linestyle": (0, (4, 3)), "linewidth": 1.2}
    label = f"extrapolated by its order {-p:.2g}"
    ax.plot(last[x] * scale * n**q, last.error * n**p, label=label, **style)
    at = last[x] * scale, last.error
    ax.plot(*at, "x", color=_BLACK, markersize=10, markeredgewidth=2, zorder=5)
    if x == "solve_s":
        text = "the finest grid solved\nin half the scenes"
        ax.annotate(text, at, (12, 14), textcoords="offset points", fontsize=8)


def _others(ax: Axes, points: pd.DataFrame) -> None:
    """The other methods: on the paper's sums a thin line each, hollow marks on splines."""
    unnamed = "the same on splines of degree 5"
    for name, marker in zip((m for m in METHODS if m != "newton"), _MARKERS, strict=False):
        colour = _ORANGE if name.startswith("greedy") else _GREY
        line = line_of(points, "paper", name)
        if len(line):
            ax.plot(
                line.solve_s * 1e3, line.error,
                color=colour, marker=marker, markersize=4.5, linewidth=0.7, label=name,
            )  # fmt: skip
        splines = line_of(points, "spline", name, degree=5)
        if len(splines):
            ax.plot(
                splines.solve_s * 1e3, splines.error,
                color=_BLUE, marker=marker, markerfacecolor="none", linestyle="none", label=unnamed,
            )  # fmt: skip
            unnamed = ""
