"""Drag mode: an answer close by as the start, and nothing compiled twice."""

import numpy as np
import pytest
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE, cylinder_problem, wavy

import jaxclay
from jaxclay.solve.certified_newton import program
from jaxclay.solve.minimize import minimize

CLAY = jaxclay.Clay.cylinder(slices=64)
PATHS = {
    "radius": [jaxclay.Squash(0.0, 0.29296875, 0.45 - 0.005 * i) for i in range(8)],
    "top": [jaxclay.Squash(0.0, 0.25 + 0.01 * i, 0.42) for i in range(8)],
    "middle": [jaxclay.Squash(0.3 + 0.01 * i, 0.5 + 0.01 * i, 0.42) for i in range(8)],
}


@pytest.mark.parametrize("material", [SNAKE, PRINTED], ids=["snake", "printed"])
@pytest.mark.parametrize("path", PATHS)
def test_dragging_ends_in_the_minima_of_cold_starts(path, material):
    previous = None
    for squash in PATHS[path]:
        problem = jaxclay.pose(CLAY, squash, material, "paper")
        previous = minimize(problem, start=previous).raise_for_status()
        anew = minimize(problem)
        assert previous.energy == pytest.approx(anew.energy, rel=1e-9)
        assert np.abs(previous.heights - anew.heights).max() < 1e-6


def test_a_small_step_takes_fewer_iterations_than_a_cold_start():
    first = minimize(cylinder_problem(REFERENCE, PRINTED))
    problem = cylinder_problem(jaxclay.Squash(0.0, 0.29296875, 0.399), PRINTED)
    assert minimize(problem, start=first).iterations < minimize(problem).iterations


def test_nothing_is_compiled_after_the_first_call_on_as_many_slices():
    first = minimize(cylinder_problem())
    compiled = program.whole._cache_size()
    minimize(cylinder_problem(MIDDLE, PRINTED), start=first)
    minimize(cylinder_problem(MIDDLE, jaxclay.Material(2.0, 0.1, 0.0, 0.3, floor=0.2)))
    heights = jaxclay.rough_shape(cylinder_problem(radius=0.7, height=3.0)).heights
    minimize(cylinder_problem(radius=0.7, height=3.0), start=heights, max_iterations=5)
    minimize(jaxclay.pose(wavy(3), REFERENCE, SNAKE, "paper"), tolerance=1e-10)
    held = jaxclay.Squash(0.0, 0.3, 0.4, top_fixed=True)
    minimize(cylinder_problem(held), start=first)
    assert program.whole._cache_size() == compiled


def test_an_answer_on_other_slices_is_refused():
    with pytest.raises(ValueError, match="answer on 64 slices, but this clay has 65"):
        minimize(cylinder_problem(slices=65), start=minimize(cylinder_problem()))


SCHEMES = {"paper": {"slices": 24}, "slices": {"slices": 24}, "spline": {"elements": 4}}


@pytest.mark.parametrize("given", SCHEMES)
@pytest.mark.parametrize("wanted", SCHEMES)
def test_a_start_on_another_scheme_is_refused_with_both_names(wanted, given):
    material = jaxclay.Material(mu=0.5)
    problem, other = (
        jaxclay.pose(jaxclay.Clay.cylinder(slices=24), MIDDLE, material, scheme, **SCHEMES[scheme])
        for scheme in (wanted, given)
    )
    answer = minimize(other)
    if wanted == given:
        for start in (answer, answer.point):
            assert minimize(problem, start=start).energy == pytest.approx(answer.energy, rel=1e-9)
        return
    with pytest.raises(ValueError, match=f'scheme "{given}", .* on scheme "{wanted}": pose both'):
        minimize(problem, start=answer)
    if "spline" in (wanted, given):
        with pytest.raises(ValueError, match=f'{given}.*on scheme "{wanted}": pose both'):
            minimize(problem, start=answer.point)
    if wanted != "spline":  # what the message says to do
        heights = answer.clay.height_at(problem.clay.material)
        expected = minimize(problem).energy
        assert minimize(problem, start=heights).energy == pytest.approx(expected, rel=1e-9)


def test_a_point_on_other_slices_is_refused():
    point = minimize(cylinder_problem()).point
    with pytest.raises(ValueError, match="each of 66 nodes: got shape"):
        minimize(cylinder_problem(slices=65), start=point)


def test_a_batch_refuses_splines_by_name():
    spline = jaxclay.pose(CLAY, MIDDLE, SNAKE, "spline", elements=4)
    with pytest.raises(ValueError, match=r'problems\[1\] is on scheme "spline".*minimize'):
        jaxclay.minimize_batch([cylinder_problem(), spline])
