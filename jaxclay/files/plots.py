"""Pictures with Matplotlib: every function takes and returns an Axes (extra ``plot``)."""

from __future__ import annotations

import os

import numpy as np

from jaxclay.numerics.checks import needing

with needing("plot", "drawing"):
    import matplotlib.pyplot as plt
    from matplotlib.axes import Axes

from jaxclay.clay.clay import Clay
from jaxclay.clay.contour import polyline
from jaxclay.solve.solution import Solution

# Okabe and Ito's palette, told apart by colour-blind readers too.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C8C8C")
CLAY = "#E8D5C0"
FORMATS = (".png", ".svg", ".pdf")


def contour(clay: Clay, ax: Axes | None = None, *, fill: bool = False, **style) -> Axes:
    """The clay's silhouette: both halves of the contour, radius against height.

    Parameters
    ----------
    clay : Clay
        What is drawn, in its own length unit.
    ax : Axes, optional
        Where; a new figure's if not given.
    fill : bool
        Whether the inside is tinted.
    **style
        Passed on to ``Axes.plot``, such as label, color, linestyle.
    """
    ax = ax or _new_axes(4, 4.5)
    points = polyline(clay)
    mirrored = points[::-1] * [-1, 1]
    outline = np.concatenate([points, mirrored])
    style = {"color": COLOURS[0], "linewidth": 1.5} | style
    ax.plot(outline[:, 0], outline[:, 1], **style)
    if fill:
        ax.fill(outline[:, 0], outline[:, 1], color=CLAY, alpha=0.6, linewidth=0)
    if not ax.get_xlabel():
        ax.set(xlabel="radius (clay's length unit)", ylabel="height (clay's length unit)")
    ax.set_aspect("equal")
    return ax


def solution(answer: Solution, ax: Axes | None = None) -> Axes:
    """The shape before the squash, the rough shape and the minimum, and the tool's band."""
    ax = contour(
        answer.before, ax or _new_axes(7, 4.5), color=COLOURS[7], linestyle=":", label="before"
    )
    contour(
        answer.rough.clay(answer.problem.clay),
        ax,
        color=COLOURS[4],
        linestyle="--",
        label="rough shape (E_move)",
    )
    contour(answer.clay, ax, fill=True, label=f"{answer.method} (E_total)")
    bottom, top = float(answer.rough.bottom), float(answer.rough.top)
    ax.axhspan(bottom, top, color=COLOURS[5], alpha=0.15, label="band")
    ax.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1, 1))
    return ax


def save(answer: Solution, path: str | os.PathLike, base: float = 0.0) -> None:
    """Write :func:`solution`'s picture; the name's ending, one of FORMATS, says in which format.

    Heights are labelled from ``base``, length, which the clay stands at.
    """
    figure, ax = plt.subplots(figsize=(7, 4.5), layout="constrained")
    solution(answer, ax)
    if base:
        ax.yaxis.set_major_formatter(lambda height, _: f"{base + height:g}")
    figure.savefig(path, dpi=150, bbox_inches="tight")
    plt.close(figure)


def heights(answer: Solution, ax: Axes | None = None) -> Axes:
    """Y(u) before, rough and at the minimum, as in Fig. 3 of the paper."""
    ax = ax or _new_axes(5, 3.5)
    before, rough = answer.before, answer.rough.clay(answer.problem.clay)
    for clay, colour, line, label in (
        (before, COLOURS[7], ":", "before"),
        (rough, COLOURS[4], "--", "rough shape (E_move)"),
        (answer.clay, COLOURS[0], "-", f"{answer.method} (E_total)"),
    ):
        ax.plot(clay.material, clay.heights, color=colour, linestyle=line, label=label)
    low, high = answer.rough.band
    ax.axvspan(float(low), float(high), color=COLOURS[5], alpha=0.15, label="band")
    ax.set(xlabel="material coordinate u", ylabel="height Y (clay's length unit)")
    ax.legend(fontsize="small")
    return ax


def _new_axes(width: float, height: float) -> Axes:
    return plt.subplots(figsize=(width, height), layout="constrained")[1]
