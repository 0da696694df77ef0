"""Parts a and b of the answers benchmark: what a fresh process costs."""

from __future__ import annotations

import json
import os
import resource
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from bounds import Part, at_most, table
from clocks import spread

_CHILD = str(Path(__file__).with_name("first_answers.py"))
_TEAPOT = ["deform", "teapot", "--squash", "0.9:1.35:1.6", "--squash", "0:0.3:1.4"]
_TEAPOT += ["--slices", "64", "--out"]
_WANTED = {
    "deform(slices=64)": 0.6,
    "deform(tolerance=1e-4)": 1.2,
    "three more squashes": 0.5,
    "jaxclay deform --slices 64": 2.0,
    "the same a second time": 0.7,
}  # J


def first_answers(effort) -> Part:
    """Part a: first answers and the command line, in units of jaxopt's first answer, J."""
    runs: dict[str, list[list[float]]] = {name: [] for name in ("J", *_WANTED)}
    for _ in range(effort.processes):
        with tempfile.TemporaryDirectory() as empty:
            runs["J"] += _child("lbfgs", empty)
            runs["deform(slices=64)"] += _child("deform", empty)
            one, more = _child("tolerance", empty)
            runs["deform(tolerance=1e-4)"].append(one)
            runs["three more squashes"].append(more)
            runs["jaxclay deform --slices 64"].append(_command(empty))
            runs["the same a second time"].append(_command(empty))
    found = table(
        "a. First answers of a fresh process, no cache on disk but for the command's second time",
        *("what", "CPU seconds", "XLA, wall seconds", "programs", "J"),
    )
    J = np.median([row[0] for row in runs["J"]])
    for name, rows in runs.items():
        cpu, compiling, made = (np.array(column) for column in zip(*rows, strict=True))
        cells = spread(cpu), spread(compiling), f"{np.median(made):.0f}", spread(cpu / J)
        found.add_row(name, *cells)
    bounds = [
        at_most(f"a. {name}", np.median([row[0] for row in runs[name]]) / J, most, unit=" J")
        for name, most in _WANTED.items()
    ]
    notes = [
        "a. J: jaxopt.LBFGS on the paper's sums, reference scene; CPU of all threads; no imports",
        "a. the command line is timed from its start to its end, imports and files included",
    ]
    return Part(found, bounds, notes)


def second_session(effort) -> Part:
    """Part b: programs compiled by a second session of 20 squashes in the same process."""
    del effort
    with tempfile.TemporaryDirectory() as empty:
        rows = _child("sessions", empty)
    found = table(
        "b. Two sessions of 20 squashes to 1e-3 in a fresh process",
        *("session", "CPU seconds", "XLA, wall seconds", "programs"),
    )
    for name, (cpu, compiling, made) in zip(("first", "second"), rows, strict=True):
        found.add_row(name, f"{cpu:.3g}", f"{compiling:.3g}", f"{made:.0f}")
    return Part(found, [at_most("b. second session compiles", int(rows[1][2]), 0, "{}")], [])


def _child(name: str, empty: str) -> list[list[float]]:
    """CPU seconds, seconds of XLA and programs of each step of :mod:`first_answers`."""
    return json.loads(_run([sys.executable, _CHILD, name], empty))


def _command(empty: str) -> list[float]:
    """The same for the whole process of the command line, which tells its CPU seconds alone."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    code = "from jaxclay.cli.main import entry; entry()"
    _run([sys.executable, "-c", code, *_TEAPOT, str(Path(empty) / "out.csv")], empty)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return [cpu, np.nan, np.nan]


def _run(command: list[str], empty: str) -> str:
    """The last line that a command prints, run with an empty cache folder."""
    kept = {name: value for name, value in os.environ.items() if "CACHE" not in name}
    environment = kept | {"XDG_CACHE_HOME": empty}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{shlex.join(command)} ended with {done.returncode}:\n{done.stderr}")
    return done.stdout.strip().splitlines()[-1]
