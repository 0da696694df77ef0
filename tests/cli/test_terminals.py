"""Terminals, streams and disks as people have them: no result is lost and none begun in vain."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from jaxclay.cli.main import main
from jaxclay.files.output import check_folder, check_target, patient_output

DEFORM = ["deform", "bowl", "--squash", "0:0.1:0.2", "--slices", "16", "--out"]
LINUX = pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="as Linux has it")


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / "cache"))


@pytest.fixture
def nothing_is_solved(monkeypatch):
    """What is refused beforehand never gets there."""

    def solved(*_, **__):
        raise AssertionError("the work began")

    monkeypatch.setattr("jaxclay.cli.deform.deform", solved)


def shell(command, **variables):
    script = f'exec "{sys.executable}" -m jaxclay {command}'
    return subprocess.run(
        ["sh", "-c", script],
        env=os.environ | variables,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def without_trouble(folder):
    """What the command writes where all is well."""
    path = folder / "plain.csv"
    assert main([*DEFORM, str(path)]) == 0
    return path.read_text()


@LINUX
def test_closed_streams_cost_no_result_and_nothing_lands_in_a_file(tmp_path):
    out = tmp_path / "shape.csv"
    ended = shell(f"deform bowl --squash 0:0.1:0.2 --slices 16 --out '{out}' <&- >&- 2>&-")
    assert ended.returncode == 0
    assert out.read_text() == without_trouble(tmp_path)
    assert shell(f"deform bowl --squash 7:8:9 --out '{out}' <&- >&- 2>&-").returncode == 2


@LINUX
def test_a_terminal_that_is_closed_costs_no_result_and_is_no_error(tmp_path, monkeypatch):
    plain, out = without_trouble(tmp_path), tmp_path / "shape.csv"
    ours, theirs = os.openpty()
    os.close(ours)  # writing ends in EIO from here on
    with open(theirs, "w") as terminal:
        monkeypatch.setattr(sys, "stdout", terminal)
        monkeypatch.setattr(sys, "stderr", terminal)
        assert main([*DEFORM, str(out)]) == 0
    assert out.read_text() == plain


def test_nobody_waits_long_without_a_word(monkeypatch, capsys):
    monkeypatch.setattr("jaxclay.files.output.SILENT", 0.2)
    with patient_output():
        print("begins")
        time.sleep(0.5)
    assert capsys.readouterr().err.count("still at work") == 2
    with patient_output():
        for _ in range(5):
            time.sleep(0.1)
            print("a word")
    assert capsys.readouterr().err == ""


@LINUX
@pytest.mark.parametrize("option", ["--out", "--svg"])
def test_a_device_that_is_full_is_named_before_the_work(tmp_path, capfd, nothing_is_solved, option):
    out = [] if option == "--out" else [str(tmp_path / "a.csv"), "--svg"]
    assert main([*DEFORM, *out, "/dev/full"]) == 2
    assert "No space left on device: '/dev/full'" in capfd.readouterr().err


@LINUX
def test_a_folder_that_takes_no_file_is_named_before_the_work(tmp_path, capfd, nothing_is_solved):
    assert main([*DEFORM, "/proc/shape.csv"]) == 2
    assert "'/proc'" in capfd.readouterr().err
    with pytest.raises(OSError, match="/proc"):
        check_folder(Path("/proc/new/results"))
    check_folder(tmp_path / "new" / "results")
    assert list(tmp_path.iterdir()) == []


def test_links_to_nothing_are_named_before_the_work(tmp_path, capfd, nothing_is_solved):
    link = tmp_path / "link.csv"
    link.symlink_to(tmp_path / "gone" / "shape.csv")
    assert main([*DEFORM, str(link)]) == 2
    assert f"no folder {tmp_path / 'gone'}" in capfd.readouterr().err
    with pytest.raises(OSError, match="a link to what is not there"):
        check_folder(link)
    link.unlink()
    link.symlink_to(tmp_path / "shape.csv")  # that can be made
    check_target(link)


@LINUX
def test_ctrl_c_while_the_command_is_imported_ends_it_in_a_line():
    process = subprocess.Popen(
        [sys.executable, "-m", "jaxclay", "deform", "--help"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    maps = Path(f"/proc/{process.pid}/maps")
    while "jaxlib" not in maps.read_text():
        assert process.poll() is None
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 130
    assert error == "jaxclay: interrupted before anything had begun\n"


def test_ctrl_c_says_how_to_go_on(tmp_path, capfd, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("jaxclay.cli.deform.deform", interrupted)
    out = str(tmp_path / "a shape.csv")
    assert main([*DEFORM, out]) == 130
    assert capfd.readouterr().err.splitlines()[-1].strip().startswith("jaxclay deform bowl")
    assert not os.path.exists(out)
