"""The command line as its user meets it: what it prints, writes, refuses, and leaves behind."""

import csv
import json
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
from jaxclay.files.piece import load_piece
from jaxclay.files.profiles import loaded

SQUASH = "0.9:1.35:1.6"


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    """Commands keep compilations under XDG_CACHE_HOME; tests must not touch the user's."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path_factory.getbasetemp() / "cache"))


def rows(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def test_deform_writes_a_contour_of_the_same_volume(tmp_path, capsys):
    out, piece = tmp_path / "shape.csv", tmp_path / "shape.json"
    written = ["--out", str(out), "--piece", str(piece)]
    code = main(["deform", "teapot", "--squash", SQUASH, "--squash", "0:0.3:1.4", *written])
    printed = capsys.readouterr().out
    assert code == 0
    assert printed.count("converged") == 2
    for word in ("case I", "E_total", "height", "volume", "reach"):
        assert word in printed
    before = jaxclay.load_profile("teapot").volume
    assert jaxclay.load_profile(piece).volume == pytest.approx(before, rel=1e-13)
    y, X = (np.array([float(r[name]) for r in rows(out)]) for name in ("height", "radius"))
    frusta = np.pi / 3 * np.diff(y) * (X[1:] ** 2 + X[1:] * X[:-1] + X[:-1] ** 2)
    assert frusta.sum() == pytest.approx(before, rel=1e-3)  # the tolerance


@pytest.mark.core
def test_deform_does_what_the_library_does(tmp_path):
    out, piece = tmp_path / "shape.csv", tmp_path / "shape.json"
    arguments = ["--squash", "0:0.1:0.2", "--mu", "0.5", "--slices", "64"]
    main(["deform", "bowl", *arguments, "--out", str(out), "--piece", str(piece)])
    material = jaxclay.Material.from_snake_units(mu=0.5)
    expected = jaxclay.deform(
        jaxclay.load_profile("bowl"), jaxclay.Squash(0, 0.1, 0.2), material, slices=64
    ).clay
    found = load_piece(piece)
    for name in ("material", "heights", "thickness", "edges", "r0", "unit"):
        np.testing.assert_array_equal(getattr(found.clay, name), getattr(expected, name))
    assert found.material == material
    assert len(rows(out)) < 64 + 8  # a slice each, edges and ends


@pytest.mark.parametrize("tolerance", [None, 1e-4])
def test_deform_to_a_tolerance_is_the_librarys(tmp_path, capsys, tolerance):
    out, piece = tmp_path / "shape.csv", tmp_path / "shape.json"
    arguments = ["--squash", "0:0.1:0.2", "--out", str(out), "--piece", str(piece)]
    arguments += [] if tolerance is None else ["--tolerance", str(tolerance)]
    main(["deform", "bowl", *arguments])
    squash, material = jaxclay.Squash(0, 0.1, 0.2), jaxclay.Material.from_snake_units()
    clay, error = loaded("bowl")
    expected = jaxclay.deform(clay, squash, material, tolerance=tolerance or 1e-3)
    np.testing.assert_array_equal(jaxclay.load_profile(piece).heights, expected.clay.heights)
    total = error + float(expected.error_estimate)
    assert f"contour within {total:.1e} of the height" in capsys.readouterr().out
    # The table alone has that contour within the same.
    again = jaxclay.load_profile(out)
    assert jaxclay.contour_error(again, expected.clay) < (tolerance or 1e-3) / 10


def test_deform_as_in_1993_is_the_papers_scheme(tmp_path):
    out, piece = tmp_path / "shape.csv", tmp_path / "shape.json"
    written = ["--out", str(out), "--piece", str(piece)]
    main(["deform", "bowl", "--squash", "0:0.1:0.2", "--scheme", "paper", *written])
    squash, material = jaxclay.Squash(0, 0.1, 0.2), jaxclay.Material.from_snake_units()
    clay = jaxclay.load_profile("bowl", 64)
    expected = jaxclay.deform(clay, squash, material, scheme="paper")
    found = jaxclay.load_profile(piece)
    np.testing.assert_allclose(found.heights, expected.heights, atol=2e-6)  # of finer slices


@pytest.mark.parametrize("base", [0, 60])
def test_deform_goes_on_from_a_piece_as_in_one_succession(tmp_path, base):
    """Bit for bit, and in the heights of the file that it began with."""
    pot = tmp_path / "pot.csv"
    y = np.linspace(0, 100, 30)
    lines = [f"{base + a:.3f},{30 + 10 * np.sin(a / 30):.3f}" for a in y]
    pot.write_text("\n".join(["height (mm),radius (mm)", *lines]))
    one, two = f"{base + 40}:{base + 60}:25", f"{base}:{base + 20}:28"
    first, second, both = (tmp_path / name for name in ("1", "2", "both"))

    def run(source, target, *squashes):
        squashes = [word for squash in squashes for word in ("--squash", squash)]
        files = ["--out", f"{target}.csv", "--piece", f"{target}.json"]
        assert main(["deform", str(source), *squashes, *files, "--mu", "0.3"]) == 0

    run(pot, first, one)
    run(f"{first}.json", second, two)
    run(pot, both, one, two)
    for ending in (".json", ".csv"):
        texts = [target.with_suffix(ending).read_text() for target in (second, both)]
        assert texts[0] == texts[1]
    assert json.loads(second.with_suffix(".json").read_text())["heights"][0] == base
    assert second.with_suffix(".csv").read_text().startswith(f"height_mm,radius_mm\n{base},")


@pytest.fixture
def standing(tmp_path):
    """A pot whose heights begin at 60."""
    pot = tmp_path / "pot.csv"
    pot.write_text("height;radius\n60;200\n150;220\n250;180\n340,5;150\n")
    return pot


def test_heights_are_the_files(tmp_path, standing, capsys):
    out, plot = tmp_path / "out.csv", tmp_path / "out.svg"
    squash = ["--squash", "100:150:150"]
    assert main(["deform", str(standing), *squash, "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert said.err.strip() == (
        f"{standing}: read 4 rows: semicolons, decimal commas, height and radius, standing at 60"
    )
    assert re.search(r"band 100 to 150,", said.out)
    assert re.search(r"height \S+ \(60 to \d", said.out)
    table = np.genfromtxt(out, delimiter=",", skip_header=1)
    assert table[0, 0] == 60
    inside = (table[:, 0] > 100) & (table[:, 0] < 150)
    np.testing.assert_allclose(table[inside, 1], 150, rtol=1e-9)
    assert (table[table[:, 0] < 90, 1] > 190).all()
    pytest.importorskip("matplotlib").use("Agg")
    assert main(["deform", str(standing), *squash, "--out", str(out), "--plot", str(plot)]) == 0
    assert "<!-- 100 -->" in plot.read_text()  # a label of the axis
    assert "<!-- 0 -->" in plot.read_text()  # of radii, and no other
    assert plot.read_text().count("<!-- 0 -->") == 1


BELOW = {
    "20:50:150": "20:50:150: bottom = 20 is below the piece, which stands at 60: .* the file's",
    "400:500:150": r"400:500:150: .* bottom = 400, above the clay: .* below its top at 340\.5",
    "150:100:150": "150:100:150: the band is empty: .* bottom = 150, got 100",
    "nan:100:150": "nan:100:150: the band is empty: bottom and top must be finite",
}


@pytest.mark.parametrize("squash", BELOW)
def test_what_does_not_fit_is_refused_in_the_files_heights(tmp_path, standing, capfd, squash):
    out = tmp_path / "out.csv"
    assert main(["deform", str(standing), "--squash", squash, "--out", str(out)]) == 2
    assert re.search(BELOW[squash], capfd.readouterr().err)
    fixed = ["--squash", "100:400:150", "--top-fixed"]
    assert main(["deform", str(standing), *fixed, "--out", str(out)]) == 2
    assert re.search("held at 340.5, .* top = 400: .* below 340.5", capfd.readouterr().err)


def test_heights_below_0(tmp_path, capsys):
    pot, out = tmp_path / "pot.csv", tmp_path / "out.csv"
    pot.write_text("height,radius\n-60,39\n-30,60\n0,40\n")
    for squash in (["--squash=-50:-30:45"], ["--squash", "-50:-30:45"]):
        assert main(["deform", str(pot), *squash, "--out", str(out)]) == 0
        assert "band -50 to -30" in capsys.readouterr().out
    assert rows(out)[0]["height"] == "-60"


def test_columns_and_unit_as_asked(tmp_path, capsys):
    pot, out, svg = (tmp_path / name for name in ("pot.csv", "out.csv", "out.svg"))
    pot.write_text("a,b\n0,3\n4,4\n8,3\n")
    arguments = ["deform", str(pot), "--squash", "2:4:2.8", "--out", str(out)]
    assert main(arguments) == 2
    assert "say which two are, --columns HEIGHT,RADIUS" in capsys.readouterr().err
    assert main([*arguments, "--columns", "a,b", "--unit", "cm", "--svg", str(svg)]) == 0
    assert "a as height and b as radius in cm" in capsys.readouterr().err
    found = rows(out)
    assert list(found[0]) == ["height_cm", "radius_cm"]
    size = float(re.search(r'height="([\d.]+)mm"', svg.read_text())[1])
    assert size == pytest.approx(10 * float(found[-1]["height_cm"]), rel=1e-6)  # true size


def test_a_piece_keeps_its_material(tmp_path, capsys):
    piece, second = tmp_path / "a.json", tmp_path / "b.json"
    written = ["--squash", "0:0.1:0.2", "--out", str(tmp_path / "a.csv")]
    assert main(["deform", "bowl", *written, "--mu", "0.25", "--piece", str(piece)]) == 0
    again = ["deform", str(piece), *written, "--piece", str(second)]
    assert main([*again, "--k", "2"]) == 0
    material = jaxclay.Material.from_snake_units(mu=0.25, k=2.0)
    assert load_piece(second).material == material
    assert main([*again, "--units", "printed"]) == 2
    assert "the material is the piece's" in capsys.readouterr().err
    assert main([*again, "--beta", "0.5", "--units", "printed"]) == 0
    assert load_piece(second).material.beta == 0.5
    assert load_piece(second).material.alpha == material.alpha


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
    "piece's name": (["teapot", "--squash", SQUASH, "--piece", "a.csv"], "must end in .json"),
    "unit of no table": (["teapot", "--squash", SQUASH, "--unit", "mm"], "teapot is no table"),
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


def test_a_pointed_tip_is_clipped_and_told(tmp_path, capfd):
    cone, out = tmp_path / "cone.csv", tmp_path / "out.csv"
    cone.write_text("height,radius\n0,1\n1,1\n2,0\n")
    arguments = ["deform", str(cone), "--squash", "0:0.5:0.8", "--out", str(out)]
    assert main(arguments) == 0
    assert "radius 0 at the top clipped to the floor 0.03" in capfd.readouterr().err
    assert main([*arguments, "--minimum-radius", "0.1"]) == 0
    assert "radii below 0.1 raised to it" in capfd.readouterr().err


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
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)  # which would hold the programs already
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


@pytest.mark.parametrize("kind", ["stl", "obj", "glb"])
def test_deform_writes_a_body_in_millimetres(tmp_path, kind):
    trimesh = pytest.importorskip("trimesh")
    paths = [str(tmp_path / name) for name in ("shape.csv", f"shape.{kind}")]
    squash = ["--squash", "0:0.3:0.3", "--tolerance", "1e-3"]
    assert main(["deform", "amphora", *squash, "--out", paths[0], "--mesh", paths[1]]) == 0
    mesh = trimesh.load(paths[1], force="mesh")
    assert mesh.is_watertight
    clay = jaxclay.load_profile(paths[0])
    assert mesh.volume == pytest.approx(float(clay.volume) * 1e6, rel=1e-3)


def test_deform_refuses_a_mesh_before_it_solves(tmp_path, capsys):
    given = ["deform", "amphora", "--squash", "0:0.3:0.3", "--out", str(tmp_path / "a.csv")]
    assert main([*given, "--mesh", str(tmp_path / "a.ply")]) == 2
    assert "must end in .stl" in capsys.readouterr().err
    assert main([*given, "--wall", "2"]) == 2
    assert "belongs to --mesh" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
