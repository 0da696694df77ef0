"""Speed against accuracy: what a row says, what is timed, limits, extrapolation, the picture."""

from pathlib import Path

import numpy as np
import pytest

import jaxclay

pd = pytest.importorskip("pandas")
pytest.importorskip("pydantic")
pytest.importorskip("matplotlib").use("Agg")
pytest.importorskip("rich")

import matplotlib.pyplot as plt  # noqa: E402

from jaxclay.experiments import run  # noqa: E402
from jaxclay.experiments.charts.population import (  # noqa: E402
    accuracy_charts,
    points,
    speed_and_accuracy,
)
from jaxclay.experiments.charts.shared import prepared  # noqa: E402
from jaxclay.experiments.entries.tasks import tasks  # noqa: E402

SCRIPTS = Path(__file__).parents[2] / "scripts" / "benchmarks"

SMALL = """\
kind = "timing"
call = "deform"
repeats = 3
continuum = 512

[[scenes]]
cylinders = { radius = 0.5 }
squash = { bottom = 0.0, height = [0.25, 0.45], ratio = 0.8 }

[[methods]]
name = "newton"

[[discretisations]]
scheme = "paper"
slices = [32, 64]

[[discretisations]]
scheme = "slices"
spacing = "equal"
slices = 64

[[discretisations]]
scheme = "slices"
slices = 64

[[discretisations]]
scheme = "slices"
tolerance = 1e-3

[[discretisations]]
scheme = "spline"
elements = 2
"""
BANDS = {0.25: jaxclay.Squash(0.0, 0.25, 0.4), 0.45: jaxclay.Squash(0.0, 0.45, 0.4)}
WAYS = {
    "paper": {"scheme": "paper", "slices": 64},
    "equal": {"spacing": "equal", "slices": 64},
    "placed": {"slices": 64},
    "tolerance": {"tolerance": 1e-3},
    "spline": {"scheme": "spline", "elements": 2},
}


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    folder = tmp_path_factory.mktemp("accuracy")
    (folder / "small.toml").write_text(SMALL)
    rows = prepared(run(folder / "small.toml", folder / "out"))
    return rows.assign(line=rows.way.where(rows.tolerance == 0, "tolerance"))


def answer(band, way):
    clay = jaxclay.Clay.cylinder(radius=0.5, slices=512)
    return jaxclay.deform(clay, BANDS[band], jaxclay.Material.from_snake_units(), **WAYS[way])


@pytest.mark.parametrize("way", WAYS)
def test_a_row_is_what_users_get(measured, way):
    """The whole call, and its error from the answer on 512 placed slices."""
    exact = jaxclay.deform(
        jaxclay.Clay.cylinder(radius=0.5, slices=512), BANDS[0.25],
        jaxclay.Material.from_snake_units(), slices=512,
    )  # fmt: skip
    rows = measured[(measured.line == way) & (measured.band_height == 0.25)]
    (row,) = rows[rows.slices != 32].itertuples()
    found = answer(0.25, way)
    assert row.energy == pytest.approx(float(found.energy), rel=1e-10)
    assert row.unknowns == found.unknowns
    error = jaxclay.contour_error(found.clay, exact.clay)
    assert row.contour_error_continuum == pytest.approx(error, rel=1e-5)
    assert row.status == "converged"
    assert 0 < row.continuum_error < 1e-5


def test_second_order_is_nearer_than_the_papers_sums(measured):
    for _, rows in measured[measured.slices != 32].groupby("band_height"):
        error = rows.set_index("line").contour_error_continuum
        assert error.placed < error.equal < error.paper
        assert error.tolerance <= 1e-3
        unknowns = rows.set_index("line").unknowns
        assert unknowns.spline < unknowns.paper


def test_times_are_of_warm_calls(measured):
    assert (measured.solve_s > 0).all()
    assert (measured.solve_s < 0.5).all()  # compiling takes seconds
    assert (measured.repeats[measured.solve_s_most < 0.05] >= 3).all()  # of long ones fewer


def power_law(order=-1.0, most=1024):
    """Rows of a scene with error n^order in n microseconds on grids up to ``most``."""
    n = 2 ** np.arange(5, int(np.log2(most)) + 1)
    same = {"call": "deform", "precision": "float64", "settings": "", "family": "newton",
            "method": "newton", "way": "paper", "degree": 0, "elements": 0, "tolerance": 0.0,
            "status": "converged", "continuum_error": 1e-7, "first_s": np.nan}  # fmt: skip
    error = n.astype(float) ** order
    return pd.DataFrame(
        {"slices": n, "unknowns": n, "contour_error_continuum": error, "solve_s": 1e-6 * n, **same}
    )


def test_points_are_medians_over_the_scenes():
    rows = pd.concat([power_law(), power_law(-2.0), power_law(-3.0)])
    found = points(rows).set_index("size_of")
    assert found.error[64] == pytest.approx(64.0**-2)
    assert found.scenes[64] == 3


def test_what_float64_does_not_resolve_counts_for_nothing():
    rows = power_law()
    rows.loc[rows.slices > 128, "status"] = "unresolved"
    assert set(points(rows).size_of) == {32, 64, 128}


def test_scenes_without_a_good_reference_are_left_out():
    assert points(power_law().assign(continuum_error=1e-3)).empty


def test_beyond_the_grids_the_line_goes_on_by_its_order():
    figure = speed_and_accuracy(points(power_law(order=-0.8)))
    line = next(line for line in figure.axes[0].lines if "order 0.8" in str(line.get_label()))
    (x0, x1), (y0, y1) = line.get_data()
    assert np.log(y1 / y0) / np.log(x1 / x0) == pytest.approx(-0.8)
    plt.close(figure)


@pytest.fixture
def accuracy(monkeypatch):
    """The benchmark's experiment, by its options."""
    monkeypatch.syspath_prepend(SCRIPTS)
    from accuracy import experiment  # type: ignore[import-not-found]

    return experiment


def test_every_method_and_scheme_takes_part(accuracy):
    found = tasks(accuracy(quick=True).experiment)
    assert {task.method for task in found} == set(jaxclay.METHODS)
    sizes = [task.discretisation for task in found if task.method == "newton"]
    kinds = {(d.scheme, d.spacing, d.degree, d.tolerance > 0) for d in sizes}
    assert len(kinds) == 7
    assert {task.method for task in found if task.first} == set(jaxclay.METHODS)


def test_so_many_scenes_are_drawn_as_are_asked_for(accuracy):
    found = tasks(accuracy(scenes=20).experiment)
    drawn = {task.specification for task in found if task.specification.source == "cylinder"}
    assert len(drawn) == 20
    fewer = {t.specification.key for t in tasks(accuracy(scenes=10).experiment)}
    assert fewer <= {t.specification.key for t in found}


def test_the_picture_names_its_axes_and_schemes(measured):
    ((name, _, figure),) = accuracy_charts(measured)
    assert name == "accuracy"
    left, right = figure.axes
    assert "ms" in left.get_xlabel()
    assert "over the height l" in left.get_ylabel()
    assert right.get_xlabel() == "unknowns"
    labels = " ".join(text.get_text() for text in figure.legends[0].get_texts())
    for word in ("paper's sums", "second order", "placed", "splines", "tolerance"):
        assert word in labels
    plt.close(figure)
