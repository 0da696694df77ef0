"""What ``jaxclay sweep``, ``compare``, ``atlas``, ``report`` and ``agree`` do."""

from __future__ import annotations

import contextlib
import shlex
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxclay.numerics.checks import needing

with needing("sweep", "an experiment"):
    import jinja2  # noqa: F401
    import pyarrow  # noqa: F401

    from jaxclay.experiments import editing, engine
    from jaxclay.experiments.progress import INTERRUPTED, Interrupt, plain_console, watched
    from jaxclay.experiments.store import keep_experiment

from jaxclay.experiments.editing import Edited
from jaxclay.experiments.engine import Work, in_words
from jaxclay.experiments.entries.tables import Experiment
from jaxclay.files.output import check_folder
from jaxclay.files.profiles import PROFILES, read_profile
from jaxclay.files.several import refusing

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

_MISSING = 1
_WIDE, _ENDLESS = 150, 1000  # columns where there is no terminal, of the summary and the rows


def sweep(
    experiment: str | Path,
    out: str | Path | None = None,
    *,
    backend: str = "serial",
    scheduler: str | None = None,
    profiles: str | Path | None = None,
    strict: bool = False,
    dry_run: bool = False,
    quiet: bool = False,
    interrupt: Interrupt = lambda: None,
) -> int:
    """Run an experiment file, or what is missing of it: :func:`jaxclay.experiments.run`.

    Returns 0, 1 if results are missing at the end, or 130 if it was interrupted.
    """
    with refusing(strict):
        edited = editing.of_file(experiment, profiles)
    folder = Path("out") / Path(experiment).stem if out is None else Path(out)
    words = ["jaxclay", "sweep", str(experiment), "--out", str(folder)]
    words += ["--backend", backend] if backend != "serial" else []
    words += ["--scheduler", scheduler] if scheduler else []
    words += ["--profiles", str(profiles)] if profiles else []
    words += ["--strict"] if strict else []
    how = {"backend": backend, "scheduler": scheduler, "quiet": quiet, "dry_run": dry_run}
    begin = time.perf_counter()
    code, work = carry_out(edited, folder, shlex.join(words), interrupt, **how)
    if code == 0 and not dry_run:
        took = in_words(time.perf_counter() - begin)
        drawn = shlex.join(["jaxclay", "report", str(folder)])
        _say(f"all {len(work.every)} tasks are in {folder} ({took}); {drawn}")
    return code


def shown(
    edited: Edited, folder: Path, interrupt: Interrupt, rows: bool = False, quiet: bool = False
) -> int:
    """Run an experiment, or what is missing of it, write its report and print the summary.

    Returns as :func:`sweep`.
    """
    again = shlex.join(["jaxclay", *sys.argv[1:]])
    code, work = carry_out(edited, folder, again, interrupt, quiet=quiet)
    if code:
        return code
    from jaxclay.experiments import summary
    from jaxclay.experiments.charts.series import prepared
    from jaxclay.experiments.frames import records, select
    from jaxclay.experiments.report import write
    from jaxclay.experiments.results import table

    keys = {task.key for task in work.every}
    write(folder, keys=keys)
    every = prepared(table(folder))
    every = select(every, every.key.isin(list(keys)))
    console = plain_console()
    if rows:
        lines = map(summary.cells, records(every))
        _print_whole(console, summary.printed("every row", lines, summary.ROWS), _ENDLESS)
    lines = summary.summary(every)
    _print_whole(console, summary.printed(f"jaxclay {edited.name}", lines), _WIDE)
    for reason, count in summary.refusals(every).items():
        console.print(f"refused {count} times: {reason}", highlight=False, soft_wrap=True)
    report = folder / "report.html"
    console.print(f"report: {report}; rows: --rows, or {folder / 'results.parquet'}",
                  highlight=False, soft_wrap=True)  # fmt: skip
    return 0


def carry_out(
    edited: Edited,
    folder: Path,
    again: str,
    interrupt: Interrupt,
    *,
    backend: str = "serial",
    scheduler: str | None = None,
    quiet: bool = False,
    dry_run: bool = False,
) -> tuple[int, Work]:
    """Run what is missing; ``again`` is the command that goes on.

    Returns the exit status, and what there was to do.
    """
    whole = edited.experiment
    engine.check_backend(whole, backend, scheduler)
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"--out {folder} is a file: name a folder")
    if not quiet:
        _tell_profiles(whole)
    if not dry_run:
        engine.set_damage_aside(folder)
    work = engine.work(whole, folder, backend)
    with contextlib.suppress(OSError):  # told again at the end
        _say(_described(whole, work, folder))
    if dry_run or not work.missing:
        return 0, work
    check_folder(folder)
    keep_experiment(folder, edited.name, edited.text)
    total, done = len(work.every), len(work.every) - len(work.missing)
    try:
        with watched(f"{edited.name}, {backend}", total, done, interrupt, quiet) as callback:
            lost = engine.run(whole, folder, backend, scheduler, callback)
    except KeyboardInterrupt:
        # First what has to be known: who is in a hurry interrupts again.
        _say(f"interrupted: what had ended is kept; go on with\n  {again}")
        left = len(engine.work(whole, folder, backend).missing)
        _say(f"{total - left} of {total} tasks are in {folder}")
        return INTERRUPTED, work
    except OSError as error:
        raise OSError(f"{error}: what had been solved is kept in {folder}; then {again}") from error
    if lost:
        _say(f"{lost} of {total} tasks have no result in {folder} any more: {again}")
        return _MISSING, work
    return 0, work


def _tell_profiles(experiment: Experiment) -> None:
    """What was taken for what in the files of profiles, on standard error."""
    parts = (experiment, *(experiment.parts or ()))
    tables = [table for part in parts for table in part.scenes or ()]
    read = {(name, table.minimum_radius) for table in tables for name in table.profiles or ()}
    for name, least in sorted(read, key=str):
        if name not in PROFILES:
            print(f"{name}: {read_profile(name, least).said}", file=sys.stderr)


def _print_whole(console: Console, table: Table, wide: int) -> None:
    """Print a table whole: a terminal that is narrower than that breaks its lines."""
    terminal = console.width if console.is_terminal else wide
    console.width = wide
    console.width = max(terminal, console.measure(table).maximum)
    console.print(table)
    console.width = terminal


def _say(text: str) -> None:
    plain_console(soft_wrap=True, highlight=False).print(text)
    sys.stdout.flush()


def _described(experiment: Experiment, work: Work, folder: Path) -> str:
    shapes = len({task.shape for task in work.every})
    done = len(work.every) - len(work.missing)
    scenes = len({task.specification for task in work.every})
    before = f", {done} of them done before" if done else ""
    others = f"\n{folder} holds {work.others} results of other experiments too, and tables and "
    others = f"{others}reports take all of a folder" if work.others else ""
    return (
        f"{experiment.kind}: {len(work.every)} tasks{before} ({scenes} scenes, {shapes} shapes to "
        f"compile); about {in_words(work.seconds)} to go{others}"
    )


def report(folder: str | Path, out: str | Path | None = None) -> int:
    """Draw the charts and write ``report.html`` of a folder's results; 0."""
    from jaxclay.experiments.report import write

    target = Path(folder) if out is None else Path(out)
    written = write(Path(folder), target)
    print(f"wrote {len(written)} files to {target}, among them report.html")
    return 0


def agree(*arguments: Any) -> int:
    """Compare greedy with gradient: see :func:`jaxclay.experiments.agree.agree`."""
    from jaxclay.experiments.agree import agree as compared

    return compared(*arguments)
