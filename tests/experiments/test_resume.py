"""Sweeps: nothing is lost and nothing is done twice, whatever ends a run."""

import contextlib
import errno
import os
import random
import re
import shutil
import signal
import time
from pathlib import Path

import pytest

pytest.importorskip("pandas")
pytest.importorskip("pydantic")

from sweeps import COUNT, TEXT, files, same, start, wait_for

from jaxclay.cli.main import main
from jaxclay.experiments import engine, load, run, store
from jaxclay.experiments.entries.reading import read_experiment


def test_a_finished_run_does_nothing_again(whole, experiment, capsys):
    before = [(path, path.stat().st_mtime_ns) for path in files(whole)]
    assert main(["sweep", str(experiment), "--out", str(whole), "--quiet"]) == 0
    assert f"{COUNT} of them done before" in capsys.readouterr().out
    assert [(path, path.stat().st_mtime_ns) for path in files(whole)] == before


def test_a_run_killed_at_any_moment_goes_on(whole, experiment, tmp_path):
    rng = random.Random(3)
    process = start(experiment, tmp_path)
    wait_for(tmp_path, rng.randint(1, 6), process)
    time.sleep(rng.uniform(0.0, 0.02))
    process.kill()
    process.communicate(timeout=60)
    assert 0 < len(files(tmp_path)) < COUNT / 2
    before = set(load(tmp_path).key)
    run(experiment, tmp_path)
    assert same(tmp_path, whole)
    kept = load(tmp_path).set_index("key").loc[list(before)]
    assert (kept.process != os.getpid()).all()  # what was done has not been done again


def test_ctrl_c_leaves_a_folder_that_goes_on_and_says_how(whole, experiment, tmp_path):
    process = start(experiment, tmp_path)
    wait_for(tmp_path, 2, process)
    process.send_signal(signal.SIGINT)
    said, complaints = process.communicate(timeout=60)
    assert process.returncode == 130, complaints
    again, kept = said.strip().splitlines()[-2:]
    kept = re.fullmatch(rf"(\d+) of {COUNT} tasks are in .*", kept)
    assert int(kept[1]) == len(load(tmp_path)) < COUNT
    again = again.split()
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
    monkeypatch.setattr(engine, "MOST", 2)
    run(experiment, tmp_path)
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
        run(experiment, tmp_path)
    assert len(said) == 3
    assert len(list((tmp_path / "results").glob("*.damaged"))) == 3
    assert same(tmp_path, whole)


def test_a_full_disk_keeps_what_was_written_and_says_how_to_go_on(
    whole, experiment, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(engine, "MOST", 2)
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
    run(experiment, tmp_path)
    assert same(tmp_path, whole)


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="children are read from /proc")
def test_workers_end_with_a_run_that_is_killed(experiment, tmp_path):
    process = start(experiment, tmp_path, "--backend", "processes")
    wait_for(tmp_path, 1, process)
    tasks = Path(f"/proc/{process.pid}/task").glob("*/children")
    children = {int(child) for path in tasks for child in path.read_text().split()}
    assert len(children) >= 2
    process.kill()
    end = time.monotonic() + 30
    while children and time.monotonic() < end:
        children = {child for child in children if _runs(child)}
        time.sleep(0.05)
    assert not children
    process.communicate(timeout=60)  # they had its streams


def _runs(process):
    with contextlib.suppress(OSError):  # it has ended
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


def test_results_that_are_taken_away_are_noticed(experiment, tmp_path):
    def thief(rows, done):
        shutil.rmtree(tmp_path / "results")
        (tmp_path / "results").mkdir()

    assert (
        engine.run(engine.tasks_of(read_experiment(experiment)), tmp_path, callback=thief) == COUNT
    )


def test_a_folder_tells_what_else_it_holds(experiment, tmp_path, capsys):
    other = tmp_path / "other.toml"
    other.write_text(TEXT.replace("ratio = [0.8, 0.9]", "ratio = [0.8, 0.85]"))
    for path in (experiment, other):
        assert main(["sweep", str(path), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    said = capsys.readouterr().out
    assert "12 of them done before" in said  # the same numbers, though not the same places
    assert "12 results of other experiments" in said
    names = [name.rpartition("-")[0] for name in store.experiments(tmp_path / "out")]
    assert names == ["other", "small"]


def test_a_file_is_no_folder(experiment, tmp_path, capsys):
    (tmp_path / "out").write_text("mine")
    assert main(["sweep", str(experiment), "--out", str(tmp_path / "out")]) == 2
    assert "is a file: name a folder" in capsys.readouterr().err
    assert (tmp_path / "out").read_text() == "mine"
