"""``jaxclay sweep`` and ``jaxclay report``: run what is missing, then draw."""

from __future__ import annotations

import os
import shlex
import time
from pathlib import Path

try:
    import pyarrow  # noqa: F401

    from jaxclay.experiments.compare.progress import plain_console
    from jaxclay.experiments.sweep import engine
    from jaxclay.experiments.sweep.experiment import experiment_path, read_experiment
    from jaxclay.experiments.sweep.store import keep_experiment
    from jaxclay.experiments.sweep.watch import INTERRUPTED, Interrupt, watched
except ImportError as error:
    raise ImportError(
        f"jaxclay sweep needs {error.name}: pip install 'jaxclay[sweep]'", name=error.name
    ) from error

from jaxclay.experiments.sweep.engine import Work, in_words
from jaxclay.experiments.sweep.tables import Experiment

_MISSING = 1


def sweep(
    experiment: str | Path,
    out: str | Path | None = None,
    *,
    backend: str = "serial",
    scheduler: str | None = None,
    profiles: str | Path | None = None,
    dry_run: bool = False,
    quiet: bool = False,
    interrupt: Interrupt = lambda: None,
) -> int:
    """Run an experiment file, or what is missing of it: :func:`jaxclay.experiments.run`.

    Returns 0, 1 if results are missing at the end, or 130 if it was interrupted.
    """
    begin = time.perf_counter()
    # Here and in what this starts, and before JAX starts: problems are small, see one_thread.
    os.environ.setdefault("NPROC", "1")
    console = plain_console(soft_wrap=True, highlight=False)
    whole = read_experiment(experiment, profiles)
    folder = Path("out") / Path(experiment).stem if out is None else Path(out)
    engine.check_backend(whole, backend, scheduler)
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"--out {folder} is a file: name a folder")
    if not dry_run:
        engine.set_damage_aside(folder)
    work = engine.work(whole, folder, backend)
    console.print(_summary(whole, work, folder))
    if dry_run:
        return 0
    keep_experiment(folder, experiment_path(experiment))
    again = _again(experiment, folder, backend, scheduler, profiles)
    total, done = len(work.every), len(work.every) - len(work.missing)
    try:
        with watched(f"{whole.kind}, {backend}", total, done, interrupt, quiet) as watch:
            lost = engine.run(whole, folder, backend, scheduler, watch)
    except KeyboardInterrupt:
        # First what has to be known: who is in a hurry interrupts again.
        console.print(f"interrupted: what had ended is kept; go on with\n  {again}")
        left = len(engine.work(whole, folder, backend).missing)
        console.print(f"{total - left} of {total} tasks are in {folder}")
        return INTERRUPTED
    except OSError as error:
        raise OSError(f"{error}: what had been solved is kept in {folder}; then {again}") from error
    if lost:
        console.print(f"{lost} of {total} tasks have no result in {folder} any more: {again}")
        return _MISSING
    took = in_words(time.perf_counter() - begin)
    drawn = shlex.join(["jaxclay", "report", str(folder)])
    console.print(f"all {total} tasks are in {folder} ({took}); {drawn}")
    return 0


def _summary(experiment: Experiment, work: Work, folder: Path) -> str:
    shapes = len({task.shape for task in work.every})
    done = len(work.every) - len(work.missing)
    scenes = len({task.recipe for task in work.every})
    before = f", {done} of them done before" if done else ""
    others = f"\n{folder} holds {work.others} results of other experiments too, and tables and "
    others = f"{others}reports take all of a folder" if work.others else ""
    return (
        f"{experiment.kind}: {len(work.every)} tasks{before} ({scenes} scenes, {shapes} shapes to "
        f"compile); about {in_words(work.seconds)} to go{others}"
    )


def _again(experiment, folder, backend, scheduler, profiles) -> str:
    """The command that goes on."""
    words = ["jaxclay", "sweep", str(experiment), "--out", str(folder)]
    words += ["--backend", backend] if backend != "serial" else []
    words += ["--scheduler", scheduler] if scheduler else []
    words += ["--profiles", str(profiles)] if profiles else []
    return shlex.join(words)


def report(folder: str | Path) -> int:
    """Draw the charts and write ``report.html`` of a folder's results; 0."""
    from jaxclay.experiments.sweep.report import write

    written = write(Path(folder))
    print(f"wrote {len(written)} files to {folder}, among them report.html")
    return 0


def agree(
    experiment: str | Path,
    out: str | Path | None,
    profiles: str | Path | None,
    only: str | None,
    interrupt: Interrupt,
) -> int:
    """Compare greedy with gradient: see :func:`jaxclay.experiments.sweep.agree.agree`."""
    from jaxclay.experiments.sweep.agree import agree as compared

    return compared(experiment, out, profiles, only, interrupt)
