"""Writing over what is there: modes, links, pipes and devices."""

import os
import stat
import threading

import pytest

from jaxclay import Clay, save_profile, save_svg
from jaxclay.cli.main import main

CLAY = Clay.cylinder(slices=8)
SAVES = [save_profile, save_svg]
DEFORM = ["deform", "bowl", "--squash", "0:0.1:0.2", "--slices", "16"]


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


@pytest.fixture
def expected(tmp_path):
    """What each of the two writes into a plain file."""
    texts = {}
    for save in SAVES:
        save(CLAY, tmp_path / "expected")
        texts[save] = (tmp_path / "expected").read_text()
    (tmp_path / "expected").unlink()
    return texts


@pytest.fixture
def own_umask():
    before = os.umask(0o027)
    yield
    os.umask(before)


@pytest.mark.parametrize("save", SAVES)
def test_a_new_file_has_the_mode_of_any_new_file(tmp_path, own_umask, save, monkeypatch):
    plain, made = tmp_path / "plain", tmp_path / "made"
    plain.touch()
    monkeypatch.delattr(os, "umask")  # it is the whole process's: other threads make files too
    save(CLAY, made)
    assert mode(made) == mode(plain) == 0o640


@pytest.mark.parametrize("save", SAVES)
def test_a_file_that_was_there_keeps_its_mode(tmp_path, expected, save):
    path = tmp_path / "made"
    path.write_text("old")
    path.chmod(0o604)
    save(CLAY, path)
    assert mode(path) == 0o604
    assert path.read_text() == expected[save]


@pytest.mark.parametrize("save", SAVES)
@pytest.mark.parametrize("there", [True, False])
def test_a_link_stays_and_its_target_is_replaced(tmp_path, expected, save, there):
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    link, target = tmp_path / "link", folder / "target"
    if there:
        target.write_text("old")
    link.symlink_to("elsewhere/target")
    save(CLAY, link)
    assert link.is_symlink()
    assert target.read_text() == expected[save]
    assert [path.name for path in folder.iterdir()] == ["target"]


@pytest.mark.parametrize("save", SAVES)
def test_a_pipe_is_written_through(tmp_path, expected, save):
    pipe, found = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: found.append(pipe.read_text()), daemon=True)
    reader.start()
    save(CLAY, pipe)
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    reader.join(timeout=60)
    assert found == [expected[save]]


def test_a_device_is_written_through_and_may_be_named_twice(tmp_path):
    """Behind a link, so that a failure harms no device of the machine."""
    link = tmp_path / "null"
    link.symlink_to(os.devnull)
    assert main([*DEFORM, "--out", str(link), "--svg", str(link)]) == 0
    assert link.is_symlink()
    assert stat.S_ISCHR(link.stat().st_mode)


def test_a_link_says_which_kind_of_picture(tmp_path):
    pytest.importorskip("matplotlib").use("Agg")
    link, target = tmp_path / "shape.png", tmp_path / "blob"
    link.symlink_to(target)
    assert main([*DEFORM, "--out", str(tmp_path / "shape.csv"), "--plot", str(link)]) == 0
    assert target.read_bytes().startswith(b"\x89PNG")


def test_two_names_of_one_file_are_refused(tmp_path, capfd):
    out, link = tmp_path / "shape.csv", tmp_path / "shape.svg"
    link.symlink_to(out)
    assert main([*DEFORM, "--out", str(out), "--svg", str(link)]) == 2
    assert "same file" in capfd.readouterr().err


def test_a_write_that_fails_leaves_the_old_file_alone(tmp_path, monkeypatch):
    path = tmp_path / "made"
    path.write_text("old")
    monkeypatch.setattr("jaxclay.files.profiles.csv.writer", lambda *_, **__: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        save_profile(CLAY, path)
    assert path.read_text() == "old"
    assert [each.name for each in tmp_path.iterdir()] == ["made"]
