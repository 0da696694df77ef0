"""What a run says while it goes on: a bar, or in the quiet mode a plain line now and then."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator

from jaxclay.compare.progress import fit, progress_bar, rate
from jaxclay.compare.rows import Row
from jaxclay.sweep.engine import in_words

_EVERY = 30.0  # seconds between the lines of the quiet mode
Interrupt = Callable[[], None]


class Watch:
    """Hears of every batch: its rows, and how many tasks are done by whatever run."""

    def __init__(self, total: int, done: int, interrupt: Interrupt):
        self.total, self.done, self.interrupt = total, done, interrupt

    def __call__(self, rows: list[Row], done: int) -> None:
        """Hear of a batch."""
        self.done = done
        self.show(rows)
        self.interrupt()

    def show(self, rows: list[Row]) -> None:
        """Say so."""


class _Log(Watch):
    def __init__(self, total: int, done: int, interrupt: Interrupt):
        super().__init__(total, done, interrupt)
        self.first = done
        self.begin = self.last = time.perf_counter()

    def show(self, rows: list[Row]) -> None:
        now = time.perf_counter()
        if now - self.last < _EVERY and self.done < self.total:
            return
        self.last = now
        speed = max(self.done - self.first, 1) / (now - self.begin)
        left = f"{in_words((self.total - self.done) / speed)} left"
        end = left if self.done < self.total else "none left"
        print(f"{self.done} of {self.total} tasks, {rate(speed)}, {end}", flush=True)


@contextlib.contextmanager
def watched(
    label: str, total: int, done: int, interrupt: Interrupt, quiet: bool = False
) -> Iterator[Watch]:
    """A watch to be given to :func:`jaxclay.sweep.engine.run`; ``interrupt`` may raise."""
    if quiet:
        yield _Log(total, done, interrupt)
        return
    with progress_bar() as progress:
        bar = progress.add_task(fit(label), total=total, completed=done)

        class Bar(Watch):
            def show(self, rows: list[Row]) -> None:
                text = fit(rows[-1]["task"]) if rows else fit(label)
                progress.update(bar, completed=self.done, description=text)

        yield Bar(total, done, interrupt)
