"""What a run says while it goes on: a bar in a terminal, else a plain line every few seconds."""

from __future__ import annotations

import collections
import contextlib
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

from rich import progress as bars
from rich.console import Console
from rich.text import Text

from jaxclay.experiments.engine import Callback, in_words
from jaxclay.experiments.solving.solve import Row

INTERRUPTED = 130
EVERY = 5.0  # seconds, at most, between plain lines
Interrupt = Callable[[], None]
_RATE_OVER = 60.0  # seconds


def plain_console() -> Console:
    """Standard output that prints names and commands as they are: brackets are no markup."""
    return Console(markup=False, emoji=False, highlight=False)


def say(*lines: str) -> None:
    """Print lines there, none of them broken, at once."""
    console = plain_console()
    for line in lines:
        console.print(line, soft_wrap=True)
    sys.stdout.flush()


@contextlib.contextmanager
def watched(
    label: str, total: int, done: int, interrupt: Interrupt, quiet: bool = False
) -> Iterator[Callback]:
    """What :func:`.engine.run` calls after every batch; ``interrupt`` may raise."""
    console = Console(stderr=True)
    shown = _lines if quiet or not console.is_terminal else _bar
    with shown(console, label, total, done) as show:

        def callback(rows: list[Row], done: int) -> None:
            interrupt()
            show(rows[-1]["task"] if rows else label, done)

        yield callback


@contextlib.contextmanager
def _bar(console: Console, label: str, total: int, done: int) -> Iterator[Callable]:
    text, left = bars.TextColumn("{task.description:<34.34}"), bars.TextColumn("left")
    counts = bars.BarColumn(12), bars.MofNCompleteColumn(), _Rate()
    columns = text, *counts, left, bars.TimeRemainingColumn()
    with bars.Progress(*columns, console=console, speed_estimate_period=_RATE_OVER) as bar:
        number = bar.add_task(label, total=total, completed=done)
        yield lambda text, done: bar.update(number, completed=done, description=text)


@contextlib.contextmanager
def _lines(console: Console, label: str, total: int, first: int) -> Iterator[Callable]:
    """Plain lines on standard error, by a thread of their own: one solve may take long."""
    begin, ended = time.perf_counter(), threading.Event()
    latest: Any = collections.deque([("begins", first)], maxlen=1)

    def tell(stream) -> None:
        while not ended.wait(EVERY):
            text, done = latest[-1]
            speed = (done - first) / (time.perf_counter() - begin)
            left = in_words((total - done) / speed) if speed else "not known how much"
            rate = f", {_rate(speed)}" if speed else ""
            line = f"{done} of {total} tasks{rate}, {left} left; {text}"
            with contextlib.suppress(OSError, ValueError):  # nobody may read it any more
                print(line, file=stream, flush=True)

    thread = threading.Thread(target=tell, args=(sys.stderr,), daemon=True)
    thread.start()
    try:
        yield lambda *news: latest.append(news)
    finally:
        ended.set()
        thread.join()


class _Rate(bars.ProgressColumn):
    """How many a second, or seconds for each."""

    def render(self, task: bars.Task) -> Text:
        return Text(_rate(task.speed) if task.speed else "")


def _rate(speed: float) -> str:
    return f"{speed:.1f}/s" if speed >= 1 else f"{1 / speed:.1f} s each"
