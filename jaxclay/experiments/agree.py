"""``jaxclay agree``: whether greedy and gradient end in the same minimum, over a population.

In snake units, where greedy is at home, scheme by scheme.  Compared are the certified minimum
of the gradient method ``newton`` and the answer of ``greedy-refined``, where greedy stopped by
its own rule.
"""

from __future__ import annotations

import dataclasses
import shlex
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from jaxclay.experiments.editing import of_file
from jaxclay.experiments.engine import run_tasks, threads_of
from jaxclay.experiments.entries.tables import AgreeTable, Experiment
from jaxclay.experiments.entries.tasks import Task, tasks
from jaxclay.experiments.frames import number, records, select
from jaxclay.experiments.progress import INTERRUPTED, plain_console, watched
from jaxclay.experiments.results import table
from jaxclay.experiments.store import keep_experiment
from jaxclay.files.output import check_folder

METHOD = "greedy-refined"
_SCHEMES = {
    ("paper", ""): "the paper's scheme",
    ("slices", "equal"): "second-order slices, equal on each side of the band",
    ("slices", "placed"): "second-order slices, placed where the contour bends",
}
_OWN_RULE = ("stalled", "converged")  # it stopped because no move gained, not at a limit


@dataclasses.dataclass(frozen=True)
class Agreement:
    """What a comparison found.

    Attributes
    ----------
    compared : DataFrame
        The rows of ``greedy-refined`` that stopped by its own rule beside a certified minimum.
    offenders : DataFrame
        Those whose energy or contour is further from the minimum than allowed.
    left_out : dict
        Why other rows were not compared, and how many.
    """

    compared: pd.DataFrame
    offenders: pd.DataFrame
    left_out: dict[str, int]

    @property
    def holds(self) -> bool:
        """Whether something was compared and nothing disagrees."""
        return not self.compared.empty and self.offenders.empty


def agree(
    experiment: str | Path,
    out: str | Path | None = None,
    profiles: str | Path | None = None,
    only: str | None = None,
    interrupt: Callable[[], None] = lambda: None,
) -> int:
    """Compare over an experiment's scenes and say what was found.

    ``only`` is the key of one task.  Results are kept in ``out``, if given, and not made twice.

    Returns 0 where all pairs agree, 1 where one does not or there is none, 130 if interrupted.

    Raises
    ------
    ValueError
        What is wrong in the file, in which line; no task of that key.
    """
    edited = of_file(experiment, profiles)
    limits = edited.experiment.agree
    todo = [task for task in _greedy_only(edited.experiment) if only in (None, task.key)]
    if only is not None and not todo:
        raise ValueError(f"no task in snake units with the key {only!r} in {experiment}")
    console = plain_console(soft_wrap=True, highlight=False)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary if out is None else out)
        check_folder(folder)
        keep_experiment(folder, edited.name, edited.text)
        try:
            with watched("agreement", len(todo), 0, interrupt) as callback:
                run_tasks(todo, folder, callback=callback)
        except KeyboardInterrupt:
            kept = "" if out is None else f" what had ended is kept in {out}, and"
            again = shlex.join(["jaxclay", *sys.argv[1:]])
            console.print(
                f"interrupted:{kept} nothing is said about agreement; again with\n  {again}"
            )
            return INTERRUPTED
        rows = table(folder) if todo else pd.DataFrame(columns=["key"])
    rows = select(rows, rows.key.isin([task.key for task in todo]))
    holds = True
    sizes = (task.discretisation for task in todo)
    for scheme, spacing in dict.fromkeys((d.scheme, d.spacing) for d in sizes) or (("paper", ""),):
        mine = rows
        if len(rows):
            mine = select(rows, (rows.scheme == scheme) & (rows.spacing == spacing))
        found = agreement(mine, limits) if len(mine) else _nothing()
        console.print(f"{_SCHEMES[scheme, spacing]}:")
        for line in _said(found, limits, experiment, profiles):
            console.print(line)
        holds &= found.holds
    return 0 if holds else 1


def _greedy_only(whole: Experiment) -> list[Task]:
    """The tasks of ``greedy-refined`` in snake units alone, untimed."""
    plain = {"kind": "throughput", "stops": (), "repeats": 1, "call": "minimize", "budget": 0.0,
             "first": False, "precision": "float64"}  # fmt: skip
    found = [task for task in tasks(whole, threads_of("serial")) if task.method == METHOD]
    if not found:
        raise ValueError(f'agreement is of greedy-refined: add [[methods]] name = "{METHOD}"')
    once = {t.key: t for t in (dataclasses.replace(task, **plain) for task in found)}
    return [task for task in once.values() if task.specification.units == "snake"]


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


def _nothing() -> Agreement:
    empty = pd.DataFrame(columns=["gap_relative", "contour_error"])
    return Agreement(empty, empty, {})


def _said(found: Agreement, limits: AgreeTable, experiment, profiles):
    """The verdict, line by line."""
    yield (
        f"{len(found.compared)} pairs compared: energy within {limits.energy:g} of E_free, contour "
        f"within {limits.contour:g} of the height"
    )
    for reason, count in found.left_out.items():
        yield f"{count} left out: {reason}"
    if found.compared.empty:
        yield "no pair was compared: that is no agreement"
        return
    yield (
        f"largest energy gap {number(found.compared.gap_relative.abs().max(), '.1e', '')}, "
        f"largest contour error {number(found.compared.contour_error.max(), '.1e', '')}"
    )
    for row in records(found.offenders):
        yield (
            f"disagrees: {row.task}: energy gap {row.gap_relative:.1e}, contour error "
            f"{row.contour_error:.1e}; again with\n  {_command(experiment, profiles, row.key)}"
        )
    yield "all agree" if found.holds else f"{len(found.offenders)} disagree"


def _command(experiment: Any, profiles: Any, key: str) -> str:
    words = ["jaxclay", "agree", str(experiment)]
    words += ["--profiles", str(profiles)] if profiles else []
    return shlex.join([*words, "--only", key])
