"""The comparison: what it measures, writes and refuses."""

import re

import jax
import numpy as np
import pytest

import jaxclay
from jaxclay.cli.main import main
from jaxclay.experiments.compare.command import compare, make_plan
from jaxclay.experiments.compare.plan import DEFAULT_METHODS
from jaxclay.experiments.compare.runner import LADDERS
from jaxclay.experiments.compare.scenes import NAMED, folder_scenes, packaged_scenes, profile_scene

pd = pytest.importorskip("pandas")
pytest.importorskip("matplotlib").use("Agg")


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """A small comparison, run once through the command line."""
    base = tmp_path_factory.mktemp("compare")
    profile = base / "profiles"
    profile.mkdir()
    y = np.linspace(0, 20, 40)  # a bottle in centimetres
    radius = np.where(y < 13, 4.0, np.maximum(4.0 - (y - 13), 1.5))
    lines = [f"{a:.4f},{b:.4f}" for a, b in zip(y, radius, strict=True)]
    (profile / "bottle.csv").write_text("\n".join(["height,radius", *lines]))
    names = ["reference", "bottle-middle", "bottle-shoulder"]
    methods = ["newton", "greedy", "greedy-refined"]
    jax.clear_caches()  # as in a process of its own: what is compiled has no seconds to tell
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        code = main(
            ["compare", "--quick", "--out", str(base / "out"), "--profiles", str(profile)]
            + ["--scenes", *names, "--methods", *methods]
        )
    assert code == 0
    return base / "out", pd.read_parquet(base / "out" / "results.parquet")


def test_every_scene_unit_and_method_has_an_answer(compared):
    _, table = compared
    answers = table[(table.experiment == "answer") & (table.slices == 64)]
    assert len(answers) == 3 * 2 * 3
    assert set(answers[answers.method == "newton"].status) == {"converged"}


def test_figures_are_what_the_library_says(compared):
    _, table = compared
    row = table[
        (table.experiment == "answer")
        & (table.scene == "reference")
        & (table.units == "snake")
        & (table.slices == 64)
        & (table.method == "greedy")
    ].iloc[0]
    problem = NAMED["reference"].problems("snake", 64)[-1]
    minimum = jaxclay.minimize(problem)
    greedy = jaxclay.minimize(problem, method="greedy")
    gap = (greedy.energy - minimum.energy) / minimum.certificate.energy_free
    np.testing.assert_allclose(row.gap_relative, gap, rtol=1e-9)
    np.testing.assert_allclose(
        row.contour_error, jaxclay.contour_error(greedy.clay, minimum.clay), rtol=1e-9
    )
    assert row.iterations == greedy.iterations
    assert row.paper_1993_s == 0.3


def test_compile_time_is_apart_and_never_missing(compared):
    _, table = compared
    assert (table.compile_s > 0).all()
    assert (table.solve_s > 0).all()
    assert (table.solve_s_least <= table.solve_s).all()
    assert (table.solve_s <= table.solve_s_most).all()


def test_contour_errors_fall_with_the_slices(compared):
    _, table = compared
    rows = table[(table.method == "newton") & table.experiment.isin(["answer", "grid"])]
    rows = rows[rows.contour_error_finest.notna() & (rows.units == "printed")].sort_values("slices")
    assert list(rows.slices) == [32, 64, 128]
    assert (np.diff(rows.contour_error_finest) < 0).all()


def test_a_finer_step_brings_greedy_nearer(compared):
    _, table = compared
    rows = table[(table.experiment == "ladder") & (table.method == "greedy")]
    rows = rows[(rows.scene == "reference") & (rows.units == "snake")].sort_values("value")
    assert rows.gap_relative.iloc[0] < rows.gap_relative.iloc[-1] / 100


def test_results_name_what_ran(compared):
    _, table = compared
    for name in ("jaxclay", "jax", "jaxlib", "jaxopt", "optax", "numpy", "python", "machine"):
        assert (table[name].astype(str).str.len() > 0).all()


def test_the_table_holds_the_grids_that_were_asked_for(compared):
    _, table = compared
    assert set(table[table.experiment == "answer"].slices) == {64}


