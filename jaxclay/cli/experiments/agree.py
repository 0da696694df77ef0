"""``jaxclay agree``: whether greedy and gradient end in the same minimum, told and as exit code."""

from __future__ import annotations

import shlex
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path

from jaxclay.cli.experiments.command import carry_out, words
from jaxclay.cli.experiments.progress import Interrupt, say
from jaxclay.experiments.agree import Agreement, agreement, comparable, tasks
from jaxclay.experiments.entries.reading import of_file, raw_experiment
from jaxclay.experiments.entries.tables import AgreeTable
from jaxclay.experiments.results import groups, records, select, table

_SCHEMES = {
    ("paper", ""): "the paper's scheme",
    ("slices", "equal"): "second-order slices, equal on each side of the band",
    ("slices", "placed"): "second-order slices, placed where the contour bends",
}
_NO_PAIR = "no pair was compared: that is no agreement"


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
        every = [task for task in tasks(edited.experiment) if only in (None, task.key)]
        code = carry_out(edited, every, folder, shlex.join(command), interrupt)
        if code or not every:
            return code or _nothing(only, experiment)
        rows = table(folder)
        rows = select(rows, rows.key.isin([task.key for task in every]))
    rows = comparable(rows, only)
    if rows.empty:
        return _nothing(only, experiment)
    holds = True
    for way, mine in groups(rows, ["scheme", "spacing"]):
        found = agreement(mine, limits)
        say(f"{_SCHEMES[way]}:", *_said(found, limits, command))
        holds &= found.holds
    return 0 if holds else 1


def _nothing(only: str | None, experiment: str) -> int:
    if only is not None:
        raise ValueError(f"no task in snake units with the key {only!r} in {experiment}")
    say(_NO_PAIR)
    return 1


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
