"""A small experiment for the tests of sweeps, and runs of it in processes of their own."""

import subprocess
import sys
import time

import numpy as np
import pytest

from jaxclay.cli.main import main
from jaxclay.experiments import load

GREEDY = """\
kind = "throughput"
slices = 8

[[scenes]]
cylinders = { radius = [0.4, 0.5, 0.6] }
squash = { bottom = 0.0, height = [0.4, 0.5], ratio = [0.8, 0.9] }

[[methods]]
name = "greedy"
"""
TEXT = GREEDY + '[[methods]]\nname = "greedy-refined"\n'
COUNT = 24
# Two tasks a file, so that there are many moments between two of them.
COMMAND = (
    "import sys; from jaxclay.experiments import engine; engine.MOST = 2;"
    "from jaxclay.cli.main import entry; sys.argv[0] = 'jaxclay';"
    "entry() if __name__ == '__main__' else None"
)


@pytest.fixture(scope="module")
def experiment(tmp_path_factory):
    """The file."""
    path = tmp_path_factory.mktemp("experiment") / "small.toml"
    path.write_text(TEXT)
    return path


@pytest.fixture(scope="module")
def whole(experiment, tmp_path_factory):
    """The results of a run that nothing disturbs."""
    out = tmp_path_factory.mktemp("whole")
    assert main(["sweep", str(experiment), "--out", str(out), "--quiet"]) == 0
    return out


@pytest.fixture
def read(tmp_path):
    """Reads an experiment from its text."""

    def from_text(text, **more):
        path = tmp_path / "one.toml"
        path.write_text(text)
        from jaxclay.experiments.entries.reading import read_experiment  # of an extra

        return read_experiment(path, **more)

    return from_text


def start(experiment, out, *more):
    """The command in a process of its own."""
    command = [sys.executable, "-c", COMMAND, "sweep", str(experiment), "--out", str(out)]
    return subprocess.Popen(
        [*command, "--quiet", *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def files(out):
    return sorted((out / "results").glob("part-*.parquet"))


def wait_for(out, count, process):
    """Until there are so many files, or the run has ended."""
    end = time.monotonic() + 300
    while len(files(out)) < count and process.poll() is None:
        assert time.monotonic() < end
        time.sleep(0.002)


def same(out, other):
    """Whether two folders hold the same answers, each once."""
    a, b = (load(folder).sort_values("key", ignore_index=True) for folder in (out, other))
    assert list(a.key) == list(b.key)
    assert len(a) == a.key.nunique() == COUNT
    np.testing.assert_array_equal(a.energy, b.energy)
    np.testing.assert_array_equal(a.status, b.status)
    return True
