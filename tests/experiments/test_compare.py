"""The comparison: what it measures, prints, writes and refuses."""

import contextlib
import io
import re

import jax
import numpy as np
import pytest

import jaxclay
from jaxclay.cli.main import main
from jaxclay.experiments.contestants import CONTESTANTS, DEFAULT
from jaxclay.experiments.peers import PEERS
from jaxclay.experiments.scenes import NAMED, packaged_scenes, profile_scene

pd = pytest.importorskip("pandas")
pytest.importorskip("pydantic")
pytest.importorskip("matplotlib").use("Agg")

from jaxclay.cli.experiments.editing import comparison  # noqa: E402
from jaxclay.experiments.entries.scenes import files_of  # noqa: E402
from jaxclay.experiments.entries.tasks import tasks  # noqa: E402

METHODS = ["newton", "greedy", "greedy-refined"]


def folder_scenes(folder):
    """The scenes of a folder of profiles, as a comparison takes them."""
    return {
        f"{task.specification.name}": task.specification.scene()
        for task in tasks(comparison(profiles=folder).experiment)
        if task.specification.place
    }


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """A small comparison, run once through the command line; its folder, rows and output."""
    base = tmp_path_factory.mktemp("compare")
    profile = base / "profiles"
    profile.mkdir()
    y = np.linspace(0, 20, 40)  # a bottle in centimetres
    radius = np.where(y < 13, 4.0, np.maximum(4.0 - (y - 13), 1.5))
    lines = [f"{a:.4f},{b:.4f}" for a, b in zip(y, radius, strict=True)]
    (profile / "bottle.csv").write_text("\n".join(["height,radius", *lines]))
    names = ["reference", "bottle-middle", "bottle-shoulder"]
    out = base / "out"
    command = ["compare", "--quick", "--out", str(out), "--profiles", str(profile)]
    command += ["--scenes", *names, "--methods", *METHODS]
    jax.clear_caches()  # as in a process of its own: what is compiled has no seconds to tell
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(base / "cache"))
        with contextlib.redirect_stdout(io.StringIO()) as said:
            assert main(command) == 0
    return out, pd.read_parquet(out / "results.parquet"), said.getvalue(), command


def answers(table):
    return table[(table.settings == "") & (table.slices == 64)].drop_duplicates(
        subset=["scene", "units", "method"]
    )


def test_every_scene_unit_and_method_has_an_answer(compared):
    rows = answers(compared[1])
    assert len(rows) == 3 * 2 * 3
    assert set(rows[rows.method == "newton"].status) == {"converged"}


def test_figures_are_what_the_library_says(compared):
    rows = answers(compared[1]).set_index(["scene", "units", "method"])
    row = rows.loc["reference", "snake", "greedy"]
    problem = NAMED["reference"].problems("snake", 64)[-1]
    minimum = jaxclay.minimize(problem)
    greedy = jaxclay.minimize(problem, method="greedy")
    gap = (greedy.energy - minimum.energy) / minimum.certificate.energy_free
    np.testing.assert_allclose(row.gap_relative, gap, rtol=1e-9)
    np.testing.assert_allclose(
        row.contour_error, jaxclay.contour_error(greedy.clay, minimum.clay), rtol=1e-9
    )
    assert row.iterations == greedy.iterations
    assert row.reference == "newton"


def test_compile_time_is_apart_and_never_missing(compared):
    table = compared[1]
    assert (table.compile_s > 0).all()
    assert (table.solve_s > 0).all()
    assert (table.solve_s_least <= table.solve_s).all()
    assert (table.solve_s <= table.solve_s_most).all()


def test_a_first_answer_of_each_method_costs_its_compiling(compared):
    rows = compared[1][compared[1].first_s.notna()]
    assert list(rows.method.sort_values()) == sorted(METHODS)
    assert (rows.first_s > 3 * rows.solve_s).all()
    assert (rows.compile_s <= rows.first_s).all()


def test_contour_errors_from_the_continuum_fall_with_the_slices(compared):
    table = compared[1]
    rows = table[(table.method == "newton") & (table.settings == "") & (table.scene == "reference")]
    rows = rows[rows.units == "printed"].drop_duplicates(subset="slices").sort_values("slices")
    assert list(rows.slices) == [32, 64, 128]
    assert (np.diff(rows.contour_error_continuum) < 0).all()


