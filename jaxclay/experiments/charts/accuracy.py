"""The whole of a population in one picture: error against time and against unknowns."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxclay.experiments.charts.layout import Chart, even_ticks, legend
from jaxclay.experiments.charts.panels import CONTOUR
from jaxclay.experiments.charts.series import default_rows, style
from jaxclay.experiments.charts.statistics import HIGH, LOW, bands, exponent
from jaxclay.experiments.frames import groups, records, select
from jaxclay.files.plots import COLOURS

GOOD = 3e-5  # largest error of answers to measure errors from, over l
_SHARE = 0.5  # of the scenes that a point of a line must stand for
_LOWEST = 1e-6  # errors down to which the dashed line goes
_FINE = 256  # slices from which the order is fitted
_BLUE, _RED, _GREEN, _PINK, _ORANGE, _SKY, _BLACK, _GREY = COLOURS
_WAYS = {
    ("paper", 0): ("the paper's sums, n slices", {"color": _RED, "marker": "o"}),
    ("equal", 0): ("second order, n equal slices",
                   {"color": _GREEN, "marker": "P", "linestyle": ":", "markerfacecolor": "white"}),
    ("placed", 0): ("second order, n slices placed",
                    {"color": _GREEN, "marker": "P", "linewidth": 2.2, "markersize": 7}),
    ("tolerance", 0): ("to a tolerance", {"color": _ORANGE, "marker": "*", "markersize": 9}),
    ("spline", 3): ("splines of degree 3", {"color": _SKY, "marker": "^"}),
    ("spline", 4): ("splines of degree 4", {"color": _PINK, "marker": "D"}),
    ("spline", 5): ("splines of degree 5", {"color": _BLUE, "marker": "s"}),
}  # fmt: skip


def accuracy_charts(rows: pd.DataFrame) -> Iterator[Chart]:
    """None where fewer than two schemes were timed as a whole."""
    known = points(rows)
    if known.empty or select(known, known.method == "newton").line.nunique() < 2:
        return
    yield (
        "accuracy",
        "Speed and accuracy: contour error against the time of the whole call of deform and "
        f"against unknowns, medians over the scenes of which {_SHARE:.0%} could be solved; bands "
        f"hold {LOW:.0%} to {HIGH:.0%}. Hollow stars are first answers of a process, compiling "
        "included. Where float64 resolves no finer grid of the paper's sums, a cross and a dashed "
        "line by the order of the last errors.",
        speed_and_accuracy(known),
    )


def points(rows: pd.DataFrame) -> pd.DataFrame:
    """Medians over the scenes for each way and size, and the errors' band; a row a point."""
    rows = default_rows(select(rows, (rows.call == "deform") & (rows.precision == "float64")))
    rows = select(rows, rows.continuum_error <= GOOD)
    line = rows.way.where(rows.tolerance == 0, "tolerance")
    rows = rows.assign(line=line, size_of=rows.slices + rows.elements + rows.tolerance)
    rows = rows.assign(unknowns=rows.unknowns.astype(float))
    by = ["line", "degree", "method", "size_of"]
    medians = {name: (name, "median") for name in ("unknowns", "solve_s", "first_s")}
    solved = select(rows, ~rows.status.isin(["unresolved", "non-finite"]))
    made = bands(solved, by, CONTOUR, scenes=(CONTOUR, "size"), **medians)
    made = made.assign(share=made.scenes / rows.groupby(by).size()).reset_index()
    return select(made.rename(columns={"middle": "error"}), made.share >= _SHARE).sort_values(by)


def speed_and_accuracy(known: pd.DataFrame) -> Figure:
    """Error against time, first answers apart, and against unknowns."""
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(11.5, 5.6), width_ratios=(1.6, 1), layout="constrained", sharey=True
    )
    known = known.assign(ms=known.solve_s * 1e3, first_ms=known.first_s * 1e3)
    newton = known.method == "newton"
    for ax, x in ((left, "ms"), (right, "unknowns")):
        _by_newton(ax, select(known, newton), x)
    _others(left, select(known, ~newton))
    _first_answers(left, select(known, known.first_s.notna()))
    left.set(xlabel="time of the whole call, ms", ylabel="contour error over the height l")
    left.set_title("speed: down and left is better", fontsize=10)
    right.set(xlabel="unknowns")
    right.set_title("unknowns", fontsize=10)
    for ax in (left, right):
        ax.set(xscale="log", yscale="log")
        ax.grid(True, which="major", alpha=0.25, linewidth=0.6)
        even_ticks(ax.xaxis, ax.yaxis)
    legend(figure, frameon=False)
    return figure


def _by_newton(ax: Axes, known: pd.DataFrame, x: str) -> None:
    for way, (label, look) in _WAYS.items():
        line = select(known, (known.line == way[0]) & (known.degree == way[1]))
        if line.empty:
            continue
        shown: dict[str, Any] = {"markersize": 5, "linewidth": 1.5} | look
        ax.plot(line[x], line.error, label=label, **shown)
        if way[0] in ("paper", "placed"):
            look = {"color": look["color"]}
            ax.fill_between(line[x], line.low, line.high, alpha=0.15, linewidth=0, **look)
            for point in records(line) if x == "ms" else ():
                ax.annotate(f"{point.size_of:.0f}", (point.ms, point.error), (4, 4),
                            textcoords="offset points", fontsize=7.5, **look)  # fmt: skip
        if way[0] == "paper":
            _beyond(ax, line, x)


def _beyond(ax: Axes, line: pd.DataFrame, x: str) -> None:
    """The paper's scheme where no grid was solved: dashed, by the order of its medians."""
    fine = select(line, line.size_of >= _FINE)
    fine = fine if len(fine) >= 3 else line
    if len(fine) < 3:
        return
    last = line.iloc[-1]
    p, q = exponent(fine.size_of, fine.error), exponent(fine.size_of, fine[x])
    if p >= 0:
        return
    n = np.geomspace(1.0, (_LOWEST / last.error) ** (1 / p), 2)
    look: dict[str, Any] = {"color": _RED, "linestyle": (0, (4, 3)), "linewidth": 1.2}
    label = f"extrapolated by its order {-p:.2g}"
    ax.plot(float(last[x]) * n**q, float(last.error) * n**p, label=label, **look)
    ax.plot([last[x]], [last.error], "x", color=_BLACK, ms=10, mew=2, zorder=5)


def _others(ax: Axes, known: pd.DataFrame) -> None:
    """The other methods: on the paper's sums a thin line each, on the others hollow marks."""
    for (method, line), part in groups(known, ["method", "line"]):
        look: dict[str, Any] = style(method) | {"markersize": 4.5, "linewidth": 0.7}
        if line != "paper":
            look |= {"linestyle": "none", "markerfacecolor": "none", "label": None}
        ax.plot(part.ms, part.error, **look)


def _first_answers(ax: Axes, known: pd.DataFrame) -> None:
    """What the first answer of a process costs, each in its line's colour."""
    for point in records(known):
        looks = _WAYS[point.line, point.degree][1] if point.method == "newton" else None
        colour = (looks or style(point.method))["color"]
        ax.plot(
            [point.first_ms], [point.error], linestyle="none", marker="*", markersize=11,
            color=colour, markerfacecolor="white", label="first answer of a process", zorder=4,
        )  # fmt: skip
