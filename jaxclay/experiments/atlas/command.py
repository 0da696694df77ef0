"""``jaxclay atlas``: sweep, mark, print, write."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from jaxclay.experiments.compare.command import (
    fit,
    plain_console,
    progress_bar,
)  # first: it says which extra is missing

# isort: split
from threadpoolctl import threadpool_limits

from jaxclay.experiments.atlas import report
from jaxclay.experiments.atlas.runner import Row, run
from jaxclay.experiments.atlas.sweeps import QUICK, Grids
from jaxclay.experiments.compare import results
from jaxclay.methods import METHODS
from jaxclay.numerics.checks import check_positive

SECONDS = 0.2  # for each solve: two hundred times newton's at 64 slices


def atlas(
    out: Path,
    methods: list[str] | None = None,
    seconds: float = SECONDS,
    quick: bool = False,
    interrupt: Callable[[], None] = lambda: None,
) -> int:
    """Sweep; 0, or 130 if it was interrupted and only a part was written.

    ``interrupt`` is called between solves and may raise KeyboardInterrupt.

    Raises
    ------
    ValueError
        An unknown method, seconds that are not positive.
    """
    for name in methods or ():
        if name not in METHODS:
            raise ValueError(f"unknown method {name!r}: choose from {', '.join(METHODS)}")
    check_positive("seconds", seconds)
    out.mkdir(parents=True, exist_ok=True)
    tempfile.TemporaryFile(dir=out).close()  # a folder that refuses should do so now
    rows: list[Row] = []
    interrupted = False
    try:
        # Dense factorisations are small: more threads only wait for each other.
        with threadpool_limits(1):
            _run(QUICK if quick else Grids(), methods or list(METHODS), seconds, rows, interrupt)
    except KeyboardInterrupt:
        interrupted = True
    console = plain_console()
    if not rows:
        console.print("nothing was tried; nothing is written")
        return 130 if interrupted else 1
    table = results.frame(rows)
    written = report.write(table, seconds, out)
    report.print_table(table, console)
    if interrupted:
        console.print("interrupted: what had been tried is written")
    console.print(f"wrote {len(written)} files to {out}, among them report.html", soft_wrap=True)
    return 130 if interrupted else 0


def _run(grids: Grids, methods: list[str], seconds: float, rows: list[Row], interrupt) -> None:
    with progress_bar() as progress:
        task = progress.add_task("", total=len(grids.cells()))

        def tick(what: str) -> None:
            interrupt()
            progress.update(task, description=fit(what))

        for cell in run(grids, methods, seconds, tick):
            rows.extend(cell)
            progress.advance(task)
        progress.update(task, description=fit("done"))
