"""What a run says while it goes on: a bar, or in the quiet mode a plain line now and then."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator

from jaxclay.experiments.compare.progress import fit, progress_bar, rate
from jaxclay.experiments.compare.rows import Row
from jaxclay.experiments.sweep.engine import Tell, in_words

INTERRUPTED = 130
EVERY = 30.0  # seconds between the lines of the quiet mode
Interrupt = Callable[[], None]


class _Log:
    """The quiet mode."""

    def __init__(self, total: int, done: int, interrupt: Interrupt):
        self.total, self.first, self.interrupt = total, done, interrupt
        self.begin = self.last = time.perf_counter()

    def __call__(self, rows: list[Row], done: int) -> None:
        self.interrupt()
        now = time.perf_counter()
        if now - self.last < EVERY and done < self.total:
            return
        self.last = now
        speed = max(done - self.first, 1) / (now - self.begin)
        left = in_words((self.total - done) / speed) if done < self.total else "none"
        print(f"{done} of {self.total} tasks, {rate(speed)}, {left} left", flush=True)


@contextlib.contextmanager
def watched(
    label: str, total: int, done: int, interrupt: Interrupt, quiet: bool = False
) -> Iterator[Tell]:
    """What :func:`.engine.run` tells of every batch; ``interrupt`` may raise."""
    if quiet:
        yield _Log(total, done, interrupt)
        return
    with progress_bar() as progress:
        bar = progress.add_task(fit(label), total=total, completed=done)

        def tell(rows: list[Row], done: int) -> None:
            interrupt()
            text = fit(rows[-1]["task"]) if rows else fit(label)
            progress.update(bar, completed=done, description=text)

        yield tell
