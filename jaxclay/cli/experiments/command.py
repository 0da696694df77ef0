"""What ``jaxclay sweep``, ``compare``, ``atlas`` and ``report`` do with their options.

Each returns the exit status: 0, 1 if results are missing at the end, or 130 if interrupted.
"""

from __future__ import annotations

import contextlib
import shlex
import sys
import time
from argparse import Namespace
from collections.abc import Iterable
from pathlib import Path

from jaxclay.numerics.checks import needing

with needing("sweep", "an experiment"):
    import jinja2  # noqa: F401
    import pyarrow  # noqa: F401
    from rich.table import Table

    from jaxclay.cli.experiments import editing
    from jaxclay.cli.experiments.progress import INTERRUPTED, Interrupt, plain_console, say, watched
    from jaxclay.experiments import engine
    from jaxclay.experiments.store import Store, keep_experiment

from jaxclay.experiments.engine import Work, in_words
from jaxclay.experiments.entries.reading import Edited, of_file
from jaxclay.experiments.entries.tables import Experiment
from jaxclay.experiments.entries.tasks import Task
from jaxclay.files.output import check_folder
from jaxclay.files.profiles import PROFILES, read_profile

_MISSING = 1
_WIDE, _ENDLESS = 150, 1000  # columns where there is no terminal, of the summary and the rows


def sweep(options: Namespace, interrupt: Interrupt) -> int:
    """Run an experiment file, or what is missing of it: :func:`jaxclay.experiments.run`."""
    edited = of_file(options.experiment, options.profiles)
    folder = options.out or Path("out") / Path(options.experiment).stem
    again = words(options, folder, ("backend", "scheduler", "profiles", "strict"))
    engine.check_backend(edited.experiment, options.backend, options.scheduler)
    every = engine.tasks_of(edited.experiment, options.backend)
    if options.dry_run:
        _tell_profiles(edited.experiment)
        say(_described(edited, engine.work(every, folder, options.backend), folder))
        return 0
    begin = time.perf_counter()
    how = {"backend": options.backend, "scheduler": options.scheduler, "quiet": options.quiet}
    code = carry_out(edited, every, folder, shlex.join(again), interrupt, **how)
    if code == 0:
        drawn = shlex.join(["jaxclay", "report", str(folder)])
        took = in_words(time.perf_counter() - begin)
        say(f"all {len(every)} tasks are in {folder} ({took}); {drawn}")
    return code


def words(options: Namespace, folder: Path | None, names: Iterable[str]) -> list[str]:
    """The command that goes on: with the options of those names that are not the defaults."""
    found = ["jaxclay", options.command, options.experiment]
    found += ["--out", str(folder)] if folder else []
    for name in names:
        value = getattr(options, name)
        if value not in (None, False, "serial"):
            found += [f"--{name}"] if value is True else [f"--{name}", str(value)]
    return found


def compare(options: Namespace, interrupt: Interrupt) -> int:
    """The packaged comparison, edited by the options: summary and report."""
    edited = editing.comparison(
        options.scenes, options.methods, options.slices, options.profiles, options.quick,
        options.minimum_radius, options.peers,
    )  # fmt: skip
    return shown(edited, options.out or Path("out/compare"), options, interrupt)


def atlas(options: Namespace, interrupt: Interrupt) -> int:
    """The packaged atlas, edited by the options: summary and report."""
    edited = editing.atlas(options.methods, options.seconds_each, options.quick)
    return shown(edited, options.out or Path("out/atlas"), options, interrupt)


