"""How Newton's method for banded Hessians ends: what is a minimum, and what is not."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

from jaxclay.numerics.banded_newton import minimize_banded
from jaxclay.numerics.banded_steps import BandedStatus

FEW = settings(max_examples=15, deadline=None)


def tilted(x):
    return jnp.sum(jnp.exp(x) - x)


def wells(x):
    return jnp.sum((x**2 - 1) ** 2)


@pytest.mark.parametrize("start", [300.0, 700.0, -1e6, 0.0, 1e-9])
def test_an_exponential_is_followed_to_its_minimum_from_afar(start):
    result = minimize_banded(tilted, np.array([start, 1.0]), 1)
    assert result.converged, result.message
    np.testing.assert_allclose(result.x, 0, atol=1e-12)


@FEW
@given(st.lists(st.floats(-1e8, 1e8), min_size=2, max_size=2))
def test_no_start_hides_a_coordinate(start):
    """Two wells each; 0, their saddle, is left."""
    result = minimize_banded(wells, np.array(start), 1)
    assert result.converged, result.message
    np.testing.assert_allclose(np.abs(result.x), 1, rtol=1e-12)


SCALES = np.array([1e8, 1e-8, 1.0, 1e4, 1e-4, 1e8])


def scaled(x, sizes, weights):
    y = x / sizes - 1
    return jnp.sum(weights * (jnp.cosh(y) - y / 2)) + jnp.sum((y[1:] - y[:-1]) ** 2)


@FEW
@given(st.lists(st.floats(-20, 20), min_size=6, max_size=6), st.floats(-8, 8))
def test_coordinates_of_all_sizes_are_found_as_closely(start, decades):
    weights = np.geomspace(1, 10**decades, 6)
    result = minimize_banded(scaled, SCALES * start, 1, args=(SCALES, weights))
    plain = minimize_banded(scaled, np.zeros(6), 1, args=(np.ones(6), weights))
    assert result.converged, result.message
    assert plain.converged, plain.message
    np.testing.assert_allclose(result.x / SCALES, plain.x, rtol=1e-7)


@pytest.mark.parametrize("constant", [0.0, -1.0, 1e8, -1e12])
def test_a_constant_that_hides_the_value_hides_no_minimum(constant):
    """exp(x) - x - 1 is 0 at its minimum, where its rounding is all there is."""

    def fun(x):
        return jnp.sum(jnp.exp(x) - x) + 50 * jnp.sum(jnp.diff(x) ** 2) + constant

    result = minimize_banded(fun, np.array([3.0, 1.0, 2.0, 0.3, -2.0]), 1)
    assert result.converged, result.message
    np.testing.assert_allclose(result.x, 0, atol=1e-12)


def differences(y):
    return np.diff(np.eye(len(y)), 2, axis=0)


def poisson(x, counts, weight):
    return jnp.sum(jnp.exp(x) - counts * x) + weight / 2 * jnp.sum(jnp.diff(x, 2) ** 2)


def dense_newton(counts, weight):
    """By NumPy, from log(counts + 1), where whole steps converge."""
    D, x = differences(counts), np.log(counts + 1.0)
    for _ in range(60):
        g = np.exp(x) - counts + weight * D.T @ (D @ x)
        x = x - np.linalg.solve(np.diag(np.exp(x)) + weight * D.T @ D, g)
    return x


@FEW
@given(seed=st.integers(0, 10**6), decades=st.floats(-2, 6), start=st.floats(-100, 200))
def test_smoothed_counts_are_those_of_a_dense_newton(seed, decades, start):
    rng = np.random.default_rng(seed)
    counts = rng.poisson(np.exp(2 + 2 * np.sin(np.linspace(0, 6, 60)))).astype(float)
    weight = 10**decades
    far = start + rng.normal(size=60)
    result = minimize_banded(poisson, far, 2, args=(counts, weight))
    assert result.converged, result.message
    np.testing.assert_allclose(result.x, dense_newton(counts, weight), atol=1e-7)


def test_smoothed_counts_are_no_worse_than_scipys():
    counts = np.random.default_rng(3).poisson(5, 30).astype(float)
    result = minimize_banded(poisson, np.full(30, -50.0), 2, args=(counts, 10.0))
    with jax.enable_x64(True):
        fun = jax.jit(jax.value_and_grad(lambda x: poisson(x, counts, 10.0)))
        other = minimize(lambda x: tuple(map(np.array, fun(x))), np.zeros(30), jac=True)
    assert result.value <= other.fun + 1e-12 * abs(other.fun)
    np.testing.assert_allclose(result.x, other.x, atol=1e-4)


BOTTOMLESS = {
    "linear": lambda x: jnp.sum(x) + 1e8,
    "parabola": lambda x: -jnp.sum(x**2),
    "cubic": lambda x: jnp.sum(x**3),
    "cubic and parabola": lambda x: x[0] ** 3 + x[1] ** 2,
    "exponential": lambda x: -jnp.sum(jnp.exp(x)),
    "logarithm": lambda x: -jnp.sum(jnp.log(jnp.abs(x) + 1)),
}


@pytest.mark.parametrize("start", [[0.0, 0.0], [1.0, 2.0], [-3.0, 1e-3], [1e2, 0.0]])
@pytest.mark.parametrize("name", BOTTOMLESS)
def test_what_falls_for_ever_is_unbounded(name, start):
    result = minimize_banded(BOTTOMLESS[name], np.array(start), 1)
    assert result.status == BandedStatus.UNBOUNDED, result.message
    assert result.message.startswith("unbounded: ")


@pytest.mark.parametrize("power", [4, 6, 10])
def test_minima_without_curvature_are_minima(power):
    start = np.array([5.0, -2.0, 3.0])
    result = minimize_banded(lambda x: jnp.sum((x - 1) ** power) + (x[0] - 1) ** 2, start, 1)
    assert result.converged, result.message
    np.testing.assert_allclose(result.x, 1, atol=1e-8)


def apart(x):
    """Nothing changes if all move together."""
    return jnp.sum(jnp.cosh(jnp.diff(x) - 1))


@FEW
@given(st.lists(st.floats(-30, 30), min_size=12, max_size=12))
def test_a_minimum_along_a_whole_line_is_one(start):
    result = minimize_banded(apart, np.array(start), 1)
    assert result.converged, result.message
    np.testing.assert_allclose(np.diff(result.x), 1, atol=1e-9)


def test_a_coordinate_that_counts_for_nothing_stays():
    result = minimize_banded(lambda x: jnp.sum(jnp.cosh(x[1:])), np.array([7.0, 1.0, 2.0]), 1)
    assert result.converged, result.message
    assert result.x[0] == 7


SADDLES = {
    "wells": lambda x: wells(x) + 0.1 * jnp.sum(jnp.diff(x) ** 2),
    "pairs": lambda x: jnp.sum(x[1:] * x[:-1]) + jnp.sum(x**4),
    "one of all": lambda x: jnp.sum((x - 1) ** 2) - 2 * x[0] ** 2 + x[0] ** 4 + 2 * x[0],
    "raised": lambda x: wells(x) + 1e6,
    "monkey": lambda x: x[0] ** 3 - 3 * x[0] * x[1] ** 2 + jnp.sum(x**4),
}


@pytest.mark.parametrize("name", SADDLES)
def test_saddles_are_left_for_a_minimum(name):
    fun = SADDLES[name]
    start = np.zeros(5)
    result = minimize_banded(fun, start, 1)
    with jax.enable_x64(True):
        least = np.linalg.eigvalsh(jax.hessian(fun)(jnp.asarray(result.x)))[0]
    assert result.converged, result.message
    assert result.value < fun(start)
    assert least > (-1e-12 if name == "monkey" else 0)  # where it leaves x^4 at 0


@FEW
@given(seed=st.integers(0, 10**6))
def test_converged_is_a_minimum_of_any_landscape(seed):
    """Waves of several lengths, coupled: full of saddles; eigenvalues by NumPy."""
    rng = np.random.default_rng(seed)
    phases, couple = rng.uniform(0, 6, (2, 8)), rng.normal()
    result = minimize_banded(waves, rng.normal(size=8), 1, args=(phases, couple))
    g, H = waves_model(result.x, phases, couple)
    assert result.converged, result.message
    assert np.abs(g).max() < 1e-12
    assert np.linalg.eigvalsh(H)[0] > 0


def waves(x, phases, couple):
    one, two = phases
    return jnp.sum(jnp.cos(3 * x + one) + x**2 / 9) + couple * jnp.sum(
        jnp.sin(x[1:] * x[:-1] + two[1:])
    )


def waves_model(x, phases, couple):
    with jax.enable_x64(True):
        args = (jnp.asarray(x), phases, couple)
        return np.array(jax.grad(waves)(*args)), np.array(jax.hessian(waves)(*args))


@pytest.mark.parametrize("size", [1e300, 1e-200, 1.0])
def test_the_functions_own_scale_is_no_matter(size):
    result = minimize_banded(
        lambda x, size: size * jnp.sum(jnp.cosh(x - 1)), np.array([5.0, 9.0]), 1, args=(size,)
    )
    assert result.converged, result.message
    np.testing.assert_allclose(result.x, 1, rtol=1e-12)


@pytest.mark.parametrize("start", [709.5, 800.0])
def test_a_hessian_that_overflows_is_not_finite(start):
    result = minimize_banded(lambda x: jnp.sum(jnp.exp(2 * x)), np.array([start, 0.0]), 1)
    assert result.status == BandedStatus.NON_FINITE
    assert "scale the function" in result.message


def test_a_kink_is_no_minimum_that_is_told():
    result = minimize_banded(lambda x: jnp.sum(jnp.abs(x - 0.1) + x**2), np.array([3.0, 5.0]), 1)
    assert not result.converged
    np.testing.assert_allclose(result.x, 0.1, atol=1e-6)


def test_statuses_read_as_those_of_clay():
    for status in BandedStatus:
        assert str(status) == status.name.lower().replace("_", " ").replace(
            "non finite", "non-finite"
        )
    result = minimize_banded(tilted, np.ones(3), 1, max_iterations=1)
    assert result.status == BandedStatus.ITERATION_LIMIT
    assert str(result.status) == "iteration limit"
