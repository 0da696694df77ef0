"""Heat maps of failures: which method is not certified where."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxclay.experiments.charts.panels import even_ticks
from jaxclay.experiments.frames import groups, select

_MAP = colormaps["cividis"].resampled(10)  # light is solved; the same to colour-blind eyes
_NEAR = 1e-4  # gap over E_free up to which an answer counts as one
_ENOUGH = 60  # scenes from which their constants can be binned
_A_BIN = 15  # scenes in each, about
_MOST_BINS = 8
_FEWEST = 2  # of a bin that gets a colour
_MOST_SCENES = 14


def failure_charts(rows: pd.DataFrame) -> Iterator[tuple[str, str, Figure]]:
    """Name, caption and figure of each map; the caller closes the figures."""
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
    cells: dict[tuple[str, str], pd.DataFrame] = {
        where: select(part, part.status != "skipped")
        for where, part in groups(rows.assign(place=place), ["place", "series"])
    }
    lines = sorted(set(place), key=lambda name: (name.startswith("others, "), name))
    series = sorted(set(rows.series))
    share = np.full((len(lines), len(series)), np.nan)
    for (where, who), tried in cells.items():
        if len(tried):
            share[lines.index(where), series.index(who)] = _solved(tried).mean()
    figure, ax = plt.subplots(
        figsize=(max(6.0, 1.05 * len(series) + 3.2), 0.29 * len(lines) + 1.5), layout="constrained"
    )
    image = _image(ax, share)
    for (where, who), tried in cells.items():
        y, x = lines.index(where), series.index(who)
        text = f"{int(_solved(tried).sum())}/{len(tried)}" if len(tried) else "skipped"
        ax.text(x, y, text, ha="center", va="center", fontsize=9,
                color="white" if share[y, x] < 0.6 else "black")  # fmt: skip
    names = [who.replace("-", "-\n").replace(" ", "\n").replace("=", "=\n") for who in series]
    ax.set_xticks(range(len(series)), names, fontsize=9)
    ax.set_yticks(range(len(lines)), lines, fontsize=9)
    ax.xaxis.tick_top()
    figure.colorbar(image, ax=ax, label="share solved", aspect=30)
    return figure


def _by_material(rows: pd.DataFrame) -> Figure:
    """A panel for each method, those of other units on lines of their own."""
    parts = list(groups(rows, ["units", "series"]))
    units, series = sorted(set(rows.units)), sorted(set(rows.series))
    columns = min(4, len(series))
    each = -(-len(series) // columns)
    lines = each * len(units)
    figure, axes = plt.subplots(
        lines, columns, figsize=(max(3.0 * columns, 5.5), 2.9 * lines), layout="constrained",
        squeeze=False, sharex=True, sharey=True,
    )  # fmt: skip
    bins = int(np.clip(np.sqrt(len(rows) / len(parts) / _A_BIN), 3, _MOST_BINS))
    across, up = (
        np.geomspace(rows[name].min() * 0.999, rows[name].max() * 1.001, bins + 1)
        for name in ("friction", "beta")
    )
    image: Any = None
    for ax in axes.flat:
        ax.axis("off")
    for (unit, who), part in parts:
        line, column = divmod(series.index(who), columns)
        ax = axes[units.index(unit) * each + line, column]
        ax.axis("on")
        tried = select(part, part.status != "skipped")
        where = [np.log(tried.friction), np.log(tried.beta)]
        edges = [np.log(across), np.log(up)]
        count, *_ = np.histogram2d(*where, bins=edges)
        good, *_ = np.histogram2d(*where, bins=edges, weights=_solved(tried))
        share = np.divide(good, count, out=np.full_like(good, np.nan), where=count >= _FEWEST)
        image = ax.pcolormesh(across, up, share.T, cmap=_MAP, vmin=0, vmax=1)
        image.set(edgecolor="face", linewidth=0.4)  # without it viewers of SVG show seams
        ax.set(xscale="log", yscale="log", facecolor="#dddddd")
        even_ticks(ax.xaxis, ax.yaxis)
        ax.tick_params(labelbottom=True)  # beside an empty place too
        ax.set_title(f"{who}\n{unit} units", fontsize=9)
    figure.supxlabel("friction mu/k", fontsize=10)
    figure.supylabel("bending beta", fontsize=10)
    figure.colorbar(image, ax=axes, label="share solved", shrink=0.8)
    return figure


def _solved(rows: pd.DataFrame) -> pd.Series:
    """Whether each task was certified, or its energy is near a certified minimum."""
    return (rows.status == "converged") | (rows.gap_relative.abs() <= _NEAR)


def _image(ax: Axes, share: np.ndarray):
    """The shares as cells, first row on top, grey where nothing was tried."""
    ax.set_facecolor("#dddddd")
    height, width = share.shape
    across, down = np.arange(width + 1) - 0.5, np.arange(height + 1) - 0.5
    image = ax.pcolormesh(
        across, down, share, cmap=_MAP, vmin=0, vmax=1, edgecolors="white", linewidth=1.5
    )
    ax.invert_yaxis()
    return image
