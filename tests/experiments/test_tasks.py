"""Tasks: which are the same, whatever file they stand in."""

import pytest

pytest.importorskip("pydantic")

from jaxclay.clay.clay import Clay
from jaxclay.experiments.entries.reading import read_experiment
from jaxclay.experiments.entries.tasks import tasks
from jaxclay.files.profiles import save_profile

TEXT = """\
kind = "throughput"
slices = 8
[[scenes]]
cylinders = { radius = 0.5 }
squash = { bottom = 0.0, height = 0.3, ratio = RATIO }
material = { mu = MU }
[[methods]]
name = "greedy"
settings = { step = STEP }
"""


@pytest.fixture
def keys(tmp_path):
    """Keys of the tasks of a file with these numbers."""

    def read(ratio="[0.7, 0.8]", mu="[0.5, 1]", step="1e-3", text=TEXT):
        path = tmp_path / "small.toml"
        path.write_text(text.replace("RATIO", ratio).replace("MU", mu).replace("STEP", step))
        return [task.key for task in tasks(read_experiment(path))]

    return read


def test_a_number_more_leaves_the_other_tasks_what_they_were(keys):
    assert set(keys()) < set(keys(mu="[0.5, 0.7, 1]"))
    assert len(keys(mu="[0.5, 0.7, 1]")) == 6


def test_the_same_number_is_the_same_task_however_written(keys):
    assert keys(mu="[0.5, 1]") == keys(mu="[0.5, 1.0]")
    assert len(keys(mu="[0.5, 1, 0.5]")) == 4


def test_settings_that_differ_in_a_late_digit_differ_in_words(tmp_path, keys):
    assert len(set(keys(step="[2e-3, 2.00000001e-3]"))) == 8
    chosen = {task.chosen for task in tasks(read_experiment(tmp_path / "small.toml"))}
    assert chosen == {"step=0.002", "step=0.00200000001"}


def test_a_file_that_changes_is_another_scene(tmp_path, keys):
    text = TEXT.replace("cylinders = { radius = 0.5 }", 'profiles = ["pot.csv"]')
    save_profile(Clay.cylinder(0.3), tmp_path / "pot.csv")
    first = keys(text=text)
    (old, *_) = tasks(read_experiment(tmp_path / "small.toml"))
    assert float(old.specification.scene().clay(8).radii[0]) == pytest.approx(0.3)
    save_profile(Clay.cylinder(0.6), tmp_path / "pot.csv")
    assert not set(first) & set(keys(text=text))
    with pytest.raises(OSError, match="has changed: run the experiment again"):
        old.specification.scene()
    save_profile(Clay.cylinder(0.3), tmp_path / "pot.csv")
    assert keys(text=text) == first
