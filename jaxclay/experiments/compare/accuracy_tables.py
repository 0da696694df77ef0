"""What the rows of :mod:`.accuracy` say: medians, orders, what a level takes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from jaxclay.experiments.compare.results import select

_LINE = ["scheme", "method", "degree"]
_SHARE = 0.5  # of the scenes that a point of a line must stand for
_FINE = 256  # slices from which the order is fitted


class Reach(NamedTuple):
    """What a scene takes on slices to get below a level of error.

    Attributes
    ----------
    slices, seconds : float
    beyond : bool
        Whether they are extrapolated, as float64 or the largest grid came first.
    """

    slices: float
    seconds: float
    beyond: bool


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Medians of each line's points over the scenes, and the errors' 10% and 90%; a row a point."""
    keys = [*_LINE, "size"]
    known = select(table, (table.limit == "") & table.error.notna())
    groups = known.groupby(keys)
    made = groups.agg(
        error=("error", "median"),
        low=("error", lambda e: e.quantile(0.1)),
        high=("error", lambda e: e.quantile(0.9)),
        unknowns=("unknowns", "median"),
        solve_s=("solve_s", "median"),
        call_s=("call_s", "median"),
        scenes=("error", "size"),
    )
    made["share"] = made.scenes / table.groupby(keys).size()
    return made.reset_index()


def line_of(points: pd.DataFrame, scheme: str, method="newton", degree=0):
    """A line's points, cheap to dear, where they stand for most of the scenes."""
    mine = (points.scheme == scheme) & (points.method == method) & (points.degree == degree)
    return select(points, mine & (points.share >= _SHARE)).sort_values("size")


def order(rows: pd.DataFrame, column: str) -> float:
    """The exponent of n by which a column goes, of rows on slices."""
    fine = select(rows, rows["size"] >= _FINE)
    fine = fine if len(fine) >= 3 else rows
    return float(np.polyfit(np.log(fine["size"]), np.log(fine[column]), 1)[0])


def reach(table: pd.DataFrame, scene: int, level: float, scheme: str = "paper") -> Reach:
    """The least slices and seconds of newton on a scheme's slices for an error below a level."""
    mine = (table.scene == scene) & (table.scheme == scheme) & (table.method == "newton")
    rows = select(table, mine & (table.limit == "") & table.error.notna()).sort_values("size")
    if len(rows) < 2:
        return Reach(np.nan, np.nan, True)
    met = select(rows, rows.error <= level)
    if len(met):
        return Reach(float(met["size"].iloc[0]), float(met.solve_s.iloc[0]), False)
    p, q = order(rows, "error"), order(rows, "solve_s")
    if p >= 0:
        return Reach(np.inf, np.inf, True)
    # From the line fitted, not from the last grid, whose error may be a lucky one.
    at = np.exp(np.mean(np.log(rows["size"]))), np.exp(np.mean(np.log(rows.error)))
    slices = max(at[0] * (level / at[1]) ** (1 / p), float(rows["size"].iloc[-1]))
    seconds = rows.solve_s.iloc[-1] * (slices / rows["size"].iloc[-1]) ** q
    return Reach(slices, float(seconds), True)
