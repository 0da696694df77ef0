"""A task's key: made of what determines the result, and of nothing else."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("pydantic")

import jaxclay
from jaxclay.experiments import run
from jaxclay.experiments.entries.reading import read_experiment
from jaxclay.experiments.entries.tasks import tasks

TEXT = """\
kind = "throughput"
slices = 8
[[scenes]]
draws = 3
profiles = ["*.csv"]
squash = { bottom = 0.0, height = { uniform = [0.2, 0.4] }, ratio = 0.8 }
[[methods]]
name = "newton"
"""
TABLE = '[[scenes]]\nnames = ["reference"]\n'
POTS = {"pot.csv": "height,radius\n0,1\n1,1\n", "jug.csv": "height,radius\n0,1\n1,2\n"}


@pytest.fixture
def keys(tmp_path):
    for name, text in POTS.items():
        (tmp_path / name).write_text(text)

    def read(text=TEXT):
        (tmp_path / "one.toml").write_text(text)
        return {task.key for task in tasks(read_experiment(tmp_path / "one.toml"))}

    return read


def test_a_default_written_out_is_the_same_task(keys):
    for settings in ("{ tolerance = 1e-14 }", "{ max_iterations = 200 }"):
        assert keys(f"{TEXT}settings = {settings}\n") == keys()
    spline = TEXT.replace("slices = 8", "elements = 4") + 'schemes = ["spline"]\n'
    assert keys(spline + "settings = { tolerance = 1e-10 }\n") == keys(spline)
    assert keys(spline + "settings = { tolerance = 1e-14 }\n") != keys(spline)


def test_a_renamed_file_is_the_same_scene(keys, tmp_path):
    before = keys()
    (tmp_path / "pot.csv").rename(tmp_path / "a-pot.csv")
    (tmp_path / "jug.csv").rename(tmp_path / "z-jug.csv")
    assert keys() == before


def test_a_table_added_before_or_more_draws_leave_the_scenes_what_they_were(keys):
    before = keys()
    with_table = keys(TEXT.replace("[[scenes]]", TABLE + "[[scenes]]"))
    assert len(with_table) == len(before) + 1
    assert before < with_table
    assert before < keys(TEXT.replace("draws = 3", "draws = 5"))


def test_the_shorter_way_and_the_longer_are_the_same_tasks(keys):
    longer = TEXT.replace("slices = 8", "").replace("[[methods]]", "[[parts]]\n[[methods]]")
    longer += '[[discretisations]]\nscheme = "paper"\nslices = 8\n'
    assert keys(longer) == keys()


COMMAND = """\
import json, sys
from jaxclay.experiments.entries.reading import read_experiment
from jaxclay.experiments.entries.tasks import tasks
print(json.dumps(sorted(task.key for task in tasks(read_experiment(sys.argv[1])))))
"""


def test_a_key_changes_with_the_code_that_solves_and_not_with_that_which_draws(keys, tmp_path):
    package = tmp_path / "package" / "jaxclay"
    shutil.copytree(Path(jaxclay.__file__).parent, package)
    keys()

    def of_copy():
        done = subprocess.run(
            [sys.executable, "-c", COMMAND, str(tmp_path / "one.toml")], check=True, cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(package.parent)}, capture_output=True, text=True,
            timeout=300,
        )  # fmt: skip
        return set(json.loads(done.stdout.splitlines()[-1]))

    first = of_copy()
    charts = package / "experiments" / "charts" / "panels.py"
    charts.write_text(charts.read_text() + "\n# drawn otherwise\n")
    assert of_copy() == first
    newton = package / "methods" / "newton.py"
    newton.write_text(newton.read_text().replace("_BACKTRACKS = 14", "_BACKTRACKS = 13"))
    assert of_copy().isdisjoint(first)


def test_rows_say_what_ran(tmp_path):
    path = tmp_path / "small.toml"
    path.write_text(
        'kind = "timing"\nrepeats = 1\nprecisions = ["float64", "float32"]\n'
        + TABLE
        + '[[discretisations]]\nscheme = "paper"\nslices = 8\n[[methods]]\nname = "newton"\n'
    )
    table = run(path, tmp_path / "out")
    assert set(table.precision) == {"float64", "float32"}
    assert set(table.blas_threads) == {1}
    assert set(table.device) == {"cpu"}
    threads = {name.read_text().strip() for name in Path("/proc/self/task").glob("*/comm")}
    if any(name.startswith("tf_XLAEigen") for name in threads):
        count = sum(
            name.read_text().startswith("tf_XLAEigen")
            for name in Path("/proc/self/task").glob("*/comm")
        )
        assert set(table.xla_threads) == {count}


def test_python_and_the_command_line_give_tasks_of_one_pool_the_same_keys(tmp_path):
    """In processes of their own, as JAX reads how many threads it has when it starts."""
    path = tmp_path / "small.toml"
    path.write_text(TEXT.replace('profiles = ["*.csv"]', 'profiles = ["bowl"]'))
    environment = {name: text for name, text in os.environ.items() if name != "NPROC"}
    python = f"from jaxclay.experiments import run; run({str(path)!r}, {str(tmp_path / 'a')!r})"
    command = "import sys; from jaxclay.cli.main import entry; entry()"
    arguments = ["sweep", str(path), "--out", str(tmp_path / "b"), "--quiet"]
    for code, more in ((python, []), (command, arguments)):
        subprocess.run(
            [sys.executable, "-c", code, *more], check=True, env=environment, timeout=300
        )
    from jaxclay.experiments import load

    one, other = (load(tmp_path / name) for name in "ab")
    assert set(one.key) == set(other.key)
    assert set(one.xla_threads) == set(other.xla_threads) == {1}
