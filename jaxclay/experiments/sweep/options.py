"""The options of ``jaxclay sweep``, ``jaxclay report`` and ``jaxclay agree``."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

Interrupt = Callable[[], None]


def add_to(commands, interrupt: Interrupt) -> None:
    """Add the subcommands; ``interrupt`` raises KeyboardInterrupt after Ctrl-C."""
    _add_sweep(commands, interrupt)
    _add_report(commands)
    _add_agree(commands, interrupt)


def _add_sweep(commands, interrupt: Interrupt) -> None:
    sweep = commands.add_parser(
        "sweep",
        help="run an experiment file: many scenes, many methods, resumable",
        description="Run what is missing of an experiment file and keep the results in a folder. "
        "Stop it at any time; the same command goes on.",
    )
    _add_common(sweep, "default out/NAME of the file")
    sweep.add_argument(
        "--backend", choices=("serial", "processes", "dask"), default="serial",
        help="where tasks are solved (default serial, the only one for timing)",
    )  # fmt: skip
    sweep.add_argument(
        "--scheduler", metavar="ADDRESS", help="of an existing dask scheduler; default: one here"
    )
    sweep.add_argument("--dry-run", action="store_true", help="say how many tasks and how long")
    sweep.add_argument("--quiet", action="store_true", help="plain lines now and then, no bar")

    def run(options: argparse.Namespace) -> int:
        from jaxclay.experiments.sweep import command

        return command.sweep(
            options.experiment, options.out, backend=options.backend, scheduler=options.scheduler,
            profiles=options.profiles, dry_run=options.dry_run, quiet=options.quiet,
            interrupt=interrupt,
        )  # fmt: skip

    sweep.set_defaults(run=run)


def _add_report(commands) -> None:
    report = commands.add_parser(
        "report",
        help="charts and report.html of a sweep's folder, without solving",
        description="Draw the charts of a folder that jaxclay sweep filled, and write report.html.",
    )
    report.add_argument("folder", type=Path, help="what was --out of jaxclay sweep")

    def run(options: argparse.Namespace) -> int:
        from jaxclay.experiments.sweep import command

        return command.report(options.folder)

    report.set_defaults(run=run)


def _add_agree(commands, interrupt: Interrupt) -> None:
    agree = commands.add_parser(
        "agree",
        help="do greedy and gradient end in the same minimum, over an experiment's scenes?",
        description="Compare, in snake units, the certified gradient answer with that of "
        "greedy-refined, scene by scene; 1 if any disagree or none could be compared.",
    )
    _add_common(agree, "to keep results in; default: they are not kept")
    agree.add_argument("--only", metavar="KEY", help="only the task of this key")

    def run(options: argparse.Namespace) -> int:
        from jaxclay.experiments.sweep import command  # first: it says which extra is missing

        return command.agree(
            options.experiment, options.out, options.profiles, options.only, interrupt
        )

    agree.set_defaults(run=run)


def _add_common(command, out: str) -> None:
    command.add_argument(
        "experiment",
        help="TOML file, or one that comes with jaxclay: paper, population, splines, agreement",
    )
    command.add_argument("--out", type=Path, metavar="FOLDER", help=out)
    command.add_argument(
        "--profiles", type=Path, metavar="FOLDER", help="add every CSV in FOLDER to the profiles"
    )
