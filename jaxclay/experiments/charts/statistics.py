"""Figures that sum a population up: quantiles, shifted means, profiles, exponents."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from jaxclay.experiments.frames import groups, select

LOW, HIGH = 0.1, 0.9  # the band around a median
# Seconds added before a geometric mean, and taken off after: about the quickest method's time.
SHIFT = 1e-4


class Ladder(NamedTuple):
    """Median time and the band of the errors for each rung of a method's ladder, (r,) each."""

    seconds: np.ndarray
    low: np.ndarray
    median: np.ndarray
    high: np.ndarray


def ladder(rows: pd.DataFrame, error: str, by: list[str]) -> Ladder:
    """The rungs from the largest median error down, one for each value of the columns ``by``."""
    rungs = [
        (group.solve_s.median(), *(group[error].abs().quantile(q) for q in (LOW, 0.5, HIGH)))
        for _, group in groups(select(rows, rows[error].notna()), by)
    ]
    rungs.sort(key=lambda rung: (-rung[2], rung[0]))
    return Ladder(*np.array(rungs).reshape(-1, 4).T)


def best_settings(rows: pd.DataFrame, error: str, by: list[str]) -> pd.DataFrame:
    """The rows of the setting with the least median error, for each value of the columns ``by``."""
    medians = rows.groupby([*by, "settings"])[error].agg(lambda e: e.abs().median())
    best = medians.reset_index().sort_values(error).drop_duplicates(subset=by)
    return rows.merge(best[[*by, "settings"]], on=[*by, "settings"])


def shifted_geometric_mean(seconds: Any, shift: float = SHIFT) -> float:
    """exp(mean(log(t + shift))) - shift: outliers on either side weigh little."""
    seconds = np.asarray(seconds, float)
    seconds = seconds[np.isfinite(seconds)]
    if not seconds.size:
        return float("nan")
    return float(np.exp(np.mean(np.log(seconds + shift))) - shift)


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
        shares = np.searchsorted(factors, steps, side="right") / len(ratio)
        curves[str(name)] = steps, shares
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
