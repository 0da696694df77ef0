"""Faults of 0.1.0, each kind by what it did to users."""

import os
import re
import stat
import subprocess
import sys

import numpy as np
import pytest

pd = pytest.importorskip("pandas")
pytest.importorskip("pydantic")
pytest.importorskip("matplotlib").use("Agg")

import matplotlib.pyplot as plt  # noqa: E402

import jaxclay  # noqa: E402
from jaxclay.cli.experiments.editing import comparison  # noqa: E402
from jaxclay.cli.main import main  # noqa: E402
from jaxclay.experiments import load, run  # noqa: E402
from jaxclay.experiments.charts.population import failure_charts  # noqa: E402
from jaxclay.experiments.charts.shared import prepared, told_apart  # noqa: E402
from jaxclay.experiments.charts.standard import all_charts  # noqa: E402
from jaxclay.experiments.entries.reading import read_experiment  # noqa: E402
from jaxclay.experiments.entries.scenes import files_of  # noqa: E402
from jaxclay.experiments.results import curves  # noqa: E402
from jaxclay.experiments.summary import summary  # noqa: E402
from jaxclay.files.several import RefusedProfile  # noqa: E402

SETTINGS = """\
kind = "throughput"
slices = [8, 16]
[[scenes]]
cylinders = { radius = [0.4, 0.5] }
squash = { bottom = 0.0, height = 0.4, ratio = 0.8 }
[[methods]]
name = "newton"
settings = { tolerance = [1e-1, 1e-14] }
"""
COMMAND = "import sys; from jaxclay.cli.main import entry; sys.argv[0] = 'jaxclay'; entry()"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    base = tmp_path_factory.mktemp("settings")
    (base / "settings.toml").write_text(SETTINGS)
    run(base / "settings.toml", base / "out")
    return base / "out"


def test_two_settings_of_a_method_are_two_curves_two_columns_and_two_lines(folder):
    rows = prepared(load(folder))
    lines = {line["method"]: line["certified"] for line in summary(rows)}
    assert set(lines) == {"newton default", "newton tolerance=0.1"}
    assert lines["newton default"] == "100%" != lines["newton tolerance=0.1"]
    found = {name: figure for name, _, figure in all_charts("throughput", rows, curves(folder))}
    labels = [text.get_text() for text in found["errors"].legends[0].get_texts()]
    assert labels == ["newton default", "newton tolerance=0.1"]
    ticks = [label.get_text() for label in found["failures"].axes[0].get_xticklabels()]
    assert len(ticks) == 2
    plt.close("all")


def test_a_gap_is_measured_from_another_methods_minimum_wherever_it_stands(folder):
    """Not from newton's own, and not from the least of whatever ran beside it."""
    rows = load(folder)
    assert set(rows.reference) <= {"lbfgs-preconditioned", "none certified"}
    for row in rows[rows.gap_relative.notna()].itertuples():
        gap = (row.energy - row.energy_minimum) / row.energy_free
        assert row.gap_relative == pytest.approx(gap, rel=1e-9, abs=1e-15)


def test_an_estimated_error_of_zero_is_one(tmp_path):
    """Clay that is all under the tool, whose two answers are the same."""
    path = tmp_path / "swallowed.toml"
    path.write_text(
        'kind = "timing"\nrepeats = 1\n[[scenes]]\ncylinders = { radius = 0.3 }\n'
        "squash = { bottom = 0.0, height = 3.0, ratio = 1.0 }\n"
        '[[discretisations]]\nscheme = "slices"\ntolerance = 1e-3\n[[methods]]\nname = "newton"\n'
    )
    (row,) = run(path, tmp_path / "out").itertuples()
    assert row.status == "converged"
    assert row.error_estimate <= 1e-15  # and no number is missing
    assert row.gap_relative == 0.0


def test_the_map_over_mu_over_k_bins_mu_over_k():
    rng = np.random.default_rng(0)
    count = 200
    rows = pd.DataFrame(
        {
            "mu": np.exp(rng.uniform(-3.5, 0.7, count)), "k": 10.0,
            "beta": np.exp(rng.uniform(-4.6, 2.3, count)),
            "squashes": 1, "units": "snake", "series": "newton", "scene": "pot",
            "specification": [str(i) for i in range(count)], "status": "converged",
            "gap_relative": 0.0,
        }
    )  # fmt: skip
    figures = {name: figure for name, _, figure in failure_charts(rows)}
    ax = figures["failures-materials"].axes[0]
    (mesh,) = ax.collections
    low, high = ax.get_xlim()
    assert low <= rows.mu.min() / 10 < rows.mu.max() / 10 <= high
    shown = mesh.get_array()
    assert (~np.ma.getmaskarray(shown)).sum() > 0.5 * shown.size  # nothing vanishes
    plt.close("all")


def test_a_report_leaves_no_picture_of_an_earlier_one(folder, tmp_path):
    assert main(["report", str(folder), "--out", str(tmp_path)]) == 0
    old = tmp_path / "charts" / "timing-of-last-year.png"
    old.write_bytes(b"")
    assert main(["report", str(folder), "--out", str(tmp_path)]) == 0
    assert not old.exists()
    assert (tmp_path / "report.html").exists()
    assert list((tmp_path / "charts").glob("*.png"))


