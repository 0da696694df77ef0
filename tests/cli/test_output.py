"""Results are saved before anything is printed, and who reads the output may stop reading."""

import contextlib
import io
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from jaxclay.cli.main import main
from jaxclay.experiments.entries.reading import raw_experiment

for name in ("pandas", "pydantic", "rich"):
    pytest.importorskip(name)
pytest.importorskip("matplotlib").use("Agg")

DEFORM = ["deform", "bowl", "--squash", "0:0.1:0.2", "--slices", "16"]
BOTTLE = "height,radius\n" + "".join(f"{y},{4 - y / 10}\n" for y in np.linspace(0, 20, 21))
AGREE = """\
kind = "throughput"
slices = 16
[[scenes]]
names = ["reference"]
units = ["snake"]
[[methods]]
name = "greedy-refined"
"""


@pytest.fixture(scope="module", autouse=True)
def own_cache(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.mktemp("cache")))
        yield


def small(name):
    """A packaged experiment of one scene, one method and one part: others take long."""
    raw = raw_experiment(name)
    part = raw["parts"][0]
    if name.startswith("atlas"):
        part["scenes"][0]["squash"]["displacement"] = 0.1
        part["scenes"][0]["material"]["mu"] = 1.0
        return raw | {"parts": [part]}
    return raw | {"parts": [part, raw["parts"][1]]}


@pytest.fixture
def commands(tmp_path, whole, experiment, monkeypatch):
    """Each command and the file that must be there when it has ended."""
    monkeypatch.setattr("jaxclay.cli.experiments.editing.raw_experiment", small)
    swept, out, shape = tmp_path / "swept", tmp_path / "out", tmp_path / "shape.csv"
    shutil.copytree(whole, swept)
    (tmp_path / "agree.toml").write_text(AGREE)
    names = ["--scenes", "reference", "--methods", "newton"]
    to_out = ["--out", str(out)]
    return {
        "deform": ([*DEFORM, "--out", str(shape)], shape),
        "compare": (["compare", "--quick", *names, *to_out], out / "report.html"),
        "atlas": (["atlas", "--quick", "--methods", "newton", *to_out], out / "report.html"),
        "report": (["report", str(swept)], swept / "report.html"),
        "sweep": (["sweep", str(experiment), *to_out, "--quiet"], out / "results"),
        "agree": (["agree", str(tmp_path / "agree.toml"), *to_out], out / "results"),
    }


@pytest.fixture
def full():
    """A disk that is full, also when what was printed should be flushed at the end."""
    with contextlib.suppress(OSError), open("/dev/full", "w") as stream:
        yield stream


def closed_pipe():
    """What ``| head`` leaves once it has read enough."""
    reader, writer = os.pipe()
    os.close(reader)
    return open(writer, "w")


@pytest.mark.parametrize("name", ["deform", "compare", "atlas", "report", "sweep", "agree"])
def test_a_closed_pipe_costs_no_result_and_is_no_error(commands, monkeypatch, name):
    arguments, made = commands[name]
    with closed_pipe() as out, closed_pipe() as err:
        monkeypatch.setattr(sys, "stdout", out)
        monkeypatch.setattr(sys, "stderr", err)
        assert main(arguments) == 0
    assert made.exists()
    if made.is_dir():
        assert list(made.glob("part-*.parquet"))


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
@pytest.mark.parametrize("name", ["deform", "compare", "atlas", "report"])
def test_output_that_fails_is_an_error_after_all_is_saved(commands, full, capfd, name):
    arguments, made = commands[name]
    with contextlib.redirect_stdout(full):
        assert main(arguments) == 2
    assert "No space left" in capfd.readouterr().err
    assert made.exists()


def on_ascii(arguments):
    """What a command prints on a terminal that knows ASCII alone."""
    terminal = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    with contextlib.redirect_stdout(terminal):
        assert main(arguments) == 0
    return terminal.buffer.getvalue().decode("ascii")  # type: ignore[attr-defined]


def test_deform_names_any_file_on_an_ascii_terminal(tmp_path):
    out = tmp_path / "Gefäß.csv"
    assert r"Gef\xe4\xdf.csv" in on_ascii([*DEFORM, "--out", str(out)])
    assert len(out.read_text().splitlines()) >= 1 + 16 + 2  # header, slices and ends


def test_compare_names_any_profile_on_an_ascii_terminal(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxclay.cli.experiments.editing.raw_experiment", small)
    folder, out = tmp_path / "profiles", tmp_path / "out"
    folder.mkdir()
    (folder / "Gefäß.csv").write_text(BOTTLE)
    arguments = ["--quick", "--scenes", "Gefäß-middle", "--methods", "newton", "--out", str(out)]
    said = on_ascii(["compare", "--rows", "--profiles", str(folder), *arguments])
    assert r"Gef\xe4\xdf-middle" in said
    assert "Gefäß-middle" in (out / "report.html").read_text(encoding="utf-8")


def test_brackets_in_names_are_printed_as_they_are(tmp_path, whole, experiment, capsys):
    out = tmp_path / "pots [red]"
    shutil.copytree(whole, out)
    assert main(["sweep", str(experiment), "--out", str(out), "--quiet"]) == 0
    assert f"tasks are in {out}" in capsys.readouterr().out


def test_a_process_ends_quietly_when_its_reader_has_gone(tmp_path):
    out = tmp_path / "shape.csv"
    process = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "from jaxclay.cli.main import entry; entry()",
            *DEFORM,
            "--out",
            out,
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    with process.stderr as errors:
        assert errors.read() == b""
    assert process.wait(timeout=120) == 0
    assert len(out.read_text().splitlines()) >= 1 + 16 + 2  # header, slices and ends
