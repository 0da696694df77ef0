"""The atlas: how answers are marked, what it measures, draws and refuses."""

import re

import numpy as np
import pytest
from scenes import REFERENCE, squash_by

import jaxclay
from jaxclay import Status
from jaxclay.cli.main import main

pd = pytest.importorskip("pandas")
pytest.importorskip("pydantic")
pytest.importorskip("matplotlib").use("Agg")

from jaxclay.cli.experiments.editing import atlas  # noqa: E402
from jaxclay.experiments import load, run  # noqa: E402
from jaxclay.experiments.charts.maps import mark_maps  # noqa: E402
from jaxclay.experiments.charts.shared import Mark, mark_of, marked, prepared  # noqa: E402
from jaxclay.experiments.entries.tasks import tasks  # noqa: E402

METHODS = ["newton", "greedy", "greedy-refined"]
SECONDS = 0.05


@pytest.fixture(scope="module")
def mapped(tmp_path_factory):
    """The quick atlas of a few methods, run through the command line."""
    base = tmp_path_factory.mktemp("atlas")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        code = main(
            ["atlas", "--quick", "--out", str(base / "out"), "--methods", *METHODS]
            + ["--seconds-each", str(SECONDS)]
        )
    assert code == 0
    table = marked(prepared(load(base / "out")))
    return base / "out", table.assign(moved=table.band_height * (1 - table.band_ratio**2))


@pytest.mark.slow
def test_every_cell_has_a_mark_for_every_method(mapped):
    table = mapped[1]
    assert len(table) == (3 * 4 + 3 * 4 + 2 * 2 + 2) * len(METHODS)
    assert set(table.mark) <= {str(mark) for mark in Mark}
    assert (table.budget == SECONDS).all()


@pytest.mark.slow
def test_newton_solves_what_can_be_posed(mapped):
    rows = mapped[1]
    rows = rows[(rows.method == "newton") & (rows.precision == "float64")]
    for row in rows.itertuples():
        assert row.mark == ("refused" if row.moved > 0.58 else "solved")


@pytest.mark.slow
def test_a_squash_that_imposes_no_radius_is_refused_with_the_reason(mapped):
    table = mapped[1]
    refused = table[(table.moved > 0.58)]
    assert set(refused.mark) == {"refused"}
    assert set(refused.method) == set(METHODS)
    assert refused.reason.str.contains("imposes no radius: use at least").all()


@pytest.mark.slow
def test_greedy_is_stalled_and_its_gap_is_what_the_library_says(mapped):
    rows = mapped[1]
    rows = rows[(rows.method == "greedy") & np.isclose(rows.moved, 0.1) & (rows.mu == 1)]
    (row,) = rows.itertuples()
    problem = jaxclay.pose(
        jaxclay.Clay.cylinder(), squash_by(0.1), jaxclay.Material.from_snake_units(), "paper"
    )
    best, greedy = jaxclay.minimize(problem), jaxclay.minimize(problem, "greedy")
    gap = (greedy.energy - best.energy) / best.certificate.energy_free
    assert row.mark == "stalled"
    np.testing.assert_allclose(row.gap_relative, gap, rtol=1e-6)


@pytest.mark.slow
def test_what_is_out_of_time_has_had_all_of_it(mapped):
    table = mapped[1]
    late = table[table.status == "out of time"]
    assert "greedy-refined" in set(late.method)
    assert (late.solve_s >= 0.9 * SECONDS).all()
    assert set(late.mark) == {"out of time"}


@pytest.mark.slow
def test_float32_is_certified_in_float64_and_its_rounding_is_kept(mapped):
    rows = mapped[1]
    rows = rows[(rows.precision == "float32") & (rows.method == "greedy")]
    (printed,) = rows[rows.units == "printed"].itertuples()
    exact = jaxclay.deform(jaxclay.Clay.cylinder(), REFERENCE, jaxclay.Material(), scheme="paper")
    assert printed.energy_minimum == pytest.approx(float(exact.energy), rel=1e-12)
    assert printed.gap_relative > 1e-9
    assert 1e-9 < printed.single_energy < 1e-5
    assert printed.single_gradient > 1
    assert rows.single_energy.notna().all()


@pytest.mark.slow
def test_the_report_needs_no_network_and_shows_every_map(mapped):
    folder, table = mapped
    page = (folder / "report.html").read_text(encoding="utf-8")
    loads = re.findall(r"""(?:src|href)=["']?(?!#)[^"' >]+|url\((?!#)[^)]*\)|@import""", page)
    assert loads == []
    charts = {path.stem.removeprefix("timing-") for path in (folder / "charts").glob("*.png")}
    wanted = {"map-displacement-mu-snake-64", "map-beta-alpha-printed-64", "map-slices-reference"}
    assert wanted | {"float32"} <= charts
    assert page.count("<figure>") == len(charts)
    for word in ("imposes no radius", "greedy-refined", "solved", table.jax[0]):
        assert word in page


