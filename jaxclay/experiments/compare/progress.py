"""A bar on stderr: what is running, how many are done, how fast, and for how long still."""

from __future__ import annotations

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

_RATE_OVER = 60.0  # seconds


def progress_bar() -> Progress:
    """The bar, to be used as a context."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=12),
        MofNCompleteColumn(),
        _Rate(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    return Progress(*columns, console=console, speed_estimate_period=_RATE_OVER)


def plain_console(**options: Any) -> Console:
    """Standard output that prints names and commands as they are: brackets are no markup."""
    return Console(markup=False, emoji=False, **options)


def fit(text: str) -> str:
    """The text in the width that the bar keeps for it."""
    return f"{text:<34.34}"


class _Rate(ProgressColumn):
    """How many a second, or seconds for each."""

    def render(self, task: Task) -> Text:
        if not task.speed:
            return Text("")
        return Text(rate(task.speed))


def rate(speed: float) -> str:
    """A speed in words: how many a second, or seconds for each."""
    return f"{speed:.1f}/s" if speed >= 1 else f"{1 / speed:.1f} s each"
