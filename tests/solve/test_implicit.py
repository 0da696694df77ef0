"""Derivatives through the minimum, against central differences of certified minima."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxclay

MATERIAL = {"k": 1.0, "mu": 0.7, "alpha": 1e-3, "beta": 1e-5}
BOTTOM = {"bottom": 0.0, "top": 0.3, "radius": 0.4}
MIDDLE = {"bottom": 0.4, "top": 0.7, "radius": 0.4}
HELD = MIDDLE | {"top_fixed": True}


def figures(values, method="newton"):
    """A few heights, radii and the energy after a squash."""
    material = jaxclay.Material(**{name: values[name] for name in MATERIAL})
    squash = {name: value for name, value in values.items() if name not in MATERIAL}
    clay = jaxclay.Clay.cylinder(slices=64)
    answer = jaxclay.deform(clay, jaxclay.Squash(**squash), material, method=method, scheme="paper")
    return (answer.heights[25], answer.heights[50], answer.clay.radii[20], answer.energy)


def central_difference(values, name, step):
    ends = []
    for sign in (1, -1):
        moved = values | {name: values[name] + sign * step}
        ends.append(np.array([float(v) for v in figures(moved)]))
    return (ends[0] - ends[1]) / (2 * step)


def derivatives(values, names, transform, method="newton"):
    """The figures' derivatives by each of the names, from one compilation."""

    def function(varied):
        return jnp.stack(figures(values | varied, method))

    with jax.enable_x64(True):
        found = jax.jit(transform(function))({name: values[name] for name in names})
    return {name: np.asarray(column) for name, column in found.items()}


@pytest.mark.parametrize(
    ("squash", "steps", "transform"),
    [
        (BOTTOM, {"radius": 1e-5, "mu": 1e-5, "k": 1e-5, "alpha": 1e-8, "beta": 1e-10}, jax.jacrev),
        (BOTTOM, {"mu": 1e-5}, jax.jacfwd),
        (MIDDLE, {"radius": 1e-5, "bottom": 1e-5}, jax.jacrev),
        (HELD, {"top": 1e-5}, jax.jacrev),
    ],
)
def test_against_central_differences(squash, steps, transform):
    values = MATERIAL | squash
    found = derivatives(values, list(steps), transform)
    for name, step in steps.items():
        expected = central_difference(values, name, step)
        atol = 1e-6 * np.abs(expected).max()
        np.testing.assert_allclose(found[name], expected, rtol=2e-5, atol=atol, err_msg=name)


def test_the_derivative_is_the_minimums_whatever_the_method():
    values = MATERIAL | BOTTOM
    newton = derivatives(values, ["mu"], jax.jacfwd)["mu"]
    other = derivatives(values, ["mu"], jax.jacfwd, method="lbfgs-preconditioned")["mu"]
    np.testing.assert_allclose(other, newton, rtol=1e-4, atol=1e-8)


def test_slices_on_the_floor_stay_there():
    """E_move alone, deep: the lower bound holds, and the closed form says how the rest follows."""
    values = {"k": 1.0, "mu": 4.0, "alpha": 0.0, "beta": 0.0} | BOTTOM | {"radius": 0.3}
    clay = jaxclay.Clay.cylinder(slices=64)
    material = jaxclay.Material(mu=4.0, alpha=0.0, beta=0.0)
    solution = jaxclay.deform(clay, jaxclay.Squash(0.0, 0.3, 0.3), material, scheme="paper")
    assert solution.certificate.on_floor > 0
    expected = central_difference(values, "radius", 1e-6)
    found = derivatives(values, ["radius"], jax.jacrev)["radius"]
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)


@pytest.mark.slow
def test_batched_gradients():
    def energy(mu):
        return figures(MATERIAL | BOTTOM | {"mu": mu})[-1]

    with jax.enable_x64(True):
        batched = jax.jit(jax.vmap(jax.grad(energy)))(jnp.array([0.3, 0.7]))
        single = jax.jit(jax.grad(energy))(0.7)
    np.testing.assert_allclose(batched[1], single, rtol=1e-9)
