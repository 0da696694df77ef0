"""Speed against accuracy: the population, what a row says, limits, extrapolation, the picture."""

import numpy as np
import pytest
from oracles import population as drawn

import jaxclay
from jaxclay.experiments.compare import solves
from jaxclay.experiments.compare.accuracy import QUICK, reference, row_of, ways
from jaxclay.experiments.compare.population import population
from jaxclay.experiments.compare.solves import Limit, Way, prepared

pd = pytest.importorskip("pandas")
pytest.importorskip("matplotlib").use("Agg")
pytest.importorskip("rich")

from jaxclay.experiments.compare.accuracy_charts import speed_and_accuracy  # noqa: E402
from jaxclay.experiments.compare.accuracy_tables import reach, summary  # noqa: E402

SEED = 8  # its first two scenes are cylinders squashed at the bottom
SLICES = Way("paper", "newton", 0, 64)
PLACED = Way("placed", "newton", 0, 64)
EQUAL = PLACED._replace(scheme="equal")
SPANS = Way("spline", "newton", 5, 8)


@pytest.fixture(scope="module")
def scenes():
    return list(population(2, SEED))


@pytest.fixture(scope="module")
def measured(scenes):
    """Every row of two scenes in four ways, and what errors are measured from."""
    exact = [reference(scene, 256) for scene in scenes]
    rows = [
        row_of(scene, way, known, 0.0)
        for scene, known in zip(scenes, exact, strict=True)
        for way in (SLICES, EQUAL, PLACED, SPANS)
    ]
    return pd.DataFrame(rows), exact


def power_law(order=-1.0, most=1024):
    """A scene with error n^order in n microseconds on grids up to ``most``."""
    n = 2.0 ** np.arange(5, np.log2(most) + 1)
    line = {"scheme": "paper", "method": "newton", "degree": 0, "limit": ""}
    return pd.DataFrame({"scene": 7, "size": n, "error": n**order, "solve_s": 1e-6 * n, **line})


def test_the_population_is_that_of_the_model(scenes):
    for scene, (r0, squashes, material) in zip(scenes, drawn(2, SEED), strict=True):
        assert float(scene.clay.r0) == r0
        assert scene.squash == squashes[-1]
        for name in ("k", "mu", "alpha", "beta"):
            assert getattr(scene.material, name) == getattr(material, name)
        assert not scene.worked
        assert float(scene.clay.height) == 1.0


def test_a_rows_error_is_the_librarys(scenes, measured):
    table, exact = measured
    clay = jaxclay.Clay.cylinder(radius=float(scenes[0].clay.r0), slices=64)
    answer = jaxclay.deform(clay, scenes[0].squash, scenes[0].material, scheme="paper")
    row = table[(table.scene == scenes[0].number) & (table.scheme == "paper")].iloc[0]
    assert row.error == pytest.approx(jaxclay.contour_error(answer.clay, exact[0].clay), rel=1e-6)
    assert row.unknowns == answer.unknowns
    assert row.limit == ""
    assert row.status == "converged"


def test_placed_slices_are_those_that_users_get(scenes, measured):
    table, exact = measured
    clay = jaxclay.Clay.cylinder(radius=float(scenes[0].clay.r0), slices=64)
    answer = jaxclay.deform(clay, scenes[0].squash, scenes[0].material)
    row = table[(table.scene == scenes[0].number) & (table.scheme == "placed")].iloc[0]
    assert row.error == pytest.approx(jaxclay.contour_error(answer.clay, exact[0].clay), rel=1e-6)


def test_all_solves_of_placed_slices_are_timed(scenes, monkeypatch):
    posed, runs = [], []

    def noted(problem, *_):
        posed.append(problem)
        return lambda: runs.append(problem)

    monkeypatch.setattr(solves, "compiled_call", noted)
    ready = prepared(scenes[0], PLACED)
    answer = ready.call()
    ready.solve()
    assert runs == posed
    assert len(runs) == 1 + len(answer.levels) == 2
    np.testing.assert_array_equal(runs[-1].rest.material, answer.problem.rest.material)


def test_second_order_is_nearer_than_the_papers_sums(measured):
    table, _ = measured
    for _, rows in table.groupby("scene"):
        error = rows.set_index("scheme").error
        assert error.placed < error.equal < error.paper
        unknowns = rows.set_index("scheme").unknowns
        assert unknowns.spline < unknowns.paper


def test_a_worked_piece_is_one_like_others():
    worked = next(scene for scene in population(2, 0) if scene.worked)
    assert len(worked.clay.edges)
    assert prepared(worked, PLACED).call().status is jaxclay.Status.CONVERGED


def test_times_are_of_warm_calls(measured):
    table, _ = measured
    assert (table.solve_s > 0).all()
    assert (table.call_s < 0.5).all()  # compiling takes seconds


def test_limits_are_named(scenes):
    slopes = np.ones(64)
    slopes[40] = 4e-4  # a disc so thin and wide that 64 slices are too many
    heights = np.concatenate([[0], np.cumsum(slopes / slopes.sum())])
    disc = jaxclay.Clay(heights, np.diff(heights), r0=0.5, unit=1.0)
    wide = scenes[0]._replace(clay=disc, material=jaxclay.Material())
    with pytest.raises(Limit, match="rounding"):
        prepared(wide, SLICES)
    with pytest.raises(Limit, match="band"):
        prepared(scenes[0], PLACED._replace(size=4))
    thin = scenes[0]._replace(squash=jaxclay.Squash(0.0, 0.01, float(scenes[0].squash.radius)))
    with pytest.raises(Limit, match="band"):
        prepared(thin, SLICES)


def test_a_level_that_was_reached_takes_what_was_measured():
    found = reach(power_law(), 7, 1 / 300)
    assert found == (512, 512e-6, False)


def test_a_level_beyond_the_grids_is_extrapolated_by_the_fitted_order():
    found = reach(power_law(order=-0.8), 7, 1e-4)
    assert found.beyond
    assert found.slices == pytest.approx(1e-4 ** (-1 / 0.8))
    assert found.seconds == pytest.approx(1e-6 * found.slices)


def test_what_float64_does_not_resolve_counts_for_nothing():
    table = power_law()
    table.loc[table["size"] > 128, "limit"] = "rounding"
    assert reach(table, 7, 1 / 300).beyond
    assert set(summary(table.assign(unknowns=1, call_s=1.0))["size"]) == {32, 64, 128}


def test_every_method_takes_part():
    methods = {way.method for way in ways(QUICK, others=True)}
    assert methods == set(jaxclay.METHODS)


def test_the_picture_names_its_axes_and_schemes(measured):
    figure = speed_and_accuracy(measured[0])
    left, right = figure.axes
    assert "ms" in left.get_xlabel()
    assert "over the height l" in left.get_ylabel()
    assert right.get_xlabel() == "unknowns"
    labels = " ".join(text.get_text() for text in figure.legends[0].get_texts())
    for name in ("paper's sums", "second order", "placed", "splines"):
        assert name in labels
