"""Windows: the same answer as the whole clay's, from the part that moves."""

import numpy as np
import pytest
from scenes import SNAKE, cylinder_problem

import jaxclay

GRIPPY = jaxclay.Material.from_snake_units(mu=2.0, alpha=0.01, beta=0.01)
LOW = jaxclay.Squash(0.0, 0.03, 0.48)
HIGH = jaxclay.Squash(0.6, 0.63, 0.485)


@pytest.fixture(scope="module")
def whole():
    problems = {name: cylinder_problem(s, GRIPPY, slices=512) for name, s in SQUASHES.items()}
    return {name: jaxclay.minimize(problem) for name, problem in problems.items()}


SQUASHES = {"low": LOW, "high": HIGH}


@pytest.mark.parametrize("name", SQUASHES)
@pytest.mark.parametrize("window", ["auto", "tight"])
def test_the_answer_is_that_of_the_whole_clay(whole, name, window):
    problem, wanted = whole[name].problem, whole[name]
    if window == "tight":  # no more than what the tool holds: it has to widen by itself
        band = np.interp(wanted.rough.band, np.arange(513) / 512, problem.clay.heights)
        window = (max(band[0] - 1e-3, 0.0), band[1] + 1e-3)
    solution = jaxclay.minimize(problem, window=window)
    assert solution.status is jaxclay.Status.CONVERGED
    assert solution.energy == pytest.approx(wanted.energy, rel=1e-11)
    assert np.abs(solution.heights - wanted.heights).max() < 1e-9
    rests = wanted.heights == problem.clay.heights
    assert rests.sum() > 256
    assert (solution.heights[rests] == problem.clay.heights[rests]).all()


def test_a_window_as_large_as_the_clay_is_the_clay():
    problem = cylinder_problem(material=SNAKE)
    windowed = jaxclay.minimize(problem, window=(0.0, 1.0))
    assert windowed.energy == jaxclay.minimize(problem).energy


def test_a_window_is_measured_in_the_length_unit_of_the_clay(whole):
    tall = jaxclay.Clay.cylinder(radius=150.0, height=300.0, slices=512)
    problem = jaxclay.pose(tall, jaxclay.Squash(0.0, 9.0, 144.0), GRIPPY, "paper")
    solution = jaxclay.minimize(problem, window=(0.0, 60.0)).raise_for_status()
    assert solution.energy == pytest.approx(whole["low"].energy, rel=1e-10)
    assert solution.heights == pytest.approx(300 * whole["low"].heights, abs=1e-6)


@pytest.mark.parametrize(
    ("window", "message"),
    [
        ("near", "window must be 'auto' or"),
        (3, "window must be 'auto' or"),
        ((0.2, 0.1), "must lie within the clay"),
        ((-0.1, 0.5), "must lie within the clay"),
        ((0.0, 1.2), "must lie within the clay"),
        ((0.5, 0.9), "must hold the clay under the tool"),
        ((float("nan"), 0.9), "must lie within the clay"),
    ],
)
def test_bad_windows_are_refused(window, message):
    with pytest.raises(ValueError, match=message):
        jaxclay.minimize(cylinder_problem(), window=window)
