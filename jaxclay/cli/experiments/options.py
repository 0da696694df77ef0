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
_GOES_ON = "Stop it at any time; the same command goes on."
_PACKAGED = "accuracy, agreement, atlas, compare, paper, population, splines"


def add_to(commands, interrupt: Interrupt) -> None:
    """Add the subcommands; ``interrupt`` raises KeyboardInterrupt after Ctrl-C."""

    def add(name: str, summary: str, more: str = "") -> argparse.ArgumentParser:
        about = f"{summary[0].upper()}{summary[1:]}. {more}".strip()
        command = commands.add_parser(name, help=summary, description=about)
        command.set_defaults(run=lambda options: _run(name, options, interrupt))
        return command

    others = [name for name in METHODS if name not in DEFAULT]
    compare = add("compare", "methods side by side on many scenes: summary and report", _GOES_ON)
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
    compare.add_argument("--quick", action="store_true", help="few scenes, 64 slices, few repeats")
    compare.add_argument(
        "--minimum-radius", type=float, metavar="R",
        help="clip a profile's pointed tips: radii below R become R",
    )  # fmt: skip
    atlas = add(
        "atlas",
        "which method solves what, and how the others fail: heat maps, summary, report",
        "Squash depth and friction, alpha and beta, the number of slices and the precision are "
        f"swept. {_GOES_ON}",
    )
    atlas.add_argument("--methods", nargs="+", metavar="NAME", help="only these (default: all)")
    atlas.add_argument(
        "--seconds-each", type=float, metavar="S", help="time of each solve (default 0.2)"
    )
    atlas.add_argument("--quick", action="store_true", help="few scenes, up to 256 slices")
    sweep = add("sweep", "run an experiment file: many scenes, many methods, resumable", _GOES_ON)
    sweep.add_argument(
        "--backend", choices=("serial", "processes", "dask"), default="serial",
        help="where tasks are solved: here, the only one for timing, or in a process a core",
    )  # fmt: skip
    sweep.add_argument(
        "--scheduler", metavar="ADDRESS", help="of an existing dask scheduler; default: one here"
    )
    sweep.add_argument("--dry-run", action="store_true", help="say how many tasks and how long")
    report = add("report", "charts and report.html of a folder of results, without solving")
    report.add_argument("folder", type=Path, help="what was --out of a run")
    agree = add(
        "agree",
        "do greedy and gradient end in the same minimum, over an experiment's scenes?",
        "In snake units; 1 if any disagree or none could be compared. Given a folder of results, "
        "those are judged and nothing is solved.",
    )
    agree.add_argument("--only", metavar="KEY", help="only the task of this key")

    folders = {
        compare: "default out/compare", atlas: "default out/atlas",
        sweep: "default out/NAME of the file", report: "default: the folder itself",
        agree: "default out/NAME of the file",
    }  # fmt: skip
    for command, default in folders.items():
        command.add_argument("--out", type=Path, metavar="FOLDER", help=default)
    for command in (compare, sweep, agree):
        command.add_argument(
            "--profiles", type=Path, metavar="FOLDER", help="add every CSV in FOLDER"
        )
        command.add_argument(
            "--strict", action="store_true",
            help="stop at a file that is no profile, instead of naming it and leaving it out",
        )  # fmt: skip
    for command in (sweep, agree):
        command.add_argument(
            "experiment", help=f"a TOML file, or one that comes with jaxclay: {_PACKAGED}"
        )
    for command in (compare, atlas):
        command.add_argument("--rows", action="store_true", help="print every row as well")
    for command in (compare, atlas, sweep):
        command.add_argument("--quiet", action="store_true", help="plain lines, no bar")


def _run(name: str, options: argparse.Namespace, interrupt: Interrupt) -> int:
    from jaxclay.cli.experiments import command  # first: it says which extra is missing

    with refusing(getattr(options, "strict", False)):
        if name == "agree":
            from jaxclay.cli.experiments.agree import agree

            return agree(options, interrupt)
        return getattr(command, name)(options, interrupt)