@pytest.mark.parametrize(
    ("status", "gap", "mark"),
    [
        (Status.CONVERGED, 0.0, Mark.SOLVED),
        (Status.CONVERGED, float("nan"), Mark.SOLVED),
        (Status.CONVERGED, 1e-4, Mark.WRONG),
        (Status.STALLED, 1e-12, Mark.STALLED),
        (Status.ITERATION_LIMIT, 0.1, Mark.ITERATION_LIMIT),
        (Status.NON_FINITE, 0.1, Mark.NON_FINITE),
        (Status.INFEASIBLE, 0.0, Mark.REFUSED),
        (Status.UNRESOLVED, 0.0, Mark.REFUSED),
        ("skipped", float("nan"), Mark.REFUSED),
        ("out of time", 0.0, Mark.OUT_OF_TIME),
    ],
)
def test_marks_follow_the_status_and_the_lowest_certified_answer(status, gap, mark):
    assert mark_of(str(status), gap) is mark


def test_every_status_has_a_mark_and_every_mark_a_symbol_and_colour_of_its_own():
    assert {mark_of(str(status), 0.0) for status in Status} | {Mark.WRONG, Mark.OUT_OF_TIME} == set(
        Mark
    )
    assert len({m.symbol for m in Mark}) == len({m.colour for m in Mark}) == len(Mark)


def test_depths_cross_the_floor_of_the_sliced_cylinder_model_and_move_the_clay_so_far():
    """2|d|mu/k = 1 lies inside, and the squash moves the clay above by d."""
    found = {t.specification for t in tasks(atlas(["newton"]).experiment)}
    depth = [s for s in found if s.bands and s.bands[0].height == 0.6]
    moved = {s: s.bands[0].height * (1 - s.bands[0].ratio ** 2) for s in depth}
    assert {2 * abs(d) * s.mu > 1 for s, d in moved.items()} == {True, False}
    s = next(s for s in depth if abs(moved[s] - 0.3) < 1e-9 and s.mu == 1)
    problem = s.scene().problems("snake", 64)[-1]
    top, upper = float(problem.band.top), float(problem.band.upper)
    assert top - upper == pytest.approx(0.3, abs=1e-12)


LATE = """\
kind = "timing"
repeats = 1
budget = 1e-6
[[methods]]
name = "newton"
[[methods]]
name = "greedy-refined"
[[parts]]
coarse_to_fine = true
scenes = [{ names = ["reference"] }]
discretisations = [{ scheme = "paper", slices = [32, 48, 64] }]
"""


@pytest.mark.slow
def test_a_late_method_is_not_tried_on_finer_grids_but_newton_is(tmp_path):
    path = tmp_path / "late.toml"
    path.write_text(LATE)
    table = run(path, tmp_path / "out").set_index(["method", "slices"]).sort_index()
    assert list(table.loc["greedy-refined"].status) == ["out of time", "skipped", "skipped"]
    assert (table.loc["greedy-refined"].reason.iloc[1:] == "out of time on fewer slices").all()
    assert "skipped" not in set(table.loc["newton"].status)


def test_maps_are_drawn_of_products_alone():
    def rows(pairs):
        frame = pd.DataFrame(pairs, columns=["mu", "beta"])
        same = {"scene": "cylinder", "units": "snake", "radius": 0.5, "height": 1.0, "k": 1.0,
                "squashes": 1, "band_bottom": 0.0, "scheme": "paper", "spacing": "",
                "precision": "float64", "band_ratio": 0.8, "band_height": 0.3, "alpha": 1.0,
                "slices": 64, "budget": 0.0, "source": "cylinder", "status": "stalled",
                "gap_relative": 1e-3, "series": "greedy", "method": "greedy",
                "single_energy": np.nan}  # fmt: skip
        return frame.assign(**same)

    product = rows([(mu, beta) for mu in (1.0, 2.0) for beta in (1.0, 2.0, 3.0)])
    assert [name for name, *_ in mark_maps(product)] == ["map-mu-beta-snake-64"]
    scattered = rows([(mu, 7.0 / mu) for mu in range(1, 9)])
    assert list(mark_maps(scattered)) == []


def test_bad_requests_are_refused_with_2(tmp_path, capfd):
    requests = {
        ("--methods", "magic"): "unknown method 'magic'.*newton",
        ("--seconds-each", "-1"): "seconds must be positive and finite, got -1",
    }
    for arguments, message in requests.items():
        out = tmp_path / "out"
        assert main(["atlas", "--out", str(out), *arguments]) == 2
        assert re.search(message, capfd.readouterr().err)
        assert not out.exists()


def test_the_quick_atlas_is_a_part_of_the_whole():
    whole, quick = (tasks(atlas(quick=q).experiment) for q in (False, True))
    assert {task.method for task in quick} == set(jaxclay.METHODS)
    scenes = [{task.specification.key for task in each} for each in (whole, quick)]
    assert scenes[1] <= scenes[0]
    assert len(quick) < len(whole) / 4
