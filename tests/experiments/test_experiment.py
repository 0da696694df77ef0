"""The experiment file: what it asks for."""

import re

import numpy as np
import pytest

pytest.importorskip("pydantic")

from jaxclay.cli.main import main
from jaxclay.experiments.entries.reading import packaged, read_experiment
from jaxclay.experiments.entries.tasks import tasks
from jaxclay.experiments.scenes import NAMED

SMALL = """\
kind = "throughput"
slices = [8, 16]

[[scenes]]
cylinders = { radius = [0.4, 0.5] }
squash = { bottom = 0.0, height = { from = 0.3, to = 0.5, count = 3 }, ratio = 0.8 }
units = ["snake", "printed"]

[[methods]]
name = "newton"
settings = { tolerance = [1e-4, 1e-14] }

[[methods]]
name = "greedy"
"""


def drawn(count, seed=0, more=""):
    return f"""\
kind = "throughput"
seed = {seed}
[[scenes]]
draws = {count}
profiles = ["bowl", "teapot"]
cylinders = {{ radius = {{ uniform = [0.2, 1.0] }} }}
squash = {{ bottom = [0.0, {{ uniform = [0.1, 0.4] }}], height = 0.3, ratio = 0.8 }}
material = {{ mu = {{ log_uniform = [0.03, 2.0] }} }}
{more}
[[methods]]
name = "newton"
"""


def test_lists_and_ranges_give_every_combination(read):
    found = tasks(read(SMALL))
    scenes = 2 * 3 * 2  # radii, heights, units
    assert len(found) == scenes * 2 * (2 + 1)  # slices, settings of newton and greedy
    assert len({task.key for task in found}) == len(found)
    heights = sorted({task.specification.bands[0].height for task in found})
    assert heights == pytest.approx([0.3, 0.4, 0.5])


def test_a_squash_is_over_the_lengths_of_its_piece(read):
    text = SMALL.replace("{ radius = [0.4, 0.5] }", "{ radius = 4.0, height = 20.0 }")
    squash = tasks(read(text))[0].specification.scene().squashes[-1]
    assert squash.bottom == 0
    assert float(squash.top) == pytest.approx(0.3 * 20)
    assert float(squash.radius) == pytest.approx(0.8 * 4)


def test_named_scenes_are_those_of_the_comparison(read):
    text = 'kind = "throughput"\n[[scenes]]\nnames = ["fig4b", "fig7"]\nunits = ["printed"]\n'
    (task,) = tasks(read(text + '[[methods]]\nname = "newton"\n'))  # fig7 is in snake units only
    assert task.specification.scene() is NAMED["fig4b"]
    material = task.specification.scene().material("printed")
    assert (material.mu, material.alpha) == (0.1, 1.0)


def test_draws_are_seeded_and_within_their_limits(read):
    first, again, other = (tasks(read(drawn(60, seed))) for seed in (0, 0, 1))
    assert [task.key for task in first] == [task.key for task in again]
    assert {task.key for task in first}.isdisjoint(task.key for task in other)
    recipes = [task.specification for task in first]
    mu = np.array([recipe.mu for recipe in recipes])
    bottoms = np.array([recipe.bands[0].bottom for recipe in recipes])
    assert {recipe.source for recipe in recipes} == {"bowl", "teapot", "cylinder"}
    assert ((mu >= 0.03) & (mu <= 2.0)).all()
    assert np.median(mu) < 0.6  # the middle of the logarithms is 0.24
    assert ((bottoms == 0) | ((bottoms >= 0.1) & (bottoms <= 0.4))).all()
    assert 0.25 < (bottoms == 0).mean() < 0.75


def test_a_key_changes_with_the_inputs_and_the_file(read, tmp_path):
    pot = tmp_path / "pot.csv"
    text = drawn(1).replace('"bowl", "teapot"', '"*.csv"').replace("cylinders", "# cylinders")

    def key(seed=0):
        return tasks(read(text.replace("seed = 0", f"seed = {seed}")))[0].key

    pot.write_text("height,radius\n0,1\n1,1\n")
    before = key()
    assert key() == before
    assert key(seed=1) != before
    pot.write_text("height,radius\n0,1\n1,2\n")
    assert key() != before


def test_a_folder_adds_its_profiles(read, tmp_path):
    (tmp_path / "more").mkdir()
    (tmp_path / "more" / "jug.csv").write_text("height,radius\n0,1\n1,1\n")
    found = read(drawn(1), profiles=tmp_path / "more")
    assert [name.split("/")[-1] for name in found.scenes[0].profiles] == [
        "bowl",
        "teapot",
        "jug.csv",
    ]
    with pytest.raises(ValueError, match=r"no table of .* has profiles"):
        read(SMALL, profiles=tmp_path / "more")


@pytest.mark.parametrize(("one", "other"), [("1", "1.0"), ("10", "1e1")])
def test_an_int_is_the_float_of_its_value(read, one, other):
    first, second = (
        tasks(read(SMALL.replace("ratio = 0.8", f"ratio = {n}").replace("[1e-4, 1e-14]", same)))
        for n, same in ((one, "1"), (other, "1.0"))
    )
    assert [task.key for task in first] == [task.key for task in second]
    assert read("agree.energy = 1\n" + SMALL).agree.energy == 1


def test_a_setting_that_counts_is_whole_however_it_is_written(read):
    for counts in ("[100, 200]", "[100.0, 2e2]", "{ from = 100, to = 200, count = 2 }"):
        text = SMALL.replace("tolerance = [1e-4, 1e-14]", f"max_iterations = {counts}")
        entries = read(text).methods[0].settings["max_iterations"].entries
        assert entries == (100, 200)
        assert all(isinstance(entry, int) for entry in entries)


def test_settings_need_only_be_right_together(read):
    steps = "settings = { step = 1e-8, smallest_step = [1e-9, 1e-10] }"
    found = read(SMALL.replace('name = "greedy"', f'name = "greedy-refined"\n{steps}'))
    assert found.methods[1].settings["smallest_step"].entries == (1e-9, 1e-10)


def test_a_byte_order_mark_is_no_part_of_the_file(tmp_path):
    path = tmp_path / "one.toml"
    path.write_bytes(SMALL.encode("utf-8-sig"))
    assert read_experiment(path).slices.entries == (8, 16)


@pytest.mark.parametrize("name", packaged())
def test_packaged_experiments_can_be_run(name):
    assert tasks(read_experiment(name))


def test_a_dry_run_says_how_much_and_writes_nothing(tmp_path, capsys):
    path = tmp_path / "one.toml"
    path.write_text(SMALL)
    assert main(["sweep", str(path), "--out", str(tmp_path / "out"), "--dry-run"]) == 0
    assert re.search(r"72 tasks \(12 scenes, 4 shapes.*about .* s to go", capsys.readouterr().out)
    assert not (tmp_path / "out").exists()


def test_bad_requests_end_with_2(tmp_path, capsys):
    path = tmp_path / "one.toml"
    path.write_text(SMALL.replace("throughput", "timing"))
    common = ["sweep", str(path), "--out", str(tmp_path / "out")]
    assert main([*common, "--backend", "processes"]) == 2
    assert "backend must be serial" in capsys.readouterr().err
    assert main([*common, "--scheduler", "tcp://here:1"]) == 2
    assert "belongs to --backend dask" in capsys.readouterr().err
    assert main(["report", str(tmp_path)]) == 2
    assert "no results in" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
