"""Figures of several panels, ticks of logarithmic axes, and coloured cells."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullLocator

Chart = tuple[str, str, Figure]  # name, caption and figure, which the caller closes
_FEWEST, _MOST = 3, 6  # marks on an axis
_STEPS = (1, 2, 5), (1, 3), (1,)  # of marks within a decade, the densest that are not too many
_PLAIN = 1e-3, 1e4  # within which powers of ten are written out


def grid(count: int, columns: int, width: float, height: float, **how: Any):
    """A figure with ``count`` panels, so many side by side, each so large in inches."""
    columns = min(columns, count)
    size = width * columns, height * -(-count // columns)
    figure, axes = plt.subplots(
        -(-count // columns), columns, figsize=size, layout="constrained", squeeze=False, **how
    )
    for ax in axes.flat[count:]:
        ax.remove()
    for ax in axes.flat[max(count - columns, 0) : count]:  # the lowest of each column
        ax.tick_params(labelbottom=True)
    return figure, axes.ravel()[:count]


def panelled(
    parts: Iterable[tuple[str, Any]], draw: Callable[[Axes, Any], None], columns: int,
    width: float, height: float,
) -> Figure:  # fmt: skip
    """A panel for each title and what is drawn below it, one legend for all."""
    parts = list(parts)
    figure, axes = grid(len(parts), columns, width, height)
    for ax, (title, part) in zip(axes, parts, strict=True):
        ax.set_title(title, fontsize=10)
        ax.grid(True, which="major", alpha=0.3)
        draw(ax, part)
    legend(figure)
    return figure


def legend(figure: Figure, **look: Any) -> None:
    """One legend below all panels, each name once."""
    shown: dict[str, Any] = {}
    for ax in figure.axes:
        handles, labels = ax.get_legend_handles_labels()
        shown |= dict(zip(labels, handles, strict=True))
    names = sorted(shown)  # whichever of them the first panel has
    look = {"loc": "outside lower center", "ncols": 4, "fontsize": "small"} | look
    figure.legend([shown[name] for name in names], names, **look)


def cells(ax: Axes, values: Any, **look: Any) -> Any:
    """A coloured cell for each number of a matrix, centred on whole numbers; nan is left open."""
    across, up = (np.arange(n + 1) - 0.5 for n in np.shape(values)[::-1])
    known = np.ma.masked_invalid(np.asarray(values, float))
    return ax.pcolormesh(across, up, known, edgecolors="white", **look)


def even_ticks(*axes: Axis) -> None:
    """Numbers on logarithmic axes, few enough not to touch, whatever their range."""
    for axis in axes:
        marks = _marks(*axis.get_view_interval())
        powers = np.log10(marks)
        plain = _PLAIN[0] <= marks[0] and marks[-1] <= _PLAIN[1]
        labels = [f"{mark:g}" for mark in marks]
        if np.allclose(powers, powers.round(), atol=1e-9) and not plain:
            labels = [f"$10^{{{power:.0f}}}$" for power in powers]
        axis.set_ticks(marks, labels)
        axis.set_minor_locator(NullLocator())


def _marks(low: float, high: float) -> np.ndarray:
    """Round numbers from ``low`` to ``high``, even on a logarithmic axis."""
    powers = np.arange(np.floor(np.log10(low)), np.floor(np.log10(high)) + 1)
    stride = -(-len(powers) // _MOST)
    candidates = [
        *(np.outer(10.0**powers, steps).ravel() for steps in _STEPS),
        10.0 ** powers[powers % stride == 0],
        # So little of a decade is seen that its marks stand about evenly.
        np.asarray(MaxNLocator(4, steps=[1, 2, 5, 10]).tick_values(low, high)),
    ]
    within = [marks[(low <= marks) & (marks <= high)] for marks in candidates]
    return next((marks for marks in within if _FEWEST <= len(marks) <= _MOST), within[-1])
