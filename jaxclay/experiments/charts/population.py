"""The whole of a population in one picture: speed against accuracy, and who fails where."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxclay.experiments.charts.panels import CONTOUR, HIGH, LOW, bands, exponent, shade
from jaxclay.experiments.charts.shared import (
    Chart,
    cells,
    default_rows,
    grid,
    legend,
    log_axes,
    style,
)
from jaxclay.experiments.results import groups, records, select
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
# Light is solved; the same to colour-blind eyes.
_LOOK: dict[str, Any] = {"cmap": colormaps["cividis"].resampled(10), "vmin": 0, "vmax": 1}
_UNTRIED = "#dddddd"
_NEAR = 1e-4  # gap over E_free up to which an answer counts as one
_ENOUGH = 60  # scenes from which their constants can be binned
_A_BIN = 15  # scenes in each, about
_MOST_BINS = 8
_FEWEST = 2  # of a bin that gets a colour
_MOST_SCENES = 14


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
    right.set(xlabel="unknowns")
    for ax, title in ((left, "speed: down and left is better"), (right, "unknowns")):
        ax.set_title(title, fontsize=10)
        ax.grid(True, which="major", alpha=0.25, linewidth=0.6)
        log_axes(ax)
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
            shade(ax, line[x], line, look)
            for point in records(line) if x == "ms" else ():
                ax.annotate(f"{point.size_of:.0f}", (point.ms, point.error), (4, 4), fontsize=7.5,
                            color=look["color"], textcoords="offset points")  # fmt: skip
        if way[0] == "paper":
            _beyond(ax, line, x)


def _beyond(ax: Axes, line: pd.DataFrame, x: str) -> None:
    """The paper's scheme where no grid was solved: dashed, by the order of its medians."""
    fine = select(line, line.size_of >= _FINE)
    fine = fine if len(fine) >= 3 else line
    last = line.iloc[-1]
    p, q = exponent(fine.size_of, fine.error), exponent(fine.size_of, fine[x])
    if len(fine) < 3 or p >= 0:
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


def failure_charts(rows: pd.DataFrame) -> Iterator[Chart]:
    """How much was solved, by scene and, where there are many, by the constants of the clay."""
    near = (rows.status == "converged") | (rows.gap_relative.abs() <= _NEAR)
    rows = rows.assign(solved=near.where(rows.status != "skipped").astype(float))
    yield (
        "failures",
        "Failures, dark: the share of tasks that were solved, by method and scene, in the units of "
        "alpha and beta named. Solved is what the certificate accepts, or what lies within "
        f"{_NEAR:g} of E_free of a certified minimum. Numbers are tasks solved of those tried.",
        _by_scene(rows),
    )
    many = rows.assign(friction=rows.mu / rows.k)
    many = select(many, (many.squashes > 0) & (many.friction > 0) & (many.beta > 0))
    spread = all(many[name].nunique() > _MOST_BINS for name in ("friction", "beta"))
    if many.specification.nunique() >= _ENOUGH and spread:
        yield (
            "failures-materials",
            "Failures among random scenes, dark: the share solved, as above, by friction mu/k and "
            f"bending beta, in the units named; grey where there are fewer than {_FEWEST}.",
            _by_material(many),
        )


def _by_scene(rows: pd.DataFrame) -> Figure:
    """A line for each scene in its units, a column for each method."""
    shown = [*dict.fromkeys(rows.scene)][:_MOST_SCENES]
    place = rows.scene.where(rows.scene.isin(shown), "others") + ", " + rows.units
    found = rows.assign(place=place).groupby(["place", "series"]).solved.agg(["sum", "count"])
    good, tried = found["sum"].unstack(), found["count"].unstack()
    lines = sorted(good.index, key=lambda name: (name.startswith("others, "), name))
    good, tried = good.loc[lines], tried.loc[lines]
    share = (good / tried).to_numpy()
    height, width = share.shape
    figure, ax = plt.subplots(
        figsize=(max(6.0, 1.05 * width + 3.2), 0.29 * height + 1.5), layout="constrained"
    )
    ax.set_facecolor(_UNTRIED)
    image = cells(ax, share, linewidth=1.5, **_LOOK)
    for y, x in zip(*np.nonzero(tried.notna().to_numpy()), strict=True):
        count = tried.iat[y, x]
        text = f"{good.iat[y, x]:.0f}/{count:.0f}" if count else "skipped"
        ax.text(x, y, text, ha="center", va="center", fontsize=9,
                color="white" if share[y, x] < 0.6 else "black")  # fmt: skip
    names = [who.replace("-", "-\n").replace(" ", "\n").replace("=", "=\n") for who in good]
    ax.set_xticks(range(width), names, fontsize=9)
    ax.set_yticks(range(height), lines, fontsize=9)
    ax.invert_yaxis()
    ax.xaxis.tick_top()
    figure.colorbar(image, ax=ax, label="share solved", aspect=30)
    return figure


def _by_material(rows: pd.DataFrame) -> Figure:
    """A panel for each method in each of the units."""
    parts = list(groups(rows, ["units", "series"]))
    figure, axes = grid(len(parts), 4, 3.0, 2.9, sharex=True, sharey=True)
    bins = int(np.clip(np.sqrt(len(rows) / len(parts) / _A_BIN), 3, _MOST_BINS))
    edges = [
        np.geomspace(rows[name].min() * 0.999, rows[name].max() * 1.001, bins + 1)
        for name in ("friction", "beta")
    ]
    image: Any = None
    for ax, ((units, who), part) in zip(axes, parts, strict=True):
        tried = select(part, part.solved.notna())
        where = tried.friction, tried.beta
        count, *_ = np.histogram2d(*where, bins=edges)
        good, *_ = np.histogram2d(*where, bins=edges, weights=tried.solved)
        share = np.divide(good, count, out=np.full_like(good, np.nan), where=count >= _FEWEST)
        image = ax.pcolormesh(*edges, share.T, **_LOOK)
        image.set(edgecolor="face", linewidth=0.4)  # without it viewers of SVG show seams
        log_axes(ax, facecolor=_UNTRIED)
        ax.set_title(f"{who}\n{units} units", fontsize=9)
    figure.supxlabel("friction mu/k", fontsize=10)
    figure.supylabel("bending beta", fontsize=10)
    figure.colorbar(image, ax=axes, label="share solved", shrink=0.8)
    return figure