def test_report_needs_no_network(compared):
    folder, _ = compared
    page = (folder / "report.html").read_text(encoding="utf-8")
    loads = re.findall(r"""(?:src|href)=["']?(?!#)[^"' >]+|url\((?!#)[^)]*\)|@import""", page)
    assert loads == []
    assert page.count("<figure>") == len(list(folder.glob("*.png"))) == 5
    assert "reference" in page
    assert "bottle-shoulder" in page


def test_an_interrupted_run_writes_what_it_measured(tmp_path):
    """Ctrl-C at any moment, here after each of the first few solves."""
    for most in (2, 3):
        out, ticks = tmp_path / str(most), []

        def interrupt(ticks=ticks, most=most):
            ticks.append(1)
            if len(ticks) > most:
                raise KeyboardInterrupt

        assert compare(out, scenes=["reference"], quick=True, interrupt=interrupt) == 130
        table = pd.read_parquet(out / "results.parquet")
        assert 0 < len(table[table.experiment.isin(["answer", "grid"])]) < most
        assert (out / "report.html").exists()


def test_bad_requests_are_refused_with_2(tmp_path, capfd):
    requests = {
        ("--scenes", "moon"): "moon.*reference",
        ("--methods", "magic"): "magic.*newton",
        ("--peers", "magic"): "magic.*ipopt",
        ("--slices", "4"): "between 8 and 1024, got 4",
        ("--profiles", str(tmp_path)): "no CSV",
    }
    for arguments, message in requests.items():
        out = tmp_path / "out"
        assert main(["compare", "--out", str(out), *arguments]) == 2
        assert re.search(message, capfd.readouterr().err)
        assert not out.exists()


def test_every_method_can_be_asked_for_and_has_a_ladder():
    assert set(LADDERS) == set(jaxclay.METHODS)
    assert make_plan(None, None, None, None, False).methods == list(DEFAULT_METHODS)
    everything = list(jaxclay.METHODS)
    assert make_plan(None, everything, None, None, False).methods == everything


def test_e_move_joins_the_named_scenes_only_where_peers_run():
    without, joined = (make_plan(None, None, None, None, False, peers=p) for p in (None, ["piqp"]))
    assert {scene.name for scene in joined.scenes if "move" in scene.units} == set(NAMED)
    assert not any("move" in scene.units for scene in without.scenes)


def test_a_bad_line_in_a_folder_is_named(tmp_path):
    (tmp_path / "jug.csv").write_text("height,radius\n0,1\n1,x\n")
    with pytest.raises(ValueError, match=r"jug.csv: line 3.*x"):
        folder_scenes(tmp_path)


def test_scenes_cover_the_papers_figures_and_the_packaged_profiles():
    assert set(packaged_scenes()) == set(NAMED) | set(jaxclay.PROFILES)
    assert NAMED["fig7"].units == ("snake",)
    assert len(NAMED["fig6"].squashes) == len(NAMED["fig7"].squashes) == 8


def test_bottles_get_a_squash_at_mid_height_and_one_at_the_shoulder(bottles):
    scenes = folder_scenes(bottles[0].parent)
    assert len(scenes) == 2 * len(bottles)
    for scene in scenes.values():
        squash = scene.squashes[-1]
        clay = scene.clay(64)
        centre = (squash.bottom + squash.top) / 2 / clay.height
        low, high = (0.49, 0.51) if scene.name.endswith("middle") else (0.55, 0.88)
        assert low <= centre <= high
        assert jaxclay.minimize(scene.problems("snake", 64)[-1]).certificate.accepted


def test_profile_scene_holds_enough_clay_for_a_coarse_grid():
    scene = profile_scene("amphora", "amphora", "middle")
    problem = scene.problems("snake", 40)[-1]
    assert problem.rest.held(problem.band).sum() >= 2


def test_a_fault_inside_is_no_reason_to_skip_a_scene(tmp_path, monkeypatch, capfd):
    def broken(*_):
        raise RecursionError("maximum recursion depth exceeded")

    monkeypatch.setattr("jaxclay.experiments.compare.scenes.Scene.problems", broken)
    out = str(tmp_path / "out")
    scene = ["--scenes", "reference", "--methods", "newton"]
    assert main(["compare", "--quick", "--out", out, *scene]) == 70
    assert "Traceback" in capfd.readouterr().err
