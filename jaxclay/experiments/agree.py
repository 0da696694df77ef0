"""Whether greedy and gradient end in the same minimum, over a population.

In snake units, where greedy is at home, scheme by scheme.  Compared are the certified minimum
of the gradient method ``newton`` and the answer of ``greedy-refined``, where greedy stopped by
its own rule.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import pandas as pd

from jaxclay.experiments.engine import tasks_of
from jaxclay.experiments.entries.tables import AgreeTable, Experiment
from jaxclay.experiments.entries.tasks import Task
from jaxclay.experiments.results import select

METHOD = "greedy-refined"
_OWN_RULE = ("stalled", "converged")  # it stopped because no move gained, not at a limit


class Agreement(NamedTuple):
    """What a comparison found."""

    compared: pd.DataFrame  # rows that stopped by greedy's rule beside a certified minimum
    offenders: pd.DataFrame  # those further from the minimum than allowed
    left_out: dict[str, int]  # why other rows were not compared, and how many

    @property
    def holds(self) -> bool:
        """Whether something was compared and nothing disagrees."""
        return not self.compared.empty and self.offenders.empty


def tasks(whole: Experiment) -> list[Task]:
    """The tasks of ``greedy-refined`` in snake units alone, untimed."""
    plain: dict[str, Any] = {"kind": "throughput", "stops": (), "repeats": 1, "call": "minimize",
                             "budget": 0.0, "first": False, "precision": "float64"}  # fmt: skip
    found = [task for task in tasks_of(whole) if task.method == METHOD]
    if not found:
        raise ValueError(f'agreement is of greedy-refined: add [[methods]] name = "{METHOD}"')
    once = {t.key: t for t in (dataclasses.replace(task, **plain) for task in found)}
    return [task for task in once.values() if task.specification.units == "snake"]


def comparable(rows: pd.DataFrame, only: str | None = None) -> pd.DataFrame:
    """Those rows of a folder that :func:`agreement` may compare, of one key if asked."""
    rows = select(rows, (rows.method == METHOD) & (rows.units == "snake") & (rows.budget == 0))
    rows = select(rows, (rows.scheme != "spline") & (rows.precision == "float64"))
    return rows if only is None else select(rows, rows.key == only)


def agreement(rows: pd.DataFrame, limits: AgreeTable) -> Agreement:
    """Compare rows of ``greedy-refined`` by their distance to the certified minimum."""
    certified, own = rows.energy_minimum.notna(), rows.status.isin(_OWN_RULE)
    compared = select(rows, certified & own)
    # Below the certified minimum counts too: then it is not the same one.  So does no number.
    near = compared.gap_relative.abs() <= limits.energy
    far = ~(near & (compared.contour_error <= limits.contour))
    reasons = {
        "cannot be posed": rows.status == "skipped",
        "no certified minimum": (rows.status != "skipped") & ~certified,
        "greedy did not stop by its own rule": certified & ~own,
    }
    left_out = {reason: int(mask.sum()) for reason, mask in reasons.items() if mask.any()}
    return Agreement(compared, select(compared, far), left_out)
