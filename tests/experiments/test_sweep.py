"""Sweeps: what their answers, tables and times are."""

import os
import re
import sys

import jax
import numpy as np
import pytest

import jaxclay

pd = pytest.importorskip("pandas")
pytest.importorskip("pydantic")

from sweeps import COUNT, TEXT  # noqa: E402

from jaxclay.cli.main import main  # noqa: E402
from jaxclay.experiments import engine, load, load_curves, machine, run  # noqa: E402
from jaxclay.experiments.entries.reading import read_experiment  # noqa: E402
from jaxclay.experiments.entries.tasks import tasks  # noqa: E402
from jaxclay.methods.choice import method_settings  # noqa: E402


def test_answers_are_what_the_library_says(whole, experiment):
    table = load(whole).set_index("key")
    for task in tasks(read_experiment(experiment))[:: COUNT // 6]:
        problem = task.specification.scene().problems("snake", 8)[-1]
        answer = jaxclay.minimize(problem, method=task.method)
        row = table.loc[task.key]
        assert row.energy == pytest.approx(float(answer.energy), rel=1e-12)
        assert (row.iterations, row.status) == (int(answer.iterations), str(answer.status))


def test_gaps_are_measured_from_another_methods_certified_minimum(whole, tmp_path):
    path = tmp_path / "newton.toml"
    path.write_text(TEXT.replace('"greedy-refined"', '"newton"'))
    newton = run(path, tmp_path / "out").query("method == 'newton'")
    greedy = load(whole)
    assert set(newton.reference) == {"lbfgs-preconditioned"}
    assert set(greedy.reference) == {"newton"}
    assert (abs(newton.gap_relative) < 1e-9).all()
    assert (greedy.gap_relative > 1e-6).any()
    coarse = greedy[greedy.method == "greedy"]
    assert coarse.contour_error.min() > 1e3 * newton.contour_error.max()


def test_without_jaxopt_its_methods_are_skipped_and_others_run(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "jaxopt", None)
    path = tmp_path / "both.toml"
    text = TEXT.replace('"greedy"', '"lbfgs"').replace('"greedy-refined"', '"newton"')
    path.write_text(text)
    found = run(path, tmp_path / "out").set_index("method")
    assert set(found.loc["lbfgs"].status) == {"skipped"}
    assert found.loc["lbfgs"].reason.str.contains("pip install jaxopt").all()
    assert set(found.loc["newton"].status) == {"converged"}


def test_columns_are_documented_and_curves_are_the_answers_contours(whole, experiment):
    table, curves = load(whole), load_curves(whole)
    assert set(table.attrs["units"]) == set(table.columns)
    assert all(len(text) > 5 for text in table.attrs["units"].values())
    task = tasks(read_experiment(experiment))[0]
    problem = task.specification.scene().problems("snake", 8)[-1]
    clay = jaxclay.minimize(problem, method=task.method).clay
    here = curves.isel(task=int(np.argmax(curves.key.values == task.key)))
    np.testing.assert_allclose(here.contour_radius, clay.radii, rtol=1e-12)
    middle = (clay.heights[1:] + clay.heights[:-1]) / 2
    np.testing.assert_allclose(here.contour_height, middle, rtol=1e-12)


def test_a_fault_inside_is_no_reason_to_skip_a_task(tmp_path, experiment, monkeypatch, capfd):
    def broken(*_):
        raise jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED")

    monkeypatch.setattr("jaxclay.experiments.solving.solve.posed", broken)
    out = tmp_path / "out"
    assert main(["sweep", str(experiment), "--out", str(out), "--quiet"]) == 70
    assert "Traceback" in capfd.readouterr().err
    assert not list(out.glob("results/*"))


def test_what_cannot_be_posed_is_skipped_and_says_why(tmp_path, experiment):
    path = tmp_path / "thin.toml"
    path.write_text(TEXT.replace("[0.4, 0.5]", "[0.4, 0.1]"))
    table = run(path, tmp_path / "out")
    thin = table[table.band_height == 0.1]
    assert set(thin.status) == {"skipped"}
    assert thin.reason.str.contains("imposes no radius").all()
    assert (thin.reference == "none certified").all()
    assert (table[table.band_height == 0.4].status != "skipped").all()


def test_progress_of_a_quiet_run_has_rate_and_time_left(experiment, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("jaxclay.cli.experiments.progress.EVERY", 0.05)
    monkeypatch.setattr(engine, "MOST", 12)
    assert main(["sweep", str(experiment), "--out", str(tmp_path), "--quiet"]) == 0
    lines = capsys.readouterr().err.splitlines()
    said = rf"(0|12|24) of {COUNT} tasks(, [\d.]+(/s| s each))?, .* left; .*"
    assert lines
    assert all(re.fullmatch(said, line) for line in lines)
    assert any(line.startswith(f"12 of {COUNT} tasks, ") for line in lines)


def test_times_in_words():
    words = {0.2: "1 s", 59: "59 s", 200: "3 min 20 s", 7300: "2 h 1 min"}
    assert {seconds: engine.in_words(seconds) for seconds in words} == words


def test_timing_runs_alone_on_one_core_with_compiling_apart(tmp_path):
    path = tmp_path / "timing.toml"
    text = TEXT.replace("throughput", "timing").replace("[0.4, 0.5, 0.6]", "0.5")
    path.write_text("repeats = 2\n" + text + "stops = [1, 2, 4]\n")
    jax.clear_caches()  # as in a process of its own: what is compiled has no seconds to tell
    cores = os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else None
    table = run(path, tmp_path / "out")
    assert set(table.kind) == {"timing"}
    assert (table.compile_s > 0).any()
    assert (table.repeats >= 2).all()
    assert (table.solve_s_least <= table.solve_s).all()
    assert (table.solve_s <= table.solve_s_most).all()
    if cores is not None:
        assert set(table.pinned) <= cores
        assert os.sched_getaffinity(0) == cores
    curves = load_curves(tmp_path / "out")
    greedy = curves.isel(task=curves.method.values == "greedy-refined")
    falls = np.diff(greedy.trace_energy.values, axis=1)
    assert (falls[np.isfinite(falls)] <= 0).all()
    assert (greedy.trace_iterations.values[:, :2] == [1, 2]).all()


@pytest.mark.parametrize(
    ("method", "settings"),
    [
        ("newton", [{"max_iterations": 3}, {}, {"tolerance": 1e-4}]),
        ("lattice", [{"max_iterations": 3}, {"labels": 5}, {}, {"labels": 5}]),
    ],
)
def test_a_batch_has_settings_for_each(method, settings):
    clay, squash = jaxclay.Clay.cylinder(slices=16), jaxclay.Squash(0.0, 0.3, 0.4)
    problem = jaxclay.pose(clay, squash, jaxclay.Material.from_snake_units(), "paper")
    every = [method_settings(method, chosen) for chosen in settings]
    answers = jaxclay.minimize_batch([problem] * len(settings), every, method)
    for answer, chosen in zip(answers, settings, strict=True):
        alone = jaxclay.minimize(problem, method, **chosen)
        assert float(answer.energy) == pytest.approx(float(alone.energy), rel=1e-12)
        assert answer.iterations == alone.iterations


def test_two_timing_runs_at_once_are_refused():
    refused = pytest.raises(RuntimeError, match="another timing run is under way")
    with machine.alone(), refused, machine.alone():
        pass
    with machine.alone():
        pass


TOLERANCES = """\
kind = "throughput"
slices = 32
tolerances = [1e-2, 1e-3]

[[scenes]]
names = ["fig4a", "fig4b"]
units = ["snake"]

[[methods]]
name = "newton"
schemes = ["slices"]
"""


def test_scenes_are_solved_to_tolerances_in_batches(tmp_path):
    path = tmp_path / "tolerances.toml"
    path.write_text(TOLERANCES)
    table = run(path, tmp_path / "out")
    assert sorted(table.tolerance) == [0, 0, 1e-3, 1e-3, 1e-2, 1e-2]
    within = table[table.tolerance > 0]
    assert (within.status == "converged").all()
    assert (within.contour_error_continuum <= within.tolerance).all()
    assert (within.error_estimate <= within.tolerance).all()
    assert (within.batch == 2).all()
    assert table[table.tolerance == 0].error_estimate.isna().all()
    more = within.set_index(["scene", "tolerance"]).unknowns.unstack()
    assert (more[1e-3] >= more[1e-2]).all()
    assert more[1e-3].sum() > more[1e-2].sum()


SPLINES = """\
kind = "throughput"
slices = 32
elements = [4]

[[scenes]]
names = ["fig4a"]
units = ["printed"]

[[methods]]
name = "newton"
schemes = ["paper", "spline"]
"""


@pytest.mark.slow
@pytest.mark.slow
def test_splines_are_measured_from_another_methods_minimum_and_from_the_continuum(tmp_path):
    path = tmp_path / "splines.toml"
    path.write_text(SPLINES)
    table = run(path, tmp_path / "out").set_index("scheme")
    spline, paper = table.loc["spline"], table.loc["paper"]
    assert spline.reference == paper.reference == "lbfgs-preconditioned"
    assert abs(spline.gap_relative) < 1e-8
    assert spline.contour_error_continuum < 1e-2
    assert spline.contour_error_continuum < paper.contour_error_continuum
