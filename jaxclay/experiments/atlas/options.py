"""The options of ``jaxclay atlas``."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path


def add_to(commands, interrupt: Callable[[], None]) -> None:
    """Add the subcommand; ``interrupt`` raises KeyboardInterrupt after Ctrl-C."""
    atlas = commands.add_parser(
        "atlas",
        help="which method solves what, and how the others fail: heat maps, table, report",
        description="Sweep squash depth and friction, alpha and beta, the number of slices and the "
        "precision; mark what each method makes of every scene; print a table; write results, "
        "heat maps and a report.",
    )
    atlas.add_argument("--out", type=Path, default=Path("out/atlas"), help="output folder")
    atlas.add_argument("--methods", nargs="+", metavar="NAME", help="only these (default: all)")
    atlas.add_argument(
        "--seconds-each", type=float, metavar="S", help="time of each solve (default 0.2)"
    )
    atlas.add_argument("--quick", action="store_true", help="few scenes, up to 256 slices")

    def run(options: argparse.Namespace) -> int:
        from jaxclay.experiments.atlas import command

        seconds = command.SECONDS if options.seconds_each is None else options.seconds_each
        return command.atlas(options.out, options.methods, seconds, options.quick, interrupt)

    atlas.set_defaults(run=run)
