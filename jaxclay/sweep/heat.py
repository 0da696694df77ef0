"""Heat maps of failures: which method is not certified where."""

from __future__ import annotations

from collections.abc import Iterator

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jaxclay.compare.results import select

_MAP = "cividis"  # light is certified; the same to colour-blind eyes
_BINS = 6
_ENOUGH = 60  # scenes from which their constants can be binned
_FEWEST = 3  # of a bin that gets a colour
_MOST_SCENES = 14


def failure_charts(rows: pd.DataFrame) -> Iterator[tuple[str, str, Figure]]:
    """Name, caption and figure of each map; the caller closes the figures."""
    yield (
        "failures",
        "The share of tasks that the certificate accepts, by method and scene: dark is failure. "
        "Greedy searches end where one node can gain no more, which the certificate seldom "
        "accepts; how near they come the other charts say. Numbers are tasks certified of those "
        "tried.",
        _by_scene(rows),
    )
    many = select(rows, (rows.squashes > 0) & (rows.mu > 0) & (rows.beta > 0))
    spread = all(many[name].nunique() > _BINS for name in ("mu", "beta"))
    if many.recipe.nunique() >= _ENOUGH and spread:
        yield (
            "failures-materials",
            "The share of random scenes that the certificate accepts, by friction mu/k and bending "
            f"beta, in the units named; empty where there are fewer than {_FEWEST}.",
            _by_material(many),
        )


def _by_scene(rows: pd.DataFrame) -> Figure:
    names = list(dict.fromkeys(rows.scene))
    kept = rows
    if len(names) > _MOST_SCENES:
        kept = rows.assign(scene=rows.scene.where(rows.scene.isin(names[:_MOST_SCENES]), "others"))
    column = kept.scene + "\n" + kept.units
    columns, series = list(dict.fromkeys(column)), list(dict.fromkeys(rows.series))
    tried = kept.status != "skipped"
    certified = (kept.status == "converged").where(tried)
    groups = certified.groupby([rows.series, column])
    share = groups.mean().unstack().reindex(index=series, columns=columns)
    counts = groups.agg(["sum", "count"])
    figure, ax = plt.subplots(
        figsize=(max(6.0, 0.85 * len(columns) + 2.6), 0.5 * len(series) + 1.9),
        layout="constrained",
    )
    image = _image(ax, share.to_numpy(float))
    for (who, where), count in counts.iterrows():
        x, y = columns.index(where), series.index(who)
        value = share.loc[who, where]
        text = f"{int(count['sum'])}/{int(count['count'])}" if count["count"] else "skipped"
        ax.text(x, y, text, ha="center", va="center", fontsize=7,
                color="white" if value == value and value < 0.6 else "black")  # fmt: skip
    ax.set_xticks(range(len(columns)), columns, fontsize=8)
    ax.set_yticks(range(len(series)), series)
    ax.set(xlabel="scene, and units of alpha and beta", ylabel="method")
    figure.colorbar(image, ax=ax, label="share certified", shrink=0.9)
    return figure


def _by_material(rows: pd.DataFrame) -> Figure:
    groups = list(rows.groupby(["units", "series"]))
    columns = min(4, len(groups))
    lines = -(-len(groups) // columns)
    figure, axes = plt.subplots(
        lines, columns, figsize=(max(3.0 * columns, 5.5), 2.9 * lines), layout="constrained",
        squeeze=False, sharex=True, sharey=True,
    )  # fmt: skip
    across, up = (
        np.geomspace(rows[name].min() * 0.999, rows[name].max() * 1.001, _BINS + 1)
        for name in ("mu", "beta")
    )
    image = None
    for ax in axes.flat[len(groups) :]:
        ax.axis("off")
    for ax, ((units, series), part) in zip(axes.flat, groups, strict=False):
        tried = select(part, part.status != "skipped")
        where = [np.log(tried.mu / tried.k), np.log(tried.beta)]
        edges = [np.log(across), np.log(up)]
        count, *_ = np.histogram2d(*where, bins=edges)
        good, *_ = np.histogram2d(*where, bins=edges, weights=tried.status == "converged")
        share = np.divide(good, count, out=np.full_like(good, np.nan), where=count >= _FEWEST)
        image = ax.pcolormesh(across, up, share.T, cmap=_MAP, vmin=0, vmax=1)
        ax.set(xscale="log", yscale="log")
        ax.set_title(f"{series}\n{units} units", fontsize=9)
    figure.supxlabel("friction mu/k", fontsize=10)
    figure.supylabel("bending beta", fontsize=10)
    figure.colorbar(image, ax=axes, label="share certified", shrink=0.8)
    return figure


def _image(ax: Axes, share: np.ndarray):
    ax.set_facecolor("#dddddd")
    image = ax.imshow(share, cmap=_MAP, vmin=0, vmax=1, aspect="auto")
    ax.set_xticks(np.arange(share.shape[1] + 1) - 0.5, minor=True)
    ax.set_yticks(np.arange(share.shape[0] + 1) - 0.5, minor=True)
    ax.grid(which="minor", color="white", linewidth=1.5)
    ax.tick_params(which="minor", length=0)
    return image
