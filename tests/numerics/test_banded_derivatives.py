"""Derivatives of the banded minimum by what the function takes, against finite differences."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxclay.numerics.banded_newton import minimize_banded

COUNTS = np.random.default_rng(0).poisson(6.0, 20).astype(float)


def smoothing(x, data, weight):
    return jnp.sum(jnp.exp(x) - data["counts"] * x) + weight * jnp.sum(jnp.diff(x, 2) ** 2)


def solved(counts, weight):
    return minimize_banded(smoothing, np.zeros(20), 2, args=({"counts": counts}, weight))


def figure(counts, weight):
    """Something of x and of the value."""
    result = solved(counts, weight)
    return jnp.sum(jnp.sin(result.x)) + result.value / 7


def slope(fun, at, step=1e-4):
    """Central difference of fourth order."""
    with jax.enable_x64(True):
        f = [float(fun(at + k * step)) for k in (-2, -1, 1, 2)]
    return (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step)


@pytest.mark.parametrize("transform", [jax.grad, jax.jacfwd])
def test_derivatives_are_those_of_differences(transform):
    with jax.enable_x64(True):
        by_counts, by_weight = jax.jit(transform(figure, (0, 1)))(COUNTS, 3.0)
    np.testing.assert_allclose(by_weight, slope(lambda w: figure(COUNTS, w), 3.0), rtol=1e-8)
    direction = np.cos(np.arange(20))
    along = slope(lambda t: figure(COUNTS + t * direction, 3.0), 0.0)
    np.testing.assert_allclose(np.asarray(by_counts) @ direction, along, rtol=1e-8)


def test_jvp_moves_the_whole_minimum():
    with jax.enable_x64(True):
        x, change = jax.jvp(lambda w: solved(COUNTS, w).x, (3.0,), (1.0,))
    assert isinstance(x, jax.Array)
    expected = [slope(lambda w, i=i: solved(COUNTS, w).x[i], 3.0) for i in range(20)]
    np.testing.assert_allclose(change, expected, rtol=1e-7, atol=1e-11)


def test_second_derivatives_are_those_of_differences():
    with jax.enable_x64(True):
        first = jax.jit(jax.grad(figure, 1))
        second = jax.jit(jax.grad(jax.grad(figure, 1), 1))(COUNTS, 3.0)
        expected = slope(lambda w: first(COUNTS, w), 3.0)
    np.testing.assert_allclose(second, expected, rtol=1e-7)


def test_gradients_of_many_at_once():
    weights = np.array([0.1, 3.0, 100.0])
    with jax.enable_x64(True):
        many = jax.jit(jax.vmap(jax.grad(figure, 1), (None, 0)))(COUNTS, weights)
        each = [jax.grad(figure, 1)(COUNTS, weight) for weight in weights]
    np.testing.assert_allclose(many, each, rtol=1e-9)


def test_the_start_is_no_matter_and_whole_numbers_have_no_derivative():
    def value(start, weight, power):
        return jnp.sum(minimize_banded(powers, start, 1, args=(weight, power)).x)

    with jax.enable_x64(True):
        by_start, by_weight = jax.grad(value, (0, 1))(np.ones(4), 2.0, 4)
    assert not by_start.any()
    # 4 (x - 1)^3 + 2 w x = 0 in each coordinate
    expected = slope(lambda w: value(np.ones(4), w, 4), 2.0)
    np.testing.assert_allclose(by_weight, expected, rtol=1e-7)


def powers(x, weight, power):
    return jnp.sum((x - 1) ** power + weight * x**2)


@pytest.mark.parametrize("transform", [jax.grad, jax.jit, lambda f: lambda w: jax.vmap(f)(w[None])])
@pytest.mark.parametrize("start_traced", [False, True])
def test_traced_values_in_a_closure_are_refused(transform, start_traced):
    def value(weight):
        start = np.zeros(4) + weight if start_traced else np.zeros(4)
        return minimize_banded(lambda x: jnp.sum((x - weight) ** 2), start, 1).value

    with jax.enable_x64(True), pytest.raises(TypeError, match=r"give them in args, as in"):
        transform(value)(jnp.asarray(2.0))


def test_constants_in_a_closure_are_welcome_inside_jit():
    weight = jnp.ones(4)
    with jax.enable_x64(True):
        x = jax.jit(lambda s: minimize_banded(lambda x: jnp.sum((x - weight) ** 2), s, 1).x)(
            jnp.zeros(4)
        )
    np.testing.assert_allclose(x, 1)
