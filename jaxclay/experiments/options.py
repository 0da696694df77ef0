"""The options of ``jaxclay compare``, ``atlas``, ``sweep``, ``report`` and ``agree``."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from jaxclay.experiments.contestants import DEFAULT
from jaxclay.experiments.peers import PEERS
from jaxclay.files.several import refusing
from jaxclay.methods import METHODS

Interrupt = Callable[[], None]
_PACKAGED = "accuracy, agreement, atlas, compare, paper, population, splines"


def add_to(commands, interrupt: Interrupt) -> None:
    """Add the subcommands; ``interrupt`` raises KeyboardInterrupt after Ctrl-C."""
    _add_compare(commands, interrupt)
    _add_atlas(commands, interrupt)
    _add_sweep(commands, interrupt)
    _add_report(commands)
    _add_agree(commands, interrupt)


def _add_compare(commands, interrupt: Interrupt) -> None:
    others = [name for name in METHODS if name not in DEFAULT]
    compare = commands.add_parser(
        "compare",
        help="methods side by side on many scenes: summary, charts, report",
        description="Run scenes x methods x slices of the paper's scheme, print a summary and "
        "write a report. Stop it at any time; the same command goes on.",
    )
    compare.add_argument("--out", type=Path, default=Path("out/compare"), help="output folder")
    compare.add_argument("--scenes", nargs="+", metavar="NAME", help="only these scenes")
    compare.add_argument(
        "--methods", nargs="+", metavar="NAME",
        help=f"only these methods (default {', '.join(DEFAULT)}; also {', '.join(others)})",
    )  # fmt: skip
    compare.add_argument(
        "--peers", nargs="*", metavar="NAME",
        help="established solvers from outside as well, and E_move alone: those named, or all of "
        f"{', '.join(PEERS)} (pip install '.[peers]')",
    )  # fmt: skip
    compare.add_argument(
        "--slices", nargs="+", type=int, metavar="N", help="grids (default 64, and 128 for some)"
    )
    compare.add_argument("--profiles", type=Path, metavar="FOLDER", help="add every CSV in FOLDER")
    _add_strict(compare)
    compare.add_argument("--quick", action="store_true", help="few scenes, 64 slices, few repeats")
    compare.add_argument(
        "--minimum-radius", type=float, metavar="R",
        help="clip a profile's pointed tips: radii below R become R",
    )  # fmt: skip
    _add_shown(compare)

    def run(options: argparse.Namespace) -> int:
        from jaxclay.experiments import command, editing

        with refusing(options.strict):
            edited = editing.comparison(
                options.scenes, options.methods, options.slices, options.profiles, options.quick,
                options.minimum_radius, options.peers,
            )  # fmt: skip
        return command.shown(edited, options.out, interrupt, options.rows, options.quiet)

    compare.set_defaults(run=run)


def _add_atlas(commands, interrupt: Interrupt) -> None:
    atlas = commands.add_parser(
        "atlas",
        help="which method solves what, and how the others fail: heat maps, summary, report",
        description="Sweep squash depth and friction, alpha and beta, the number of slices and the "
        "precision; mark what each method makes of every scene; print a summary; write heat maps "
        "and a report. Stop it at any time; the same command goes on.",
    )
    atlas.add_argument("--out", type=Path, default=Path("out/atlas"), help="output folder")
    atlas.add_argument("--methods", nargs="+", metavar="NAME", help="only these (default: all)")
    atlas.add_argument(
        "--seconds-each", type=float, metavar="S", help="time of each solve (default 0.2)"
    )
    atlas.add_argument("--quick", action="store_true", help="few scenes, up to 256 slices")
    _add_shown(atlas)

    def run(options: argparse.Namespace) -> int:
        from jaxclay.experiments import command, editing

        edited = editing.atlas(options.methods, options.seconds_each, options.quick)
        return command.shown(edited, options.out, interrupt, options.rows, options.quiet)

    atlas.set_defaults(run=run)


def _add_sweep(commands, interrupt: Interrupt) -> None:
    sweep = commands.add_parser(
        "sweep",
        help="run an experiment file: many scenes, many methods, resumable",
        description="Run what is missing of an experiment file and keep the results in a folder. "
        "Stop it at any time; the same command goes on.",
    )
    _add_common(sweep, "default out/NAME of the file")
    _add_strict(sweep)
    sweep.add_argument(
        "--backend", choices=("serial", "processes", "dask"), default="serial",
        help="where tasks are solved: here, the only one for timing, or in a process a core",
    )  # fmt: skip
    sweep.add_argument(
        "--scheduler", metavar="ADDRESS", help="of an existing dask scheduler; default: one here"
    )
    sweep.add_argument("--dry-run", action="store_true", help="say how many tasks and how long")
    _add_quiet(sweep)

    def run(options: argparse.Namespace) -> int:
        from jaxclay.experiments import command

        return command.sweep(
            options.experiment, options.out, backend=options.backend, scheduler=options.scheduler,
            profiles=options.profiles, strict=options.strict, dry_run=options.dry_run,
            quiet=options.quiet, interrupt=interrupt,
        )  # fmt: skip

    sweep.set_defaults(run=run)


def _add_report(commands) -> None:
    report = commands.add_parser(
        "report",
        help="charts and report.html of a folder of results, without solving",
        description="Draw the charts of a folder of results, and write report.html.",
    )
    report.add_argument("folder", type=Path, help="what was --out of a run")
    report.add_argument("--out", type=Path, metavar="FOLDER", help="default: the folder itself")

    def run(options: argparse.Namespace) -> int:
        from jaxclay.experiments import command

        return command.report(options.folder, options.out)

    report.set_defaults(run=run)


def _add_agree(commands, interrupt: Interrupt) -> None:
    agree = commands.add_parser(
        "agree",
        help="do greedy and gradient end in the same minimum, over an experiment's scenes?",
        description="Compare, in snake units, the certified gradient answer with that of "
        "greedy-refined, scene by scene; 1 if any disagree or none could be compared.",
    )
    _add_common(agree, "to keep results in; default: they are not kept")
    _add_strict(agree)
    agree.add_argument("--only", metavar="KEY", help="only the task of this key")

    def run(options: argparse.Namespace) -> int:
        from jaxclay.experiments import command  # first: it says which extra is missing

        with refusing(options.strict):
            return command.agree(
                options.experiment, options.out, options.profiles, options.only, interrupt
            )

    agree.set_defaults(run=run)


def _add_common(command, out: str) -> None:
    command.add_argument(
        "experiment", help=f"TOML file, or one that comes with jaxclay: {_PACKAGED}"
    )
    command.add_argument("--out", type=Path, metavar="FOLDER", help=out)
    command.add_argument(
        "--profiles", type=Path, metavar="FOLDER", help="add every CSV in FOLDER to the profiles"
    )


def _add_strict(command) -> None:
    command.add_argument(
        "--strict", action="store_true",
        help="stop at a file that is no profile, instead of naming it and leaving it out",
    )  # fmt: skip


def _add_shown(command) -> None:
    command.add_argument("--rows", action="store_true", help="print every row as well")
    _add_quiet(command)


def _add_quiet(command) -> None:
    command.add_argument("--quiet", action="store_true", help="plain lines now and then, no bar")
