"""Whoever has JAX refuse to promote dtypes can use the package all the same."""

import jax
import numpy as np
import pytest
from scenes import MIDDLE

import jaxclay
from jaxclay import Clay, Material, Squash, deform, minimize, pose

MATERIAL = Material(mu=0.5)
SIZES = {"paper": {"slices": 24}, "slices": {"slices": 24}, "spline": {"elements": 4}}


@pytest.fixture(autouse=True)
def strict():
    jax.clear_caches()  # what has been traced is not traced again
    with jax.numpy_dtype_promotion("strict"):
        yield


@pytest.mark.parametrize("scheme", SIZES)
def test_host_calls(scheme):
    problem = pose(Clay.cylinder(slices=24), MIDDLE, MATERIAL, scheme, **SIZES[scheme])
    best = minimize(problem).raise_for_status()
    unknowns = best.point.coefficients if scheme == "spline" else best.heights
    assert jaxclay.total_energy(problem, unknowns) == pytest.approx(float(best.energy), rel=1e-9)
    assert jaxclay.rough_shape(problem).case == best.rough.case
    again = minimize(problem, "lbfgs-preconditioned", start=best)
    assert again.energy == pytest.approx(float(best.energy), rel=1e-9)


@pytest.mark.parametrize("method", ["lbfgsb", "greedy-refined", "lattice", "adam"])
def test_methods_without_splines(method):
    problem = pose(Clay.cylinder(slices=24), MIDDLE, MATERIAL, "paper")
    rough = jaxclay.total_energy(problem, jaxclay.rough_shape(problem).heights)
    least = minimize(problem).energy * (1 - 1e-9)
    assert least <= minimize(problem, method).energy <= rough


def test_whole_squashes_of_a_profile():
    clay = jaxclay.load_profile("bowl", 32)
    squash = Squash(0.0, 0.1, 0.2)
    answer = deform(clay, squash, MATERIAL, tolerance=1e-2).raise_for_status()
    (other,) = jaxclay.deform_batch([(clay, squash, MATERIAL)], tolerance=1e-2)
    np.testing.assert_allclose(other.heights, answer.heights, atol=1e-9)


@pytest.mark.slow
def test_derivatives_through_a_minimum():
    def energy(radius):
        squash = Squash(0.35, 0.6, radius)
        return deform(Clay.cylinder(slices=24), squash, MATERIAL, scheme="paper").energy

    step = 1e-5
    expected = (energy(0.4 + step) - energy(0.4 - step)) / (2 * step)
    with jax.enable_x64(True):
        assert jax.grad(energy)(0.4) == pytest.approx(float(expected), rel=1e-5)
