"""The command line as its user meets it: what it prints, writes, refuses, and leaves behind."""

import csv
import os
import re
import signal
import subprocess
import sys
import time

import jax
import numpy as np
import pytest

import jaxclay
from jaxclay.cli.main import main
from jaxclay.files.profiles import loaded

SQUASH = "0.9:1.35:1.6"


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    """Commands keep compilations under XDG_CACHE_HOME; tests must not touch the user's."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / "cache"))


def rows(path):
    with path.open() as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def test_deform_writes_a_contour_of_the_same_volume(tmp_path, capsys):
    out = tmp_path / "shape.csv"
    code = main(
        ["deform", "teapot", "--squash", SQUASH, "--squash", "0:0.3:1.4", "--out", str(out)]
    )
    printed = capsys.readouterr().out
    assert code == 0
    assert printed.count("converged") == 2
    for word in ("case I", "E_total", "height", "volume", "reach"):
        assert word in printed
    before = jaxclay.load_profile("teapot", 64).volume
    assert jaxclay.load_profile(out).volume == pytest.approx(before, rel=1e-13)
    y, X = (np.array([float(r[name]) for r in rows(out)]) for name in ("height", "radius"))
    frusta = np.pi / 3 * np.diff(y) * (X[1:] ** 2 + X[1:] * X[:-1] + X[:-1] ** 2)
    assert frusta.sum() == pytest.approx(before, rel=2e-3)  # of second order in 1/64


def test_deform_on_slices_writes_their_volume(tmp_path):
    out = tmp_path / "shape.csv"
    main(["deform", "teapot", "--squash", SQUASH, "--slices", "64", "--out", str(out)])
    volume = sum(np.pi * float(r["radius"]) ** 2 * float(r["thickness"]) for r in rows(out))
    np.testing.assert_allclose(volume, jaxclay.load_profile("teapot").volume, rtol=1e-13)
    assert len(rows(out)) < 64 + 8  # a slice each, edges and ends


@pytest.mark.core
def test_deform_does_what_the_library_does(tmp_path):
    out = tmp_path / "shape.csv"
    main(["deform", "bowl", "--squash", "0:0.1:0.2", "--mu", "0.5", "--out", str(out)])
    material = jaxclay.Material.from_snake_units(mu=0.5)
    expected = jaxclay.deform(
        jaxclay.load_profile("bowl"), jaxclay.Squash(0, 0.1, 0.2), material, slices=64
    ).clay
    found = jaxclay.load_profile(out)
    for name in ("material", "heights", "thickness", "edges", "r0", "unit"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


def test_deform_to_a_tolerance_is_the_librarys(tmp_path, capsys):
    out = tmp_path / "shape.csv"
    arguments = ["--squash", "0:0.1:0.2", "--tolerance", "1e-3", "--out", str(out)]
    main(["deform", "bowl", *arguments])
    squash, material = jaxclay.Squash(0, 0.1, 0.2), jaxclay.Material.from_snake_units()
    clay, error = loaded("bowl")
    expected = jaxclay.deform(clay, squash, material, tolerance=1e-3)
    np.testing.assert_array_equal(jaxclay.load_profile(out).heights, expected.heights)
    total = error + float(expected.error_estimate)
    assert f"contour within {total:.1e} of the height" in capsys.readouterr().out


def test_deform_as_in_1993_is_the_papers_scheme(tmp_path):
    out = tmp_path / "shape.csv"
    main(["deform", "bowl", "--squash", "0:0.1:0.2", "--scheme", "paper", "--out", str(out)])
    squash, material = jaxclay.Squash(0, 0.1, 0.2), jaxclay.Material.from_snake_units()
    clay = jaxclay.load_profile("bowl", 64)
    expected = jaxclay.deform(clay, squash, material, scheme="paper")
    np.testing.assert_allclose(jaxclay.load_profile(out).heights, expected.heights, atol=1e-12)


def test_deform_goes_on_from_its_own_file_as_in_one_succession(tmp_path):
    first, second, both = (tmp_path / name for name in ("1.csv", "2.csv", "both.csv"))
    one, two = "0.9:1.35:1.6", "0:0.3:1.4"
    main(["deform", "teapot", "--squash", one, "--out", str(first)])
    main(["deform", str(first), "--squash", two, "--out", str(second)])
    main(["deform", "teapot", "--squash", one, "--squash", two, "--out", str(both)])
    assert second.read_text() == both.read_text()


def test_deform_plots(tmp_path):
    pytest.importorskip("matplotlib").use("Agg")
    out, plot, svg = (tmp_path / name for name in ("shape.csv", "shape.png", "shape.svg"))
    written = ["--out", str(out), "--plot", str(plot), "--svg", str(svg), "--millimetres", "50"]
    assert main(["deform", "bowl", "--squash", "0:0.1:0.2", *written]) == 0
    assert plot.read_bytes().startswith(b"\x89PNG")
    height = float(re.search(r'height="([\d.]+)mm"', svg.read_text())[1])
    assert height == pytest.approx(50 * float(jaxclay.load_profile(out).height), abs=1.0)


BAD = {
    "no such profile": (["jug", "--squash", SQUASH], "jug.*teapot"),
    "no such file": (["no.csv", "--squash", SQUASH], "no.csv"),
    "not a squash": (["teapot", "--squash", "1:2"], "1:2.*BOTTOM:TOP:RADIUS"),
    "not numbers": (["teapot", "--squash", "a:b:c"], "a:b:c"),
    "empty band": (["teapot", "--squash", "1:1:1"], "empty.*1"),
    "band above the clay": (["teapot", "--squash", "9:10:1"], "bottom = 9.*2.25"),
    "radius": (["teapot", "--squash", "0:1:-2"], "radius.*-2"),
    "too few nodes": (
        ["teapot", "--squash", "1:1.001:1.5", "--slices", "64", "--scheme", "paper"],
        r"at least \d+ slices",
    ),
    "tolerance": (["teapot", "--squash", SQUASH, "--tolerance", "0"], "tolerance.*1e-09"),
    "tolerance and slices": (
        ["teapot", "--squash", SQUASH, "--tolerance", "1e-3", "--slices", "64"],
        "one or the other",
    ),
    "coarser than the tolerance": (
        ["teapot", "--squash", SQUASH, "--tolerance", "1e-5"],
        "teapot in 2048 slices .*1.7e-05.* ask for 1.8e-05",
    ),
    "held end": (["teapot", "--squash", "1:3:1.5", "--top-fixed"], "no room.*3"),
    "no room for the lower bound": (
        ["teapot", "--squash", "0:2.24:1.5", "--top-fixed"],
        r"infeasible.*Above top are 0\.01.*at least",
    ),
    "too many slices": (
        ["teapot", "--squash", SQUASH, "--slices", "99999"],
        "at most 65536.*99999",
    ),
    "tool at a folder": (["teapot", "--squash", SQUASH, "--plot", "."], "folder"),
    "unknown picture": (["teapot", "--squash", SQUASH, "--plot", "a.xyz"], "a.xyz.*png"),
    "method": (["teapot", "--squash", SQUASH, "--method", "magic"], "magic.*newton"),
    "material": (["teapot", "--squash", SQUASH, "--k", "-1"], "k must be positive.*-1"),
    "slices": (["teapot", "--squash", SQUASH, "--slices", "2"], "at least 3.*2"),
}


@pytest.mark.parametrize(("arguments", "message"), BAD.values(), ids=BAD.keys())
def test_bad_input_is_one_error_code_2_and_no_file(tmp_path, capfd, arguments, message):
    out = tmp_path / "shape.csv"
    assert main(["deform", *arguments, "--out", str(out)]) == 2
    error = capfd.readouterr().err.strip()
    assert error.startswith("jaxclay deform: error:")
    assert len(error.splitlines()) == 1
    assert re.search(message, error)
    assert list(tmp_path.iterdir()) == []


def test_a_failing_squash_leaves_the_old_file(tmp_path):
    out = tmp_path / "shape.csv"
    out.write_text("precious")
    assert main(["deform", "teapot", "--squash", "0:1:-2", "--out", str(out)]) == 2
    assert out.read_text() == "precious"
    assert [path.name for path in tmp_path.iterdir()] == ["shape.csv"]


def test_a_folder_that_is_not_there_is_named_before_any_solve(tmp_path, capfd):
    out = tmp_path / "nowhere" / "shape.csv"
    assert main(["deform", "teapot", "--squash", SQUASH, "--out", str(out)]) == 2
    assert "nowhere" in capfd.readouterr().err


def test_out_and_plot_must_differ(tmp_path, capfd):
    out = tmp_path / "same.png"
    code = main(["deform", "bowl", "--squash", "0:0.1:0.2", "--out", str(out), "--plot", str(out)])
    assert code == 2
    assert "same file" in capfd.readouterr().err
    assert not out.exists()


def test_a_pointed_tip_is_clipped_where_asked(tmp_path, capfd):
    cone, out = tmp_path / "cone.csv", tmp_path / "out.csv"
    cone.write_text("height,radius\n0,1\n1,1\n2,0\n")
    arguments = ["deform", str(cone), "--squash", "0:0.5:0.8", "--out", str(out)]
    assert main(arguments) == 2
    assert "minimum_radius" in capfd.readouterr().err
    assert main([*arguments, "--minimum-radius", "0.1"]) == 0


def test_a_bad_line_of_a_file_is_named(tmp_path, capfd):
    jug, out = tmp_path / "jug.csv", tmp_path / "out.csv"
    jug.write_text("height,radius\n0,1\n1,wide\n")
    assert main(["deform", str(jug), "--squash", "0:0.5:0.8", "--out", str(out)]) == 2
    assert re.search("jug.csv: line 3.*wide", capfd.readouterr().err)
    assert not out.exists()


FAULTS = [
    jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED: out of memory"),
    RecursionError("maximum recursion depth exceeded"),
    np.linalg.LinAlgError("Singular matrix"),
    TypeError("unsupported operand"),
    ValueError("operands could not be broadcast together"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: type(fault).__name__)
def test_a_fault_inside_is_not_told_as_bad_input(tmp_path, capfd, monkeypatch, fault):
    def broken(*_, **__):
        raise fault

    monkeypatch.setattr("jaxclay.cli.deform.deform", broken)
    out = tmp_path / "shape.csv"
    assert main(["deform", "bowl", "--squash", "0:0.1:0.2", "--out", str(out)]) == 70
    error = capfd.readouterr().err
    assert "Traceback" in error
    assert str(fault) in error
    assert "error: " + str(fault) not in error.splitlines()[-1]
    assert not out.exists()


def test_what_python_refuses_of_the_package_is_a_fault_too(tmp_path, capfd, monkeypatch):
    """No frame of a library's tells it from a refusal: int raises in the package's own."""
    monkeypatch.setattr("jaxclay.cli.deform.parse_squash", int)
    assert main(["deform", "bowl", "--squash", "0:1:2", "--out", str(tmp_path / "a.csv")]) == 70
    assert "invalid literal" in capfd.readouterr().err


def test_what_the_package_itself_refuses_at_run_time_is_bad_input(tmp_path, capfd, monkeypatch):
    """Here a squash of a session that does not converge; raise_for_status says why."""
    deform = jaxclay.deform

    def strict(*arguments, **settings):
        return deform(*arguments, **settings, max_iterations=1).raise_for_status()

    monkeypatch.setattr("jaxclay.cli.deform.deform", strict)
    out = str(tmp_path / "shape.csv")
    assert main(["deform", "bowl", "--squash", "0:0.1:0.2", "--method", "adam", "--out", out]) == 2
    assert "error: adam: iteration limit" in capfd.readouterr().err


def test_ctrl_c_ends_with_130_and_no_file(tmp_path):
    """A fresh process, since it is killed while it compiles."""
    out = tmp_path / "shape.csv"
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    command = [sys.executable, "-c", "from jaxclay.cli.main import entry; entry()", "deform"]
    squashes = ["--squash", SQUASH] * 20
    arguments = [*command, "teapot", *squashes, "--slices", "301", "--out", str(out)]
    process = subprocess.Popen(
        arguments, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    while not list((tmp_path / "cache").rglob("*-cache")) and process.poll() is None:
        time.sleep(0.01)  # until the first program has been compiled; the next follows
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=120)
    assert process.returncode == 130, error
    assert b"interrupted" in error
    assert not out.exists()


def test_argparse_refuses_with_2():
    with pytest.raises(SystemExit) as ended:
        main(["deform", "teapot"])
    assert ended.value.code == 2
