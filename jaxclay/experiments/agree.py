"""``jaxclay agree``: whether greedy and gradient end in the same minimum, over a population.

In snake units, where greedy is at home, scheme by scheme.  Compared are the certified minimum
of the gradient method ``newton`` and the answer of ``greedy-refined``, where greedy stopped by
its own rule.
"""

from __future__ import annotations

import dataclasses
import shlex
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from jaxclay.experiments.command import carry_out, words
from jaxclay.experiments.engine import tasks_of
from jaxclay.experiments.entries.reading import of_file, raw_experiment
from jaxclay.experiments.entries.tables import AgreeTable, Experiment
from jaxclay.experiments.entries.tasks import Task
from jaxclay.experiments.progress import Interrupt, say
from jaxclay.experiments.results import groups, records, select, table

METHOD = "greedy-refined"
_SCHEMES = {
    ("paper", ""): "the paper's scheme",
    ("slices", "equal"): "second-order slices, equal on each side of the band",
    ("slices", "placed"): "second-order slices, placed where the contour bends",
}
_OWN_RULE = ("stalled", "converged")  # it stopped because no move gained, not at a limit
_NO_PAIR = "no pair was compared: that is no agreement"


class Agreement(NamedTuple):
    """What a comparison found."""

    compared: pd.DataFrame  # rows that stopped by greedy's rule beside a certified minimum
    offenders: pd.DataFrame  # those further from the minimum than allowed
    left_out: dict[str, int]  # why other rows were not compared, and how many

    @property
    def holds(self) -> bool:
        """Whether something was compared and nothing disagrees."""
        return not self.compared.empty and self.offenders.empty


def agree(options: Namespace, interrupt: Interrupt) -> int:
    """Compare over an experiment's scenes, or over the results of a folder, and say what is found.

    Returns 0 where all pairs agree, 1 where one does not or there is none, 130 if interrupted.

    Raises ValueError: What is wrong in the file, in which line; no task of the key that is asked
    for.
    """
    experiment, only, profiles = options.experiment, options.only, options.profiles
    command = words(options, options.out, ("profiles", "strict"))
    if Path(experiment).is_dir():
        if options.out or profiles:
            raise ValueError(f"{experiment} is a folder of results: leave --out and --profiles out")
        kept = list((Path(experiment) / "experiments").glob("*.toml"))
        rows = table(experiment)
        # Those of the experiment that the folder is of, if it is of one.
        limits = AgreeTable(**raw_experiment(kept[0]).get("agree", {}) if len(kept) == 1 else {})
    else:
        folder = options.out or Path("out") / Path(experiment).stem
        edited = of_file(experiment, profiles)
        limits = edited.experiment.agree
        every = [task for task in _tasks(edited.experiment) if only in (None, task.key)]
        code = carry_out(edited, every, folder, shlex.join(command), interrupt)
        if code or not every:
            return code or _nothing(only, experiment)
        rows = table(folder)
        rows = select(rows, rows.key.isin([task.key for task in every]))
    rows = select(rows, (rows.method == METHOD) & (rows.units == "snake") & (rows.budget == 0))
    rows = select(rows, (rows.scheme != "spline") & (rows.precision == "float64"))
    rows = rows if only is None else select(rows, rows.key == only)
    if rows.empty:
        return _nothing(only, experiment)
    holds = True
    for way, mine in groups(rows, ["scheme", "spacing"]):
        found = agreement(mine, limits)
        say(f"{_SCHEMES[way]}:", *_said(found, limits, command))
        holds &= found.holds
    return 0 if holds else 1


def _tasks(whole: Experiment) -> list[Task]:
    """The tasks of ``greedy-refined`` in snake units alone, untimed."""
    plain: dict[str, Any] = {"kind": "throughput", "stops": (), "repeats": 1, "call": "minimize",
                             "budget": 0.0, "first": False, "precision": "float64"}  # fmt: skip
    found = [task for task in tasks_of(whole) if task.method == METHOD]
    if not found:
        raise ValueError(f'agreement is of greedy-refined: add [[methods]] name = "{METHOD}"')
    once = {t.key: t for t in (dataclasses.replace(task, **plain) for task in found)}
    return [task for task in once.values() if task.specification.units == "snake"]


def _nothing(only: str | None, experiment: str) -> int:
    if only is not None:
        raise ValueError(f"no task in snake units with the key {only!r} in {experiment}")
    say(_NO_PAIR)
    return 1


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


def _said(found: Agreement, limits: AgreeTable, command: list[str]) -> Iterator[str]:
    """The verdict, line by line."""
    yield (
        f"{len(found.compared)} pairs compared: energy within {limits.energy:g} of E_free, contour "
        f"within {limits.contour:g} of the height"
    )
    for reason, count in found.left_out.items():
        yield f"{count} left out: {reason}"
    if found.compared.empty:
        yield _NO_PAIR
        return
    gap, contour = found.compared.gap_relative.abs().max(), found.compared.contour_error.max()
    yield f"largest energy gap {gap:.1e}, largest contour error {contour:.1e}"
    for row in records(found.offenders):
        yield (
            f"disagrees: {row.task}: energy gap {row.gap_relative:.1e}, contour error "
            f"{row.contour_error:.1e}; again with\n  {shlex.join([*command, '--only', row.key])}"
        )
    yield "all agree" if found.holds else f"{len(found.offenders)} disagree"
