"""The splines' orders, unknowns and speed against their bounds, on the random population.

  a  orders in energy and contour, degrees 3 to 5, uniform spans
  b  unknowns for a contour error of 1e-4
  c  time to a contour error against the paper's scheme, solved by newton coarse to fine
  d  one squash, spans that adapt to 1e-4, and on 8 fixed spans a side
  e  Newton's iterations
  f  the estimate of the error against the error
  g  many squashes at once on all cores

Errors are measured from answers with an estimated error of 2e-6 at most; scenes where there is
none are left out and counted.  Times are of warm calls; "compiled" is the compiled call alone,
from a clay to a judged answer (on fixed spans and slices from a posed problem).  The last table
holds every bound; the exit status is 1 if one is not met.
"""

from __future__ import annotations

import argparse
import os
import sys
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from newton_timing import Bound, table
from rich.console import Console
from spline_accuracy import estimates, orders, unknowns
from spline_batch import batched
from spline_scenes import QUICK, THOROUGH
from spline_speed import against_the_paper, iterations, one_squash
from threadpoolctl import threadpool_limits

PARTS = {
    "a": orders,
    "b": unknowns,
    "c": against_the_paper,
    "d": one_squash,
    "e": iterations,
    "f": estimates,
    "g": batched,
}


def main() -> int:
    """Run the parts asked for and print what they found."""
    arguments = parsed()
    effort = QUICK if arguments.quick else THOROUGH
    console, bounds = Console(width=arguments.width), []
    for name in arguments.only:
        begin = time.perf_counter()
        part = PARTS[name](effort)
        console.print(part.table)
        for note in part.notes:
            console.print(f"  {note}", highlight=False, soft_wrap=True, style="dim")
        console.print(f"  {time.perf_counter() - begin:.0f} s\n", style="dim", highlight=False)
        bounds += part.bounds
    console.print(as_table(bounds))
    return 1 if not all(bound.met for bound in bounds) else 0


def as_table(bounds: list[Bound]):
    """A line a bound."""
    found = table("Bounds", "what", "measured", "bound", "met")
    for bound in bounds:
        met = "yes" if bound.met else "[red]no[/red]"
        found.add_row(bound.what, bound.measured, bound.wanted, met)
    return found


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", default=",".join(PARTS), help="parts, such as a,c")
    parser.add_argument("--quick", action="store_true", help="few scenes, short repeats")
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
