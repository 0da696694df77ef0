"""Figures that sum a population up: quantiles, performance profiles, exponents."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from jaxclay.experiments.frames import select

LOW, HIGH = 0.1, 0.9  # the band around a median


def bands(rows: pd.DataFrame, by: list[str], column: str, **others: Any) -> pd.DataFrame:
    """Columns low, middle and high of a column's size, and ``others``, a row for each group."""
    sized = select(rows, rows[column].notna()).assign(sized=lambda kept: kept[column].abs())
    return sized.groupby(by, dropna=False).agg(
        low=("sized", lambda values: values.quantile(LOW)),
        middle=("sized", "median"),
        high=("sized", lambda values: values.quantile(HIGH)),
        **others,
    )


def ladder(rows: pd.DataFrame, error: str, by: list[str]) -> pd.DataFrame:
    """Seconds and the band of the errors for each value of ``by``, from the largest error down."""
    rungs = bands(rows, by, error, solve_s=("solve_s", "median"))
    order = rungs.sort_values(["middle", "solve_s"], ascending=[False, True])
    return order.reset_index()


def best_settings(rows: pd.DataFrame, error: str, by: list[str]) -> pd.DataFrame:
    """The rows of the setting with the least median error, for each value of the columns ``by``."""
    medians = bands(rows, [*by, "settings"], error).reset_index()
    best = medians.sort_values("middle").drop_duplicates(subset=by)
    return rows.merge(best[[*by, "settings"]], on=[*by, "settings"])


def performance_profile(seconds: pd.DataFrame) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The share of problems that a solver solves within a factor of the quickest's time.

    After E. Dolan and J. More, Mathematical Programming 91, 2002.

    Parameters
    ----------
    seconds : DataFrame
        A row for each problem, a column for each solver; NaN where it did not solve it.

    Returns
    -------
    dict
        For each solver the factors at which its share rises, in order, and the shares from there
        on, both beginning at a factor of 1.
    """
    ratio = seconds.div(seconds.min(axis=1), axis=0)
    curves = {}
    for name in ratio:
        factors = np.sort(ratio[name].dropna().to_numpy())
        steps = np.unique(np.append(1.0, factors))
        curves[str(name)] = steps, np.searchsorted(factors, steps, side="right") / len(ratio)
    return curves


def times_to_solve(rows: pd.DataFrame, error: str, within: float, problem: str) -> pd.DataFrame:
    """Seconds of each family's quickest run whose error is ``within``, a row for each problem.

    ``problem`` names the column that tells problems apart; those that nobody solves are there.
    """
    solved = rows.assign(solve_s=rows.solve_s.where(rows[error].abs() <= within))
    return solved.groupby([problem, "family"]).solve_s.min().unstack("family")


def exponent(slices: Any, seconds: Any) -> float:
    """p of the line through the logarithms, seconds = c slices^p; not a number from one grid."""
    if len(np.unique(slices)) < 2:
        return float("nan")
    return float(np.polyfit(np.log(slices), np.log(seconds), 1)[0])
