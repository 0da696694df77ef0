"""Coarse to fine: the same minimum, in few iterations a level."""

import jax
import numpy as np
import pytest
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE, cylinder_problem

import jaxclay
from jaxclay import refine


def test_grids_halve_down_to_where_the_rough_shape_is_near_enough():
    assert refine.grids(256) == []
    assert refine.grids(512) == [256]
    assert refine.grids(1500) == [188, 375, 750]


@pytest.mark.parametrize("material", [SNAKE, PRINTED], ids=["snake", "printed"])
@pytest.mark.parametrize("squash", [REFERENCE, MIDDLE], ids=["bottom", "middle"])
def test_the_minimum_is_that_of_a_cold_start(squash, material):
    problem = cylinder_problem(squash, material, slices=500)
    climbed = jaxclay.minimize(problem)
    cold = jaxclay.minimize(problem, start=jaxclay.rough_shape(problem).heights)
    assert climbed.status is cold.status is jaxclay.Status.CONVERGED
    assert (climbed.levels > 0).all()
    assert (cold.levels == 0).all()
    assert max(*climbed.levels, climbed.iterations) <= 25
    assert climbed.energy == pytest.approx(cold.energy, rel=1e-10)
    assert np.abs(climbed.heights - cold.heights).max() < 1e-7


def test_clay_that_rests_on_the_coarse_grid_starts_at_rest_on_the_fine_one():
    with jax.enable_x64(True):
        fine = cylinder_problem(slices=128)
        coarse = cylinder_problem(slices=64)
        minimum = jaxclay.minimize(coarse)
        assert (minimum.heights[50:] == coarse.clay.heights[50:]).all()
        point = jax.jit(refine.prolonged)(fine, coarse, minimum.point)
        assert (np.asarray(point.shift)[100:] == 0).all()
        assert (np.asarray(point.thickness)[100:] == fine.rest.thickness[100:]).all()
        # On the nodes that both grids have the displacement is the same.
        free = fine.free[::2]
        assert np.abs(np.asarray(point.shift)[::2] - minimum.point.shift)[free].max() < 1e-15


@pytest.mark.slow
@pytest.mark.parametrize("slices", [700, 1024, 2048])
def test_printed_constants_are_certified_on_fine_grids(slices):
    from jaxclay.compare.scenes import NAMED

    for name in ("reference", "fig4b", "fig4c"):
        problem = NAMED[name].problems("printed", slices)[-1]
        solution = jaxclay.minimize(problem).raise_for_status()
        assert max(*solution.levels, solution.iterations) <= 25
