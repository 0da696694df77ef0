"""Every kind of entry of an experiment file, alone where it is refused and all of them at once."""

import numpy as np
import pytest
from scenes import cylinder_problem

import jaxclay

pd = pytest.importorskip("pandas")
pytest.importorskip("pydantic")
tomlkit = pytest.importorskip("tomlkit")
pytest.importorskip("matplotlib").use("Agg")

from jaxclay.cli.main import main  # noqa: E402
from jaxclay.experiments import load_curves, run  # noqa: E402
from jaxclay.experiments.entries.reading import (  # noqa: E402
    checked,
    raw_experiment,
    read_experiment,
)
from jaxclay.experiments.entries.tasks import tasks  # noqa: E402

EVERYTHING = """\
kind = "timing"
seed = 3
repeats = 1
continuum = 64

[[discretisations]]
scheme = "paper"
slices = 40

[[methods]]
name = "newton"

[[methods]]
name = "greedy"
settings = { step = [1e-2, 1e-3] }

[[parts]]
scenes = [
    { names = ["reference"], units = ["snake", "move"] },
    { profiles = ["bowl"], places = ["middle", "shoulder"], minimum_radius = 0.1 },
]

[[parts]]
[[parts.scenes]]
draws = 2
cylinders = { radius = { uniform = [0.4, 0.6] }, height = 2.0 }
squash = { bottom = 0.0, height = 0.4, ratio = 0.8 }

[[parts.scenes]]
cylinders = { radius = 0.5 }
squash = { bottom = 0.0, height = 0.6, displacement = [0.1, 0.2] }
material = { mu = [0.5, 1.0, 2.0] }

[[parts]]
scenes = [{ names = ["reference"] }]
methods = [{ name = "newton" }, { name = "lbfgs-preconditioned" }]
discretisations = [
    { scheme = "slices", spacing = "equal", slices = 16 },
    { scheme = "slices", slices = 32 },
    { scheme = "slices", tolerance = 1e-2 },
    { scheme = "spline", degree = [3, 5], elements = 2 },
]

[[parts]]
ladder = true
scenes = [{ names = ["reference"] }]
methods = [{ name = "newton" }]

[[parts]]
first_answers = true
scenes = [{ names = ["fig4a"] }]
methods = [{ name = "newton" }]

[[parts]]
stops = [1, 2]
scenes = [{ names = ["reference"] }]
methods = [{ name = "newton" }, { name = "ipopt" }]

[[parts]]
budget = 0.01
precisions = ["float32", "float64"]
coarse_to_fine = true
scenes = [{ names = ["reference"] }]
discretisations = [{ scheme = "paper", slices = [8, 16] }]
methods = [{ name = "newton" }, { name = "greedy-refined" }]
"""


@pytest.fixture(scope="module")
def everything(tmp_path_factory):
    pytest.importorskip("casadi")
    folder = tmp_path_factory.mktemp("everything")
    (folder / "everything.toml").write_text(EVERYTHING)
    return run(folder / "everything.toml", folder / "out"), folder


@pytest.mark.slow
def test_all_entries_at_once_give_their_rows(everything):
    table, _ = everything
    assert (
        not (table.status == "skipped")
        .drop(table.index[table.reason.fillna("").str.startswith("out of time")])
        .any()
    )
    assert set(table.method) == {
        "newton", "greedy", "lbfgs-preconditioned", "ipopt", "greedy-refined"
    }  # fmt: skip
    assert set(table.precision) == {"float64", "float32"}
    assert set(table.scheme) == {"paper", "slices", "spline"}
    assert set(table.spacing) == {"", "equal", "placed"}
    assert set(table.degree) == {0, 3, 5}
    assert set(table.tolerance) == {0, 1e-2}
    assert set(table.budget) == {0, 0.01}
    assert set(table.units) == {"snake", "move"}
    assert set(table.place) == {"", "middle", "shoulder"}
    newton = table[(table.method == "newton") & (table.precision == "float64")]
    own = newton[(newton.settings == "") & (newton.budget == 0)]
    assert (own.status == "converged").all()
    assert own.contour_error_continuum.notna().all()
    assert list(table.scene[table.first_s.notna()]) == ["fig4a"]
    assert set(newton.settings) >= {f"tolerance={rung:g}" for rung in (1e-2, 1e-6, 1e-11)}
    drawn = table[(table.height == 2.0)]
    assert drawn.radius.between(0.4, 0.6).all()


