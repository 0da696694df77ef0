"""A narrow terminal costs no number of what a comparison prints."""

import os
import sys
from argparse import Namespace

import pytest

pytest.importorskip("pydantic")
fcntl = pytest.importorskip("fcntl")
termios = pytest.importorskip("termios")

from sweeps import COUNT  # noqa: E402

from jaxclay.cli.experiments import command  # noqa: E402
from jaxclay.experiments.entries.reading import of_file  # noqa: E402


def test_every_number_is_there_on_a_narrow_terminal(whole, experiment, monkeypatch):
    ours, theirs = os.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, b"\x18\0\x14\0\0\0\0\0")  # 24 lines of 20 columns
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("COLUMNS", raising=False)
    with open(theirs, "w") as terminal, open(ours, "rb", buffering=0) as screen:
        monkeypatch.setattr(sys, "stdout", terminal)
        options = Namespace(quiet=True, rows=False)
        assert command.shown(of_file(experiment), whole, options, lambda: None) == 0
        terminal.flush()
        said = screen.read(100_000).decode()
    assert "greedy-refined" in said
    assert f"{COUNT} tasks" in said
    assert "in a sentence" in said
    assert "…" not in said
