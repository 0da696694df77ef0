"""Newton's speed and sureness against its bounds, every ratio taken side by side in this run.

  a  compiled newton, and the whole minimize call, against IPOPT
  b  newton in units of one banded solve by SciPy
  c  dragging a tool: median, 99th percentile, compilations
  d  time per slice of large pieces
  e  a squash of little reach in a window and as a whole
  f  iterations on each grid, coarse to fine
  g  the random population
  h  first calls in a fresh process, with and without a cache on disk

Medians, with least and most in brackets; compiling is never timed but in part h.  One thread for
BLAS.  The last table holds every bound; the exit status is 1 if one is not met.
"""

from __future__ import annotations

import argparse
import os
import sys
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # CasADi brings a BLAS of its own

from newton_solves import against_ipopt, by_level, in_banded_solves
from newton_timing import Bound, Effort, table
from newton_uses import by_size, drag, first_calls, in_a_window, over_population
from rich.console import Console
from threadpoolctl import threadpool_limits

PARTS = {
    "a": against_ipopt,
    "b": in_banded_solves,
    "c": drag,
    "d": by_size,
    "e": in_a_window,
    "f": by_level,
    "g": over_population,
    "h": first_calls,
}
THOROUGH = Effort((64, 256, 1024, 4096), (4096, 65536), 0.5, 1000, 3)
QUICK = Effort((64, 256), (512, 1024), 0.1, 100, 1)


def main() -> int:
    """Run the parts asked for and print what they found."""
    arguments = parsed()
    console, bounds, seen = Console(width=arguments.width), [], set()
    for name in arguments.only:
        begin = time.perf_counter()
        part = PARTS[name](QUICK if arguments.quick else THOROUGH)
        console.print(part.table)
        for note in (note for note in part.notes if note not in seen):
            console.print(f"  {note}", highlight=False, soft_wrap=True, style="dim")
        seen |= set(part.notes)
        console.print(f"  {time.perf_counter() - begin:.0f} s\n", style="dim", highlight=False)
        bounds += part.bounds
    console.print(as_table(bounds))
    return 1 if not all(bound.met for bound in bounds) else 0


def as_table(bounds: list[Bound]):
    """A line a bound."""
    found = table("Bounds", "what", "wanted", "measured", "met")
    for bound in bounds:
        met = "yes" if bound.met else "[red]no[/red]"
        found.add_row(bound.what, bound.wanted, bound.measured, met)
    return found


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default=",".join(PARTS), help="parts, such as a,c")
    parser.add_argument("--quick", action="store_true", help="small grids, few scenes and repeats")
    parser.add_argument("--width", type=int, default=160, help="columns of the tables")
    arguments = parser.parse_args()
    arguments.only = arguments.only.split(",")
    for name in arguments.only:
        if name not in PARTS:
            parser.error(f"there is no part {name!r}: choose from {', '.join(PARTS)}")
    return arguments


if __name__ == "__main__":
    with threadpool_limits(1):
        sys.exit(main())
