"""Speed against accuracy on random scenes: the packaged experiment, its medians and the picture.

Goes on where it was stopped; ``jaxclay report`` draws its other charts.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

from rich.console import Console
from rich.table import Table

import jaxclay
from jaxclay.cli.experiments.command import carry_out
from jaxclay.cli.experiments.editing import edited as edited_experiment
from jaxclay.experiments import load
from jaxclay.experiments.charts.population import GOOD, points, speed_and_accuracy
from jaxclay.experiments.charts.shared import prepared
from jaxclay.experiments.engine import tasks_of
from jaxclay.experiments.entries.reading import Edited, raw_experiment
from jaxclay.experiments.results import number, records
from jaxclay.files.output import patient_output
from jaxclay.numerics.checks import check_positive


def main() -> int:
    """Run what is missing, write the picture, print a line a point of it."""
    asked = parsed()
    jaxclay.keep_compilations()
    if not asked.draw:
        edited = experiment(asked.scenes, asked.seed, asked.quick)
        again = " ".join(["scripts/bench accuracy", *sys.argv[1:]])
        every = tasks_of(edited.experiment)
        code = carry_out(edited, every, asked.out, again, lambda: None)
        if code:
            return code
    rows = prepared(load(asked.out))
    known = points(rows)
    speed_and_accuracy(known).savefig(asked.out / "speed-and-accuracy.png", dpi=160)
    view = Table(title="speed and accuracy, medians over scenes", box=None, pad_edge=False)
    view.add_column("way")
    for name in ("size", "scenes", "error", "10%", "90%", "unknowns", "call ms", "first s"):
        view.add_column(name, justify="right")
    for point in records(known):
        degree = f" degree {point.degree}" if point.degree else ""
        errors = (f"{value:.1e}" for value in (point.error, point.low, point.high))
        times = number(point.solve_s * 1e3, ".3g"), number(point.first_s, ".2g")
        size, unknowns = f"{point.size_of:g}", f"{point.unknowns:.0f}"
        way = f"{point.line} {point.method}{degree}"
        view.add_row(way, size, f"{point.scenes}", *errors, unknowns, *times)
    dropped = rows[~(rows.continuum_error <= GOOD)].specification.nunique()
    with patient_output():
        console = Console(width=None if Console().is_terminal else 150)
        console.print(view)
        console.print(f"left out, as no answer is good enough to measure from: {dropped} scenes")
    return 0


def experiment(scenes: int | None = None, seed: int = 0, quick: bool = False) -> Edited:
    """The packaged experiment or its quick part, on about so many random scenes."""
    name = "accuracy-quick" if quick else "accuracy"
    raw = raw_experiment(name)
    raw["seed"] = seed
    if scenes is not None:
        check_positive("scenes", scenes)
        whole = sum(table["draws"] for table in raw["scenes"])
        for table in raw["scenes"]:
            table["draws"] = max(1, round(scenes * table["draws"] / whole))
    return edited_experiment(name, raw)


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="scripts/bench accuracy", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/accuracy"), help="folder to write to")
    parser.add_argument("--scenes", type=int, help="random scenes, about (default 60)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quick", action="store_true", help="three scenes, few grids")
    parser.add_argument("--draw", action="store_true", help="draw the results already in --out")
    return parser.parse_args()


if __name__ == "__main__":
    raise SystemExit(main())
