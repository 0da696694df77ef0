"""The atlas: how attempts are marked, what it measures, writes and refuses."""

import re

import numpy as np
import pytest

import jaxclay
from jaxclay import Status
from jaxclay.cli.main import main

pd = pytest.importorskip("pandas")
pytest.importorskip("matplotlib").use("Agg")

from jaxclay.experiments.atlas import command, runner  # noqa: E402
from jaxclay.experiments.atlas.marks import Mark, mark_of  # noqa: E402
from jaxclay.experiments.atlas.sweeps import QUICK, REFERENCE, SINGLE, Cell, Grids, squash_by  # noqa: E402

SNAKE = 1 / 64**2, 1 / 64**4
TINY = Grids(
    depths=(0.1, 0.59),
    frictions=(1.0,),
    alphas=(SNAKE[0], 1.0),
    betas=(SNAKE[1], 1.0),
    slices=(64,),
    single_slices=(64,),
)
METHODS = ["newton", "greedy", "greedy-refined"]
SECONDS = 0.05


@pytest.fixture(scope="module")
def mapped(tmp_path_factory):
    """A tiny atlas, run once through the command line."""
    base = tmp_path_factory.mktemp("atlas")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        patch.setattr(command, "QUICK", TINY)
        code = main(
            ["atlas", "--quick", "--out", str(base / "out"), "--methods", *METHODS]
            + ["--seconds-each", str(SECONDS)]
        )
    assert code == 0
    return base / "out", pd.read_parquet(base / "out" / "results.parquet")


def test_every_cell_has_a_mark_for_every_method(mapped):
    _, table = mapped
    assert len(table) == len(TINY.cells()) * len(METHODS)
    assert set(table.mark) <= {str(mark) for mark in Mark}


def test_newton_solves_what_can_be_posed(mapped):
    _, table = mapped
    rows = table[(table.method == "newton") & (table.precision != SINGLE)]
    for row in rows.itertuples():
        assert row.mark == ("refused" if row.x == 0.59 else "solved")


def test_a_squash_that_imposes_no_radius_is_refused_with_the_reason(mapped):
    _, table = mapped
    refused = table[table.mark == "refused"]
    assert list(refused.method) == METHODS
    assert refused.reason.str.contains("imposes no radius: use at least").all()


def test_greedy_is_stalled_and_its_gap_is_what_the_library_says(mapped):
    _, table = mapped
    row = table[(table.method == "greedy") & (table.sweep == "depth") & (table.x == 0.1)].iloc[0]
    problem = jaxclay.pose(
        jaxclay.Clay.cylinder(), squash_by(0.1), jaxclay.Material.from_snake_units(), "paper"
    )
    best, greedy = jaxclay.minimize(problem), jaxclay.minimize(problem, "greedy")
    gap = (greedy.energy - best.energy) / best.certificate.energy_free
    assert row.mark == "stalled"
    np.testing.assert_allclose(row.gap_relative, gap, rtol=1e-6)


def test_what_is_out_of_time_has_had_all_of_it(mapped):
    _, table = mapped
    late = table[table.mark == "out of time"]
    assert "greedy-refined" in set(late.method)
    assert (late.solve_s >= 0.9 * SECONDS).all()
    assert (late.status == "iteration limit").all()


def test_float32_is_certified_in_float64_and_its_rounding_is_kept(mapped):
    _, table = mapped
    rows = table[(table.precision == SINGLE) & (table.method == "newton")]
    printed = rows[rows.panel.str.startswith("as printed")].iloc[0]
    exact = jaxclay.deform(jaxclay.Clay.cylinder(), REFERENCE, jaxclay.Material(), scheme="paper")
    assert printed.energy_minimum == pytest.approx(float(exact.energy), rel=1e-12)
    assert printed.gap_relative > 1e-9
    assert 1e-9 < printed.single_energy < 1e-5
    assert printed.single_gradient > 1


def test_the_report_needs_no_network_and_shows_every_chart(mapped):
    folder, table = mapped
    page = (folder / "report.html").read_text(encoding="utf-8")
    loads = re.findall(r"""(?:src|href)=["']?(?!#)[^"' >]+|url\((?!#)[^)]*\)|@import""", page)
    assert loads == []
    charts = {path.stem for path in folder.glob("*.png")}
    assert charts == {"depth", "smoothing", "slices", "float32"}
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
        (Status.ITERATION_LIMIT, 0.1, Mark.OUT_OF_TIME),
        (Status.NON_FINITE, 0.1, Mark.NON_FINITE),
        (Status.INFEASIBLE, 0.0, Mark.REFUSED),
        (Status.UNRESOLVED, 0.0, Mark.REFUSED),
    ],
)
def test_marks_follow_the_status_and_the_lowest_certified_answer(status, gap, mark):
    assert mark_of(status, gap) is mark


def test_every_status_has_a_mark_and_every_mark_a_symbol_and_colour_of_its_own():
    assert {mark_of(status, 0.0) for status in Status} | {Mark.WRONG} == set(Mark)
    assert len({m.symbol for m in Mark}) == len({m.colour for m in Mark}) == len(Mark)


def test_the_sweep_over_depths_crosses_the_floor_of_the_sliced_cylinder_model():
    """2|d|mu/k = 1 lies inside, and the squash moves the clay above by d."""
    cells = [cell for cell in Grids().cells() if cell.sweep == "depth"]
    crossed = {2 * abs(cell.x) * cell.y > 1 for cell in cells}
    assert crossed == {True, False}
    problem = Cell("depth", "", 0.3, 1.0, squash_by(0.3), jaxclay.Material()).problem()
    moved = float(problem.band.top) - float(problem.band.upper)
    assert moved == pytest.approx(0.3, abs=1e-12)


def test_a_late_method_is_not_tried_on_finer_grids_but_newton_is(monkeypatch):
    """Without solving anything: every attempt is out of time."""
    tried = []
    late = str(Mark.OUT_OF_TIME)

    def rows(cell, methods, attempts, tick):
        tried.append((cell.panel, cell.slices, list(methods)))
        return [{"method": method, "mark": late} for method in methods]

    monkeypatch.setattr(runner, "rows_of", rows)
    grids = Grids(depths=(), frictions=(), alphas=(), betas=(), slices=(16, 32), single_slices=())
    list(runner.run(grids, ["newton", "greedy"], 0.1))
    panels = "snake units, float64", "as printed, float64"
    assert tried == [(panel, 16, ["newton", "greedy"]) for panel in panels] + [
        (panel, 32, ["newton"]) for panel in panels
    ]


def test_an_interrupted_atlas_writes_what_it_tried(tmp_path, monkeypatch):
    monkeypatch.setattr(command, "QUICK", TINY)
    ticks = []

    def interrupt():
        ticks.append(1)
        if len(ticks) > 4:  # two for each cell
            raise KeyboardInterrupt

    assert command.atlas(tmp_path, ["newton"], SECONDS, True, interrupt) == 130
    table = pd.read_parquet(tmp_path / "results.parquet")
    assert 0 < len(table) < len(TINY.cells())
    assert (tmp_path / "report.html").exists()


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
    whole, quick = Grids().cells(), QUICK.cells()
    assert {(c.sweep, c.panel) for c in quick} == {(c.sweep, c.panel) for c in whole}
    assert len(quick) < len(whole) / 4