@pytest.fixture
def read_only(folder, monkeypatch):
    """The folder as on a disk that takes nothing, for whoever runs the test."""
    from pathlib import Path

    def refused(*_, **__):
        raise OSError(30, "Read-only file system")

    paths = [folder, *folder.rglob("*")]
    modes = {path: path.stat().st_mode for path in paths}
    for path in paths:
        path.chmod(stat.S_IMODE(modes[path]) & ~0o222)
    if os.access(folder, os.W_OK):  # root may write all the same
        monkeypatch.setattr(Path, "mkdir", refused)
        monkeypatch.setattr("jaxclay.files.replacing.os.open", refused)
    yield folder
    for path in paths:
        path.chmod(stat.S_IMODE(modes[path]))


def test_a_finished_sweep_on_a_read_only_disk_is_no_failure(read_only, capsys):
    experiment = read_only.parent / "settings.toml"
    assert main(["sweep", str(experiment), "--out", str(read_only), "--quiet"]) == 0
    assert "8 of them done before" in capsys.readouterr().out
    assert len(run(experiment, read_only)) == 8


@pytest.mark.parametrize("closed", ["2>&-", ">&- 2>&-"])
def test_closed_streams_are_no_error(folder, closed):
    experiment = folder.parent / "settings.toml"
    command = f'"{sys.executable}" -c "{COMMAND}" sweep "{experiment}" --out "{folder}" {closed}'
    done = subprocess.run(
        ["sh", "-c", command], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_folder_that_is_named_is_the_one_that_is_reported(tmp_path, folder, capsys):
    experiment, out = folder.parent / "settings.toml", tmp_path / "x"
    assert main(["sweep", str(experiment), "--out", str(out), "--quiet"]) == 0
    said = capsys.readouterr().out
    assert re.search(rf"all 8 tasks are in {out} .*jaxclay report {out}$", said.strip())


def test_a_folder_of_profiles_takes_every_ending_and_no_hidden_file(tmp_path):
    pot = "height,radius\n0,1\n1,1\n"
    for name in ("pot.csv", "JUG.CSV"):
        (tmp_path / name).write_text(pot)
    (tmp_path / "._pot.csv").write_bytes(b"\x00\x05\x16\x07")
    (tmp_path / "notes.txt").write_text("none")
    assert [path.rsplit("/", 1)[1] for path in files_of(tmp_path)] == ["JUG.CSV", "pot.csv"]
    path = tmp_path / "glob.toml"
    path.write_text(SETTINGS.replace("cylinders = { radius = [0.4, 0.5] }", 'profiles = ["*.csv"]'))
    assert len(read_experiment(path).scenes[0].profiles) == 2
    out = str(tmp_path / "out")
    assert main(["sweep", str(path), "--out", out, "--dry-run", "--profiles", str(tmp_path)]) == 0


@pytest.fixture
def pots(tmp_path):
    """A folder of two profiles and one that is none, and an experiment that names all of them."""
    folder = tmp_path / "pots"
    folder.mkdir()
    (folder / "cup.csv").write_text("z;d\n0;8,0\n2;11,0\n4;9,0\n")
    (folder / "pot.csv").write_text("height,radius\n0,1\n1,1\n")
    (folder / "jug.csv").write_text("height,radius\n0,1\n1,nan\n2,1\n")
    path = tmp_path / "glob.toml"
    text = SETTINGS.replace("cylinders = { radius = [0.4, 0.5] }", 'profiles = ["pots/*.csv"]')
    path.write_text(text)
    return path


@pytest.mark.parametrize("added", [False, True])
def test_a_file_that_is_no_profile_is_named_and_left_out(pots, capsys, added):
    command = ["sweep", str(pots), "--out", str(pots.parent / "out"), "--dry-run"]
    command += ["--profiles", str(pots.parent / "pots")] if added else []
    assert main(command) == 0
    said = capsys.readouterr()
    assert re.search(r"left out \S*jug\.csv: line 3: radius 'nan'", said.err)
    assert re.search(
        r"cup\.csv: read 3 rows: semicolons, decimal commas, z as height and", said.err
    )
    assert re.search(r"\(\d+ scenes", said.out)
    assert main([*command, "--strict"]) == 2
    assert re.search(r"error: \S*jug\.csv: line 3: radius 'nan'", capsys.readouterr().err)


def test_the_comparison_leaves_out_what_is_no_profile_or_stops(pots, capsys):
    folder = pots.parent / "pots"
    with pytest.warns(RefusedProfile, match="jug.csv"):
        edited = comparison(scenes=["cup-middle", "pot-shoulder"], profiles=folder)
    assert len(edited.experiment.parts[0].scenes) == 2
    command = ["compare", "--out", str(pots.parent / "out"), "--profiles", str(folder)]
    assert main([*command, "--strict"]) == 2
    assert re.search(r"error: \S*jug\.csv: line 3", capsys.readouterr().err)
    assert not (pots.parent / "out").exists()


@pytest.mark.parametrize("depth", [100, 900, 100_000])
@pytest.mark.parametrize("brackets", ["[]", "{}"])
def test_brackets_within_brackets_are_refused_in_words(tmp_path, depth, brackets):
    opening, closing = ("[", "]") if brackets == "[]" else ("{a=", "}")
    path = tmp_path / "deep.toml"
    path.write_text(f"slices = {opening * depth}8{closing * depth}\n" + SETTINGS.split("\n", 2)[2])
    with pytest.raises(ValueError, match=r"deep\.toml: "):
        read_experiment(path)


def test_all_settings_of_a_ladder_do_not_become_a_column_each():
    rows = pd.DataFrame({"family": "newton", "settings": [f"tolerance=1e-{i}" for i in range(8)]})
    assert set(told_apart(rows).series) == {"newton"}
    assert jaxclay.METHODS["newton"]
