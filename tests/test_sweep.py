"""Sweeps: nothing is lost and nothing is done twice, whatever ends a run."""

import errno
import os
import random
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import jaxclay

pd = pytest.importorskip("pandas")
pytest.importorskip("pydantic")

from jaxclay.cli import main  # noqa: E402
from jaxclay.compare import load, load_curves, sweep  # noqa: E402
from jaxclay.sweep import engine, estimate, store  # noqa: E402
from jaxclay.sweep.experiment import read_experiment  # noqa: E402
from jaxclay.sweep.tasks import tasks  # noqa: E402

TEXT = """\
kind = "throughput"
slices = 8

[[scenes]]
cylinders = { radius = [0.4, 0.5, 0.6] }
squash = { bottom = 0.0, height = [0.4, 0.5], ratio = [0.8, 0.9] }

[[methods]]
name = "greedy"

[[methods]]
name = "greedy-refined"
"""
COUNT = 24
# Two tasks a file, so that there are many moments between two of them.
COMMAND = (
    "import sys; from jaxclay.sweep import estimate; estimate._MOST = 2;"
    "from jaxclay.cli import entry; sys.argv[0] = 'jaxclay'; entry()"
)


@pytest.fixture(scope="module", autouse=True)
def compiled_once(tmp_path_factory):
    """Compilations are kept, so that a run that goes on is quick."""
    folder = tmp_path_factory.mktemp("compilations")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("JAX_COMPILATION_CACHE_DIR", str(folder))
        yield


@pytest.fixture(scope="module")
def experiment(tmp_path_factory):
    path = tmp_path_factory.mktemp("experiment") / "small.toml"
    path.write_text(TEXT)
    return path


@pytest.fixture(scope="module")
def whole(experiment, tmp_path_factory, compiled_once):
    """The results of a run that nothing disturbs."""
    out = tmp_path_factory.mktemp("whole")
    assert main(["sweep", str(experiment), "--out", str(out), "--quiet"]) == 0
    return out


