"""Benchmarks in parts: figures, the bounds that they are held against, and the command line."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from rich.console import Console
from rich.markup import escape
from rich.table import Table
from threadpoolctl import threadpool_limits


class Bound(NamedTuple):
    """A figure and what it must not miss."""

    what: str
    wanted: str
    measured: str
    met: bool


def at_most(what: str, value: Any, most: float, form: str = "{:.3g}", unit: str = "") -> Bound:
    """The bound of a figure that may not be larger."""
    return Bound(what, f"<= {form.format(most)}{unit}", form.format(value), bool(value <= most))


def at_least(what: str, value: Any, least: float, form: str = "{:.3g}", unit: str = "") -> Bound:
    """The bound of a figure that may not be smaller."""
    return Bound(what, f">= {form.format(least)}{unit}", form.format(value), bool(value >= least))


class Part(NamedTuple):
    """What a part of a benchmark found out."""

    table: Table
    bounds: list[Bound]
    notes: list[str]


def table(title: str, *columns: str) -> Table:
    """Empty; the first column is text, the others are figures."""
    style = {"box": None, "title_justify": "left", "min_width": len(title) + 2}
    made = Table(*columns[:1], title=escape(title), **style)
    for name in columns[1:]:
        made.add_column(name, justify="right")
    return made


def verdict(console: Console, bounds: list[Bound]) -> int:
    """Print a line a bound; the exit status, 1 if one is not met."""
    found = table("Bounds", "what", "wanted", "measured", "met")
    for bound in bounds:
        met = "yes" if bound.met else "[red]no[/red]"
        found.add_row(bound.what, bound.wanted, bound.measured, met)
    console.print(found)
    return 0 if all(bound.met for bound in bounds) else 1


def run(
    parts: dict[str, Callable[[Any], Part]],
    quick: Any,
    thorough: Any,
    about: str,
    counts: Sequence[str] = (),
) -> int:
    """Run the parts named on the command line, print what they found, return the exit status.

    ``counts`` are fields of the efforts that have an option each.
    """
    arguments = _parsed(list(parts), about, counts)
    effort = quick if arguments.quick else thorough
    given = {name: getattr(arguments, name) for name in counts}
    given = {name: value for name, value in given.items() if value is not None}
    effort = effort._replace(**given) if given else effort
    console, bounds, seen = Console(width=arguments.width), [], set()
    with threadpool_limits(1):
        for name in arguments.only:
            begin = time.perf_counter()
            part = parts[name](effort)
            console.print(part.table)
            for note in (note for note in part.notes if note not in seen):
                console.print(f"  {note}", highlight=False, soft_wrap=True, style="dim")
            seen |= set(part.notes)
            console.print(f"  {time.perf_counter() - begin:.0f} s\n", style="dim", highlight=False)
            bounds += part.bounds
    return verdict(console, bounds)


def _parsed(names: list[str], about: str, counts: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=about, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default=",".join(names), help="parts, such as a,c")
    parser.add_argument("--quick", action="store_true", help="few and small scenes, few repeats")
    parser.add_argument("--width", type=int, default=160, help="columns of the tables")
    for name in counts:
        parser.add_argument(f"--{name}", type=int, metavar="N", help="how many")
    arguments = parser.parse_args()
    arguments.only = arguments.only.split(",")
    for name in arguments.only:
        if name not in names:
            parser.error(f"there is no part {name!r}: choose from {', '.join(names)}")
    return arguments