def shown(edited: Edited, folder: Path, options: Namespace, interrupt: Interrupt) -> int:
    """Run what is missing of an experiment, write its report and print the summary."""
    again, every = shlex.join(["jaxclay", *sys.argv[1:]]), engine.tasks_of(edited.experiment)
    code = carry_out(edited, every, folder, again, interrupt, quiet=options.quiet)
    if code:
        return code
    from jaxclay.experiments import report, summary
    from jaxclay.experiments.results import records

    rows = report.shown(folder, {task.key for task in every})
    report.write(folder, rows=rows)
    if options.rows:
        every_row = summary.printed("every row", map(summary.cells, records(rows)))
        _print_whole(every_row, _ENDLESS)
    _print_whole(summary.printed(f"jaxclay {edited.name}", summary.summary(rows)), _WIDE)
    say(*(f"refused {n} times: {reason}" for reason, n in summary.refusals(rows).items()))
    more = f"rows: --rows, or {folder / 'results.parquet'}"
    say(f"report: {folder / 'report.html'}; {more}")
    return 0


def carry_out(
    edited: Edited,
    every: list[Task],
    folder: Path,
    again: str,
    interrupt: Interrupt,
    *,
    backend: str = "serial",
    scheduler: str | None = None,
    quiet: bool = False,
) -> int:
    """Run what is missing of an experiment's tasks; ``again`` is the command that goes on."""
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"--out {folder} is a file: name a folder")
    if not quiet:
        _tell_profiles(edited.experiment)
    Store(folder).statuses()  # sets aside what is damaged, so that its tasks count as missing
    work = engine.work(every, folder, backend)
    with contextlib.suppress(OSError):  # told again at the end
        say(_described(edited, work, folder))
    if not work.missing:
        return 0
    check_folder(folder)
    keep_experiment(folder, edited.name, edited.text)
    total, done = len(every), len(every) - len(work.missing)
    try:
        with watched(f"{edited.name}, {backend}", total, done, interrupt, quiet) as callback:
            lost = engine.run(every, folder, backend, scheduler, callback)
    except KeyboardInterrupt:
        # First what has to be known: who is in a hurry interrupts again.
        say(f"interrupted: what had ended is kept; go on with\n  {again}")
        left = len(engine.work(every, folder, backend).missing)
        say(f"{total - left} of {total} tasks are in {folder}")
        return INTERRUPTED
    except OSError as error:
        raise OSError(f"{error}: what had been solved is kept in {folder}; then {again}") from error
    if lost:
        say(f"{lost} of {total} tasks have no result in {folder} any more: {again}")
    return _MISSING if lost else 0


def _tell_profiles(experiment: Experiment) -> None:
    """What was taken for what in the files of profiles, on standard error."""
    tables = experiment.scene_tables
    read = {(name, table.minimum_radius) for table in tables for name in table.profiles or ()}
    for name, least in sorted(read, key=str):
        if name not in PROFILES:
            print(f"{name}: {read_profile(name, least).said}", file=sys.stderr)


def _print_whole(table: Table, wide: int) -> None:
    """Print a table whole: a terminal that is narrower than that breaks its lines."""
    console = plain_console()
    terminal = console.width if console.is_terminal else wide
    console.width = wide  # which bounds what is measured
    console.width = max(terminal, console.measure(table).maximum)
    console.print(table)


def _described(edited: Edited, work: Work, folder: Path) -> str:
    shapes = len({task.shape for task in work.every})
    done = len(work.every) - len(work.missing)
    scenes = len({task.specification for task in work.every})
    before = f", {done} of them done before" if done else ""
    others = f"\n{folder} holds {work.others} results of other experiments too, and tables and "
    others = f"{others}reports take all of a folder" if work.others else ""
    return (
        f"{edited.experiment.kind}: {len(work.every)} tasks{before} ({scenes} scenes, {shapes} "
        f"shapes to compile); about {in_words(work.seconds)} to go{others}"
    )


def report(options: Namespace, interrupt: Interrupt) -> int:
    """Draw the charts and write ``report.html`` of a folder's results."""
    from jaxclay.experiments.report import write

    target = options.out or options.folder
    written = write(options.folder, target)
    print(f"wrote {len(written)} files to {target}, among them report.html")
    return 0