def start(experiment, out, *more):
    command = [sys.executable, "-c", COMMAND, "sweep", str(experiment), "--out", str(out)]
    return subprocess.Popen(
        [*command, "--quiet", *more], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def files(out):
    return sorted((out / "results").glob("part-*.parquet"))


def wait_for(out, count, process):
    """Until there are so many files, or the run has ended."""
    while len(files(out)) < count and process.poll() is None:
        time.sleep(0.002)


def same(out, other):
    """Whether two folders hold the same answers, each once."""
    a, b = (load(folder).sort_values("key", ignore_index=True) for folder in (out, other))
    assert list(a.key) == list(b.key)
    assert len(a) == a.key.nunique() == COUNT
    np.testing.assert_array_equal(a.energy, b.energy)
    np.testing.assert_array_equal(a.status, b.status)
    return True


def test_answers_are_what_the_library_says(whole, experiment):
    table = load(whole).set_index("key")
    for task in tasks(read_experiment(experiment))[:: COUNT // 6]:
        problem = task.recipe.scene().problems("snake", 8)[-1]
        answer = jaxclay.minimize(problem, method=task.method)
        row = table.loc[task.key]
        assert row.energy == pytest.approx(float(answer.energy), rel=1e-12)
        assert (row.iterations, row.status) == (int(answer.iterations), str(answer.status))


def test_gaps_are_measured_from_another_methods_certified_minimum(whole, tmp_path):
    path = tmp_path / "newton.toml"
    path.write_text(TEXT.replace('"greedy-refined"', '"newton"'))
    newton = sweep(path, tmp_path / "out").query("method == 'newton'")
    greedy = load(whole)
    assert set(newton.reference) == {"lbfgs-preconditioned"}
    assert set(greedy.reference) == {"newton"}
    assert (abs(newton.gap_relative) < 1e-9).all()
    assert (greedy.gap_relative > 1e-6).any()
    coarse = greedy[greedy.method == "greedy"]
    assert coarse.contour_error.min() > 1e3 * newton.contour_error.max()


def test_columns_are_documented_and_curves_are_the_answers_contours(whole, experiment):
    table, curves = load(whole), load_curves(whole)
    assert set(table.attrs["units"]) == set(table.columns)
    assert all(len(text) > 5 for text in table.attrs["units"].values())
    task = tasks(read_experiment(experiment))[0]
    problem = task.recipe.scene().problems("snake", 8)[-1]
    clay = jaxclay.minimize(problem, method=task.method).clay
    here = curves.isel(task=int(np.argmax(curves.key.values == task.key)))
    np.testing.assert_allclose(here.contour_radius, clay.radii, rtol=1e-12)
    middle = (clay.heights[1:] + clay.heights[:-1]) / 2
    np.testing.assert_allclose(here.contour_height, middle, rtol=1e-12)


def test_a_finished_run_does_nothing_again(whole, experiment, capsys):
    before = [(path, path.stat().st_mtime_ns) for path in files(whole)]
    assert main(["sweep", str(experiment), "--out", str(whole), "--quiet"]) == 0
    assert f"{COUNT} of them done before" in capsys.readouterr().out
    assert [(path, path.stat().st_mtime_ns) for path in files(whole)] == before


def test_a_run_killed_at_any_moment_goes_on(whole, experiment, tmp_path):
    rng = random.Random(3)
    for count in (0, 1, 6):
        process = start(experiment, tmp_path)
        wait_for(tmp_path, len(files(tmp_path)) + count, process)
        time.sleep(rng.uniform(0.0, 0.02) if count else rng.uniform(0.0, 1.0))
        process.kill()
        process.communicate()
    assert 0 < len(files(tmp_path)) < COUNT / 2
    before = set(load(tmp_path).key)
    sweep(experiment, tmp_path)
    assert same(tmp_path, whole)
    kept = load(tmp_path).set_index("key").loc[list(before)]
    assert (kept.process != os.getpid()).all()  # what was done has not been done again


def test_ctrl_c_leaves_a_folder_that_goes_on_and_says_how(whole, experiment, tmp_path):
    process = start(experiment, tmp_path)
    wait_for(tmp_path, 2, process)
    process.send_signal(signal.SIGINT)
    said, complaints = process.communicate(timeout=60)
    assert process.returncode == 130, complaints
    kept = re.search(rf"interrupted: (\d+) of {COUNT} tasks are kept", said)
    assert int(kept[1]) == len(load(tmp_path)) < COUNT
    again = said.strip().splitlines()[-1].split()
    assert again == ["jaxclay", "sweep", str(experiment), "--out", str(tmp_path)]
    assert main([*again[1:], "--quiet"]) == 0
    assert same(tmp_path, whole)


def test_two_runs_on_one_folder_share_it(whole, experiment, tmp_path):
    both = [start(experiment, tmp_path) for _ in range(2)]
    for process in both:
        _, complaints = process.communicate(timeout=120)
        assert process.returncode == 0, complaints
    assert same(tmp_path, whole)


def test_damaged_files_are_set_aside_and_done_again(whole, experiment, tmp_path, monkeypatch):
    monkeypatch.setattr(estimate, "_MOST", 2)
    sweep(experiment, tmp_path)
    first, second, third, *_ = files(tmp_path)
    first.write_bytes(first.read_bytes()[:500])
    second.write_bytes(b"")
    content = bytearray(third.read_bytes())
    content[200] ^= 255  # one byte on the way
    third.write_bytes(bytes(content))
    with pytest.warns(UserWarning, match="is damaged and left out") as said:
        assert len(load(tmp_path)) == COUNT - 6
    assert len(said) == 3
    with pytest.warns(UserWarning, match="set aside") as said:
        sweep(experiment, tmp_path)
    assert len(said) == 3
    assert len(list((tmp_path / "results").glob("*.damaged"))) == 3
    assert same(tmp_path, whole)


def test_a_full_disk_keeps_what_was_written_and_says_how_to_go_on(
    whole, experiment, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(estimate, "_MOST", 2)
    write, written = store.pq.write_table, []

    def full(table, path, **more):
        if len(written) == 3:
            path.write_bytes(b"PAR1")
            raise OSError(errno.ENOSPC, "No space left on device")
        written.append(write(table, path, **more))

    with monkeypatch.context() as patch:
        patch.setattr(store.pq, "write_table", full)
        assert main(["sweep", str(experiment), "--out", str(tmp_path), "--quiet"]) == 2
    complaint = capsys.readouterr().err
    assert "No space left" in complaint
    assert f"kept in {tmp_path}; then jaxclay sweep" in complaint
    assert len(load(tmp_path)) == 6
    assert len(list((tmp_path / "results").iterdir())) == 3  # nothing half-written
    sweep(experiment, tmp_path)
    assert same(tmp_path, whole)


def test_what_cannot_be_posed_is_skipped_and_says_why(tmp_path, experiment):
    path = tmp_path / "thin.toml"
    path.write_text(TEXT.replace("[0.4, 0.5]", "[0.4, 0.1]"))
    table = sweep(path, tmp_path / "out")
    thin = table[table.band_height == 0.1]
    assert set(thin.status) == {"skipped"}
    assert thin.reason.str.contains("imposes no radius").all()
    assert (thin.reference == "none certified").all()
    assert (table[table.band_height == 0.4].status != "skipped").all()


def test_progress_of_a_quiet_run_has_rate_and_time_left(experiment, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("jaxclay.sweep.command._EVERY", 0.0)
    monkeypatch.setattr(estimate, "_MOST", 12)
    assert main(["sweep", str(experiment), "--out", str(tmp_path), "--quiet"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert re.fullmatch(rf"12 of {COUNT} tasks, [\d.]+(/s| s each), .* s left", lines[1])


def test_times_in_words():
    words = {0.2: "1 s", 59: "59 s", 200: "3 min 20 s", 7300: "2 h 1 min"}
    assert {seconds: engine.in_words(seconds) for seconds in words} == words


def test_timing_runs_alone_on_one_core_with_compiling_apart(tmp_path):
    path = tmp_path / "timing.toml"
    text = TEXT.replace("throughput", "timing").replace("[0.4, 0.5, 0.6]", "0.5")
    path.write_text("repeats = 2\n" + text + "stops = [1, 2, 4]\n")
    cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    table = sweep(path, tmp_path / "out")
    assert set(table.kind) == {"timing"}
    assert (table.compile_s > 0).any()
    assert (table.repeats >= 2).all()
    assert (table.solve_s_least <= table.solve_s).all()
    assert (table.solve_s <= table.solve_s_most).all()
    if cores is not None:
        assert set(table.pinned) <= cores
        assert os.sched_getaffinity(0) == cores
    curves = load_curves(tmp_path / "out")
    greedy = curves.isel(task=curves.method.values == "greedy-refined")
    falls = np.diff(greedy.trace_energy.values, axis=1)
    assert (falls[np.isfinite(falls)] <= 0).all()
    assert (greedy.trace_iterations.values[:, :2] == [1, 2]).all()
