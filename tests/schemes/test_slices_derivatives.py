"""Derivatives through the minimum, first and second, against differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import wavy

from jaxclay import Clay, Material, Squash, deform
from jaxclay.schemes.slices.posing import place

BAND = (0.3, 0.6)
SEED, DRAWN_IN = 44, [0.46764, 0.81568, 0.60464, 1.35118]


def by_paper(values):
    """A scalar of the minimum by radius and mu; the band keeps its nodes close by."""
    radius, mu = values
    squash, material = Squash(0.0, 0.35, radius), Material(1.0, mu, 0.05, 1e-3)
    heights = deform(Clay.cylinder(slices=16), squash, material, scheme="paper").heights
    return jnp.sum(heights**2) + heights[-1]


def by_slices(values):
    """A scalar of the minimum by radius, top and mu, one-sided; its nodes move with the edge."""
    radius, top, mu = values
    squash, material = Squash(0.0, top, radius), Material(1.0, mu, 0.05, 1e-3)
    clay = deform(Clay.cylinder(slices=24), squash, material, slices=24).clay
    return jnp.sum(clay.heights**2) + clay.heights[-1] + jnp.sum(clay.radii)


def by_slices_in_the_middle(values):
    """The same by both heights of the tool, its radius and mu."""
    bottom, top, radius, mu = values
    squash, material = Squash(bottom, top, radius), Material(1.0, mu, 0.05, 1e-3)
    clay = deform(Clay.cylinder(slices=24), squash, material, slices=24).clay
    return jnp.sum(clay.heights**2) + clay.heights[-1] + jnp.sum(clay.radii)


def differences(function, at, step):
    """Central differences by each value, of order 4, stacked along the last axis."""
    rows = []
    for i in range(len(at)):
        e = np.zeros(len(at))
        e[i] = step * at[i]
        near, far = (
            np.asarray(function(at + s * e)) - np.asarray(function(at - s * e)) for s in (1, 2)
        )
        rows.append((8 * near - far) / (12 * e[i]))
    return np.stack(rows, axis=-1)


def check(function, at, second):
    at = np.array(at)
    gradient = jax.grad(function)

    # One program for both, as compiling takes most of the time: the derivative along a direction.
    @jax.jit
    def along(at, direction):
        return jax.jvp(gradient, (at,), (direction,)) if second else (gradient(at), direction)

    with jax.enable_x64(True):
        value = jax.jit(function)
        axes = np.eye(len(at))
        found = np.asarray(along(at, axes[0])[0])
        expected = differences(value, at, 1e-4)
        np.testing.assert_allclose(found, expected, rtol=2e-6, atol=1e-7)
        assert (abs(found) > 1e-4).all()
        if second:
            hessian = np.array([along(at, axis)[1] for axis in axes])
            np.testing.assert_allclose(hessian, hessian.T, rtol=1e-6, atol=1e-7)
            expected = differences(lambda at: along(at, axes[0])[0], at, 1e-4)
            np.testing.assert_allclose(hessian, expected, rtol=2e-5, atol=1e-5)


def test_second_derivatives_on_the_papers_scheme():
    check(by_paper, [0.42, 0.8], second=True)


@pytest.mark.slow
def test_second_derivatives_on_slices():
    check(by_slices, [0.42, 0.35, 0.8], second=True)


@pytest.mark.slow
def test_second_derivatives_of_a_band_in_the_middle():
    check(by_slices_in_the_middle, [*BAND, 0.42, 0.8], second=True)


def test_first_derivatives_by_the_tools_heights():
    check(by_slices_in_the_middle, [*BAND, 0.42, 0.8], second=False)


def lower_edge(values):
    """The lower edge of the material that the tool holds."""
    bottom, top, radius, mu = values
    squash, material = Squash(bottom, top, radius), Material(1.0, mu, 0.05, 1e-3)
    return place(Clay.cylinder(slices=24), squash, material).band.lower


@pytest.mark.slow
def test_the_band_moves_with_the_tool():
    """Everywhere, also where a place of the search is the band's own."""
    rng = np.random.default_rng(0)
    with jax.enable_x64(True):
        value, gradient = jax.jit(lower_edge), jax.jit(jax.grad(lower_edge))
        scenes = [[0.29994, 0.6, 0.42, 0.8]]
        for _ in range(60):
            bottom = rng.uniform(0.1, 0.5)
            top = bottom + rng.uniform(0.1, 0.4)
            scenes.append([bottom, top, rng.uniform(0.3, 0.49), rng.uniform(0.2, 1.5)])
        for at in np.array(scenes):
            found = np.asarray(gradient(at))
            expected = differences(value, at, 1e-6)
            np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-6, err_msg=str(at))


@pytest.mark.slow
def test_a_band_at_the_end_of_its_range_moves_with_the_tool():
    """Drawing in only from above: the band begins at the clay that was at its lower edge."""

    def lower(values):
        bottom, top, radius, mu = values
        squash, material = Squash(bottom, top, radius), Material(1.0, mu, 0.05, 1e-3)
        return place(wavy(SEED, 24), squash, material).band.lower

    at = np.array(DRAWN_IN)
    with jax.enable_x64(True):
        found = np.asarray(jax.jit(jax.grad(lower))(at))
        expected = differences(jax.jit(lower), at, 1e-6)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-6)
