"""``jaxclay sweep`` and ``jaxclay report``: run what is missing, then draw."""

from __future__ import annotations

import os
import shlex
import time
from collections.abc import Callable
from pathlib import Path

try:
    import pyarrow  # noqa: F401
    from rich.console import Console

    from jaxclay.compare.progress import fit, progress_bar, rate
    from jaxclay.sweep import engine
    from jaxclay.sweep.experiment import read_experiment
except ImportError as error:
    raise ImportError(
        f"jaxclay sweep needs {error.name}: pip install 'jaxclay[sweep]'", name=error.name
    ) from error

from jaxclay.compare.rows import Row
from jaxclay.sweep.engine import Work, in_words
from jaxclay.sweep.tables import Experiment

INTERRUPTED = 130
_EVERY = 30.0  # seconds between the lines of the quiet mode
Interrupt = Callable[[], None]


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
    """Run an experiment file, or what is missing of it; see :func:`jaxclay.compare.sweep`.

    Returns 0, or 130 if it was interrupted.
    """
    begin = time.perf_counter()
    # Here and in what this starts, and before JAX starts: problems are small, see one_thread.
    os.environ.setdefault("NPROC", "1")
    console = Console(soft_wrap=True, highlight=False)
    whole = read_experiment(experiment, profiles)
    folder = Path("out") / Path(experiment).stem if out is None else Path(out)
    engine.check_backend(whole, backend, scheduler)
    work = engine.work(whole, folder, backend)
    console.print(_summary(whole, work))
    if dry_run:
        return 0
    again = _again(experiment, folder, backend, scheduler, profiles)
    try:
        _run(whole, work, folder, backend, scheduler, quiet, interrupt)
    except KeyboardInterrupt:
        left = len(engine.work(whole, folder, backend).missing)
        console.print(
            f"interrupted: {len(work.every) - left} of {len(work.every)} tasks are kept in "
            f"{folder}; go on with\n  {again}"
        )
        return INTERRUPTED
    except OSError as error:
        raise OSError(f"{error}: what had been solved is kept in {folder}; then {again}") from error
    took = in_words(time.perf_counter() - begin)
    console.print(f"all {len(work.every)} tasks are in {folder} ({took}); jaxclay report {folder}")
    return 0


def _summary(experiment: Experiment, work: Work) -> str:
    shapes = len({task.shape for task in work.every})
    done = len(work.every) - len(work.missing)
    scenes = len({task.recipe for task in work.every})
    before = f", {done} of them done before" if done else ""
    return (
        f"{experiment.kind}: {len(work.every)} tasks{before} ({scenes} scenes, {shapes} shapes to "
        f"compile); about {in_words(work.seconds)} to go"
    )


def _again(experiment, folder, backend, scheduler, profiles) -> str:
    """The command that goes on."""
    words = ["jaxclay", "sweep", str(experiment), "--out", str(folder)]
    words += ["--backend", backend] if backend != "serial" else []
    words += ["--scheduler", scheduler] if scheduler else []
    words += ["--profiles", str(profiles)] if profiles else []
    return shlex.join(words)


def _run(experiment, work: Work, folder, backend, scheduler, quiet, interrupt) -> None:
    total, done = len(work.every), len(work.every) - len(work.missing)
    if quiet:
        tell = _Log(total, done, interrupt)
        engine.run(experiment, folder, backend, scheduler, tell)
        return
    with progress_bar() as progress:
        bar = progress.add_task(fit(f"{experiment.kind}, {backend}"), total=total, completed=done)

        def tell_bar(rows: list[Row]) -> None:
            interrupt()
            progress.update(bar, advance=len(rows), description=fit(rows[-1]["task"]))

        engine.run(experiment, folder, backend, scheduler, tell_bar)


class _Log:
    """The quiet mode: a plain line now and then, for logs."""

    def __init__(self, total: int, done: int, interrupt: Interrupt):
        self.total, self.first, self.done = total, done, done
        self.begin = self.last = time.perf_counter()
        self.interrupt = interrupt

    def __call__(self, rows: list[Row]) -> None:
        self.interrupt()
        self.done += len(rows)
        now = time.perf_counter()
        if now - self.last < _EVERY and self.done < self.total:
            return
        self.last = now
        speed = (self.done - self.first) / (now - self.begin)
        left = in_words((self.total - self.done) / speed)
        print(f"{self.done} of {self.total} tasks, {rate(speed)}, {left} left", flush=True)


def report(folder: str | Path) -> int:
    """Draw the charts and write ``report.html`` of a folder's results; 0."""
    from jaxclay.sweep.report import write

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
    """Compare greedy with gradient: see :func:`jaxclay.sweep.agree.agree`."""
    from jaxclay.sweep.agree import agree as compared

    return compared(experiment, out, profiles, only, interrupt)