def test_a_finer_step_brings_greedy_nearer(compared):
    table = compared[1]
    rows = table[(table.method == "greedy") & (table.settings != "") & (table.units == "snake")]
    steps = rows.settings.str.removeprefix("step=").astype(float)
    rows = rows.assign(step=steps).sort_values("step")
    assert rows.gap_relative.iloc[0] < rows.gap_relative.iloc[-1] / 100


def test_results_name_what_ran(compared):
    table = compared[1]
    for name in ("jaxclay", "code", "jax", "jaxlib", "jaxopt", "optax", "numpy", "python"):
        assert (table[name].astype(str).str.len() > 0).all()


def test_the_summary_is_printed_and_rows_where_asked_for(compared, capsys):
    _, table, said, command = compared
    assert "in a sentence" in said
    assert re.search(r"report: \S+report.html", said)
    assert len([line for line in said.splitlines() if "bottle-shoulder" in line]) < 3
    assert main([*command, "--rows"]) == 0  # nothing is solved again
    out = capsys.readouterr().out
    assert f"{len(table)} tasks, {len(table)} of them done before" in out
    assert len([line for line in out.splitlines() if "bottle-shoulder" in line]) >= 6


def test_report_needs_no_network(compared):
    folder = compared[0]
    page = (folder / "report.html").read_text(encoding="utf-8")
    loads = re.findall(r"""(?:src|href)=["']?(?!#)[^"' >]+|url\((?!#)[^)]*\)|@import""", page)
    assert loads == []
    pictures = {path.stem for path in (folder / "charts").glob("*.png")}
    assert page.count("<figure>") == len(pictures)
    wanted = {"work-precision-reference", "energy", "shapes-snake", "shapes-printed"}
    assert {f"timing-{name}" for name in wanted} <= pictures
    assert "bottle-shoulder" in page


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


def test_every_contestant_has_a_ladder_and_looks_of_its_own():
    assert set(CONTESTANTS) == set(jaxclay.METHODS) | set(PEERS)
    looks = {(one.colour, one.marker, one.line) for one in CONTESTANTS.values()}
    assert len(looks) == len(CONTESTANTS)
    assert all(len(one.ladder) > 3 for one in CONTESTANTS.values())


def test_options_edit_the_experiment():
    whole = comparison()
    assert {task.method for task in tasks(whole.experiment)} == set(DEFAULT)
    everything = tasks(comparison(methods=list(jaxclay.METHODS)).experiment)
    assert {task.method for task in everything} == set(jaxclay.METHODS)
    few = tasks(comparison(scenes=["bowl"], slices=[16, 32], methods=["greedy"]).experiment)
    assert {task.specification.name for task in few} == {"bowl"}
    assert {task.discretisation.slices for task in few} == {16, 32}


def test_e_move_joins_the_named_scenes_only_where_peers_run():
    without, joined = (tasks(comparison(peers=p).experiment) for p in (None, ["piqp"]))
    moved = {t.specification.name for t in joined if t.specification.units == "move"}
    assert moved == set(NAMED) - {"fig5"}
    assert not any(task.specification.units == "move" for task in without)


def test_a_bad_line_in_a_folder_is_named(tmp_path):
    (tmp_path / "jug.csv").write_text("height,radius\n0,1\n1,x\n")
    with pytest.raises(ValueError, match=r"jug.csv: line 3.*x"):
        files_of(tmp_path)


def test_scenes_cover_the_papers_figures_and_the_packaged_profiles():
    assert set(packaged_scenes()) == set(NAMED) | set(jaxclay.PROFILES)
    assert "printed" not in NAMED["fig7"].units
    assert len(NAMED["fig6"].squashes) == len(NAMED["fig7"].squashes) == 8
    names = {task.specification.name for task in tasks(comparison().experiment)}
    assert names == set(packaged_scenes()) - {"fig5"}  # the same solve as fig4a
    assert comparison(scenes=["fig5"])


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

    monkeypatch.setattr("jaxclay.experiments.scenes.Scene.problems", broken)
    out = str(tmp_path / "out")
    scene = ["--scenes", "fig4c", "--methods", "newton"]
    assert main(["compare", "--quick", "--out", out, *scene]) == 70
    assert "Traceback" in capfd.readouterr().err
