"""``scripts/bench accuracy``: run the population, print the medians, draw the picture."""

from __future__ import annotations

import argparse
from pathlib import Path

import pandas as pd
from rich.console import Console
from rich.table import Table
from threadpoolctl import threadpool_limits

from jaxclay.experiments.compare import accuracy, results
from jaxclay.experiments.compare.accuracy_tables import reach, summary
from jaxclay.experiments.compare.command import fit, plain_console, progress_bar
from jaxclay.files.output import patient_output

LEVELS = (1e-3, 1e-4, 1e-5)


def main(arguments: list[str] | None = None) -> int:
    """Run what the command line asks for and write ``results.parquet`` and the picture."""
    asked = _parsed(arguments)
    effort = accuracy.QUICK if asked.quick else accuracy.THOROUGH
    if asked.scenes:
        effort = effort._replace(scenes=asked.scenes)
    asked.out.mkdir(parents=True, exist_ok=True)
    if asked.draw:
        table = pd.read_parquet(asked.out / "results.parquet")
    else:
        table = measured(effort, asked.seed)
        results.save(table, asked.out)
    write_chart(table, asked.out / "speed-and-accuracy.png")
    with patient_output():
        print_table(table, plain_console(width=None if Console().is_terminal else 150))
    return 0


def measured(effort: accuracy.Effort, seed: int = 0) -> pd.DataFrame:
    """All rows, with a bar on stderr while they come in."""
    rows = []
    with threadpool_limits(1), progress_bar() as progress:
        task = progress.add_task("", total=effort.total)

        def tick(what: str) -> None:
            progress.update(task, advance=1, description=fit(what))

        for row in accuracy.run(effort, seed, tick):
            rows.append(row)
    return results.frame(rows)


def write_chart(table: pd.DataFrame, path: Path) -> None:
    """Draw and save."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    from jaxclay.experiments.compare.accuracy_charts import speed_and_accuracy

    figure = speed_and_accuracy(table)
    figure.savefig(path, dpi=160)
    plt.close(figure)


def print_table(table: pd.DataFrame, console: Console) -> None:
    """A line a point of the chart, and what levels of error take."""
    view = Table(title="speed and accuracy, medians over scenes", box=None, pad_edge=False)
    view.add_column("way")
    for name in ("size", "scenes", "error", "10%", "90%", "unknowns", "compiled ms", "call ms"):
        view.add_column(name, justify="right")
    for point in results.records(summary(table)):
        kind = f"degree {point.degree}" if point.degree else ""
        way = f"{point.scheme} {point.method} {kind}"
        errors = (f"{value:.1e}" for value in (point.error, point.low, point.high))
        times = (f"{1e3 * value:.3g}" for value in (point.solve_s, point.call_s))
        size, unknowns = f"{point.size:g}", f"{point.unknowns:.0f}"
        view.add_row(way, size, str(point.scenes), *errors, unknowns, *times)
    console.print(view)
    dropped = table.scene[table.limit == accuracy.NO_REFERENCE]
    console.print(f"left out, as no answer is good enough to measure from: {len(dropped)} scenes")
    table = results.select(table, table.limit != accuracy.NO_REFERENCE)
    names = {"paper": "the paper's scheme needs", "placed": "placed slices of second order need"}
    for scheme, name in names.items():
        for level in LEVELS:
            found = [reach(table, scene, level, scheme) for scene in table.scene.unique()]
            slices, beyond = (
                pd.Series(v) for v in zip(*((r.slices, r.beyond) for r in found), strict=True)
            )
            console.print(
                f"{name} {slices.median():.0f} slices (median) for {level:g}, "
                f"extrapolated on {beyond.sum()} of {len(found)} scenes", highlight=False,
            )  # fmt: skip


def _parsed(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="scripts/bench accuracy", description=accuracy.__doc__)
    parser.add_argument("--out", type=Path, default=Path("accuracy"), help="folder to write to")
    parser.add_argument("--scenes", type=int, help="random scenes (default 60)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quick", action="store_true", help="two scenes, few grids")
    parser.add_argument("--draw", action="store_true", help="draw the results already in --out")
    return parser.parse_args(arguments)
