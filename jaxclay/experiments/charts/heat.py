"""Heat maps of failures: which method is not certified where."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib import colormaps
from matplotlib.figure import Figure

from jaxclay.experiments.charts.layout import Chart, cells, even_ticks, grid
from jaxclay.experiments.frames import groups, select

# Light is solved; the same to colour-blind eyes.
_LOOK: dict[str, Any] = {"cmap": colormaps["cividis"].resampled(10), "vmin": 0, "vmax": 1}
_UNTRIED = "#dddddd"
_NEAR = 1e-4  # gap over E_free up to which an answer counts as one
_ENOUGH = 60  # scenes from which their constants can be binned
_A_BIN = 15  # scenes in each, about
_MOST_BINS = 8
_FEWEST = 2  # of a bin that gets a colour
_MOST_SCENES = 14


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
        ax.set(xscale="log", yscale="log", facecolor=_UNTRIED)
        even_ticks(ax.xaxis, ax.yaxis)
        ax.set_title(f"{who}\n{units} units", fontsize=9)
    figure.supxlabel("friction mu/k", fontsize=10)
    figure.supylabel("bending beta", fontsize=10)
    figure.colorbar(image, ax=axes, label="share solved", shrink=0.8)
    return figure
