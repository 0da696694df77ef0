"""What a run says while it goes on: a bar in a terminal, else a plain line every few seconds."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from jaxclay.experiments.engine import Callback, in_words
from jaxclay.experiments.solving.rows import Row

INTERRUPTED = 130
EVERY = 5.0  # seconds, at most, between plain lines
Interrupt = Callable[[], None]
_RATE_OVER = 60.0  # seconds


def plain_console(**options: Any) -> Console:
    """Standard output that prints names and commands as they are: brackets are no markup."""
    return Console(markup=False, emoji=False, **options)


@contextlib.contextmanager
def watched(
    label: str, total: int, done: int, interrupt: Interrupt, quiet: bool = False
) -> Iterator[Callback]:
    """What :func:`.engine.run` calls after every batch; ``interrupt`` may raise."""
    console = Console(stderr=True)
    with contextlib.ExitStack() as stack:
        if quiet or not console.is_terminal:
            lines = _Lines(total, done)
            stack.callback(lines.end)
            show = lines.show
        else:
            bar = stack.enter_context(_bar(console))
            number = bar.add_task(_fit(label), total=total, completed=done)

            def show(text: str, done: int) -> None:
                bar.update(number, completed=done, description=_fit(text))

        def callback(rows: list[Row], done: int) -> None:
            interrupt()
            show(rows[-1]["task"] if rows else label, done)

        yield callback


class _Lines:
    """Plain lines on standard error, by a thread of their own: one solve may take long."""

    def __init__(self, total: int, done: int):
        self.total, self.first, self.done, self.text = total, done, done, "begins"
        self.begin = time.perf_counter()
        self.ended = threading.Event()
        self.thread = threading.Thread(target=self._say, args=(sys.stderr,), daemon=True)
        self.thread.start()

    def show(self, text: str, done: int) -> None:
        self.text, self.done = text, done

    def end(self) -> None:
        self.ended.set()
        self.thread.join()

    def _say(self, stream) -> None:
        while not self.ended.wait(EVERY):
            with contextlib.suppress(OSError, ValueError):  # nobody may read it any more
                print(self.line(), file=stream, flush=True)

    def line(self) -> str:
        made = self.done - self.first
        speed = made / (time.perf_counter() - self.begin)
        left = in_words((self.total - self.done) / speed) if made else "not known how much"
        rate = f", {_rate(speed)}" if made else ""
        return f"{self.done} of {self.total} tasks{rate}, {left} left; {self.text}"


def _bar(console: Console) -> Progress:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=12),
        MofNCompleteColumn(),
        _Rate(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=console, speed_estimate_period=_RATE_OVER)


def _fit(text: str) -> str:
    """The text in the width that the bar keeps for it."""
    return f"{text:<34.34}"


class _Rate(ProgressColumn):
    """How many a second, or seconds for each."""

    def render(self, task: Task) -> Text:
        return Text(_rate(task.speed) if task.speed else "")


def _rate(speed: float) -> str:
    return f"{speed:.1f}/s" if speed >= 1 else f"{1 / speed:.1f} s each"