@pytest.mark.slow
def test_they_make_one_report_and_curves(everything):
    _, folder = everything
    assert main(["report", str(folder / "out"), "--out", str(folder / "report")]) == 0
    page = (folder / "report" / "report.html").read_text(encoding="utf-8")
    for word in ("newton (splines)", "newton (placed slices)", "float32", "casadi", "ipopt"):
        assert word in page
    pictures = {path.stem for path in (folder / "report" / "charts").glob("*.png")}
    assert "timing-map-displacement-mu-snake-40" in pictures
    curves = load_curves(folder / "out")
    assert np.isfinite(curves.trace_s.values).any()
    assert np.isfinite(curves.before_radius.values).any()


@pytest.mark.slow
def test_they_run_on_where_they_were(everything):
    table, folder = everything
    again = run(folder / "everything.toml", folder / "out")
    pd.testing.assert_frame_equal(again, table)


def test_a_budget_ends_a_solve_that_would_go_on(tmp_path):
    path = tmp_path / "late.toml"
    path.write_text(
        'kind = "timing"\nrepeats = 1\nbudget = 0.006\nscenes = [{ names = ["reference"] }]\n'
        'discretisations = [{ scheme = "paper", slices = 64 }]\n'
        '[[methods]]\nname = "adam"\nsettings = { max_iterations = [3, 1000000] }\n'
    )
    table = run(path, tmp_path / "out").set_index("settings")
    assert table.loc["max_iterations=3"].status == "iteration limit"
    late = table.loc["max_iterations=1e+06"]
    assert late.status == "out of time"
    assert 0.9 * 0.006 <= late.solve_s < 1.0
    assert 0 < late.iterations < 1_000_000


@pytest.mark.slow
def test_float32_is_what_the_loop_gives_in_float32(everything):
    table, _ = everything
    row = table[(table.precision == "float32") & (table.method == "newton")].iloc[0]
    best = jaxclay.minimize(cylinder_problem(slices=int(row.slices)))
    assert row.energy_minimum == pytest.approx(float(best.energy), rel=1e-9)
    assert row.energy > row.energy_minimum


HEAD = 'kind = "timing"\nscenes = [{ names = ["reference"] }]\nmethods = [{ name = "newton" }]\n'
REFUSED = {
    'discretisations = [{ scheme = "paper" }]': "needs slices",
    'discretisations = [{ scheme = "spline" }]': "needs elements",
    'discretisations = [{ scheme = "paper", elements = 4 }]': "takes slices, not elements",
    'discretisations = [{ scheme = "slices", slices = 8, tolerance = 1e-3 }]': "one of them",
    'discretisations = [{ scheme = "slices", spacing = "equal", tolerance = 1e-3 }]': "leave spac",
    "slices = 8\nparts = [{}]": "line 4: slices: beside discretisations or parts",
    "budget = 0": "line 4: budget: .*greater than 0",
    'precisions = ["float16"]': "line 4: precisions: .*'float64' or 'float32'",
    'call = "solve"': "line 4: call: .*'minimize' or 'deform'",
    "parts = [{ colour = 1 }]": "line 4: parts.colour: unknown key: choose from .*coarse_to_fine",
    "parts = [{ first = 0 }]": "line 4: parts.first: .*greater than or equal to 1",
}


@pytest.mark.parametrize("text", REFUSED)
def test_what_does_not_go_together_is_refused_with_its_line(read, text):
    with pytest.raises(ValueError, match=REFUSED[text]):
        read(HEAD + text + "\n")


@pytest.mark.parametrize("entry", ["budget = 1.0", "first_answers = true", "stops = [1]"])
def test_what_belongs_to_timing_is_refused_of_throughput(read, entry):
    text = HEAD.replace("timing", "throughput") + f"parts = [{{ {entry} }}]\n"
    with pytest.raises(ValueError, match='belongs to kind = "timing"'):
        read(text)


@pytest.mark.parametrize("name", ["compare", "atlas", "accuracy", "paper"])
def test_tables_written_out_are_read_as_the_same_experiment(name, tmp_path):
    raw = raw_experiment(name)
    path = tmp_path / "again.toml"
    path.write_text(tomlkit.dumps(raw))
    found = [
        {task.key for task in tasks(one)}
        for one in (checked(raw, path, tomlkit.dumps(raw)), read_experiment(path))
    ]
    assert found[0] == found[1]
