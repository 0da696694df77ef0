"""Banded Hessians, their factor and their product, against SciPy and dense matrices."""

from functools import lru_cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import solveh_banded

from jaxclay.numerics import banded

# Fewer rows than a dense factor takes, exact multiples of a block, one more, many levels.
SIZES = [(2, 1), (36, 3), (37, 1), (73, 3), (100, 5), (257, 2)]
FEW = settings(max_examples=20, deadline=None)


def random_bands(n, half_bandwidth, seed, dominance):
    """Symmetric bands, diagonally dominant if ``dominance`` exceeds 1, over eight decades."""
    rng = np.random.default_rng(seed)
    bands = rng.normal(size=(half_bandwidth + 1, n))
    for k in range(1, half_bandwidth + 1):
        bands[k, n - k :] = 0
    beside = np.abs(bands[1:]).sum(axis=0)
    for k in range(1, half_bandwidth + 1):
        beside[k:] += np.abs(bands[k, : n - k])
    bands[0] = dominance * beside + 1e-3
    return bands * np.exp(rng.uniform(-9, 9))


def dense(bands):
    n = bands.shape[1]
    matrix = np.diag(bands[0])
    for k in range(1, len(bands)):
        matrix += np.diag(bands[k, : n - k], k) + np.diag(bands[k, : n - k], -k)
    return matrix


@lru_cache
def compiled(n, half_bandwidth):
    """Factor and solve for one shape, compiled once."""

    def call(bands, rhs):
        factor = banded.factorize(bands)
        return banded.solve(factor, rhs), factor.positive

    def on_host(bands, rhs):
        with jax.enable_x64(True):
            return jax.tree.map(np.asarray, jitted(bands, rhs))

    jitted = jax.jit(call)
    return on_host


@pytest.mark.parametrize(("n", "b"), SIZES)
@FEW
@given(seed=st.integers(0, 10**6), dominance=st.floats(1.01, 10.0))
def test_solves_as_scipy_does(n, b, seed, dominance):
    bands = random_bands(n, b, seed, dominance)
    rhs = np.random.default_rng(seed + 1).normal(size=n)
    x, positive = compiled(n, b)(bands, rhs)
    expected = solveh_banded(bands, rhs, lower=True)
    assert positive
    np.testing.assert_allclose(x, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize(("n", "b"), SIZES)
@FEW
@given(seed=st.integers(0, 10**6), place=st.floats(-1, 1))
def test_positive_definite_or_not_as_eigenvalues_say(n, b, seed, place):
    """The diagonal is moved so that the least eigenvalue lies on either side of 0."""
    bands = random_bands(n, b, seed, 0.5)
    values = np.linalg.eigvalsh(dense(bands))
    size = np.abs(values).max()
    if abs(place) < 1e-9:
        place = 1e-9  # nearer to 0 rounding decides
    bands[0] += place * size - values[0]
    assert compiled(n, b)(bands, np.zeros(n))[1] == (place > 0)


def test_a_pivot_of_nothing_is_not_positive():
    singular = np.array([[1.0, 1.0, 1.0], [1.0, 0.0, 0.0]])
    assert not compiled(3, 1)(singular, np.zeros(3))[1]
    assert not compiled(3, 1)(np.zeros((2, 3)), np.zeros(3))[1]


@pytest.mark.parametrize(("n", "b"), [(9, 2), (73, 3)])
def test_product_is_the_dense_matrix_times_the_vector(n, b):
    bands, x = random_bands(n, b, 0, 2.0), np.random.default_rng(1).normal(size=n)
    with jax.enable_x64(True):
        result = banded.product(jnp.asarray(bands), jnp.asarray(x))
    np.testing.assert_allclose(result, dense(bands) @ x, rtol=1e-12)


def bent(x):
    """Smooth, not quadratic, of half-bandwidth 3, with a coupling of neighbours alone too."""
    return jnp.sum(jnp.exp(jnp.sin(jnp.diff(x, 3)))) + jnp.sum(x[1:] ** 2 * x[:-1] ** 3)


@pytest.mark.parametrize("half_bandwidth", [3, 4])
def test_local_model_is_that_of_automatic_differentiation(half_bandwidth):
    x = np.random.default_rng(3).normal(size=23)
    with jax.enable_x64(True):
        value, gradient, bands = jax.jit(lambda x: banded.local_model(bent, x, half_bandwidth))(x)
        expected = jax.jit(lambda x: (bent(x), jax.grad(bent)(x), jax.hessian(bent)(x)))(x)
    found = value, gradient, dense(np.array(bands))
    for ours, true in zip(found, expected, strict=True):
        np.testing.assert_allclose(ours, true, rtol=1e-12, atol=1e-13)


def test_masked_rows_and_columns_are_those_of_the_identity():
    bands, keep = random_bands(11, 3, 5, 2.0), np.arange(11) % 3 > 0
    with jax.enable_x64(True):
        result = np.array(banded.masked(jnp.asarray(bands), jnp.asarray(keep)))
    expected = np.where(keep[:, None] & keep, dense(bands), np.eye(11))
    np.testing.assert_array_equal(dense(result), expected)


def test_width_of_a_hessian_is_found():
    x = np.random.default_rng(3).normal(size=23)

    @jax.jit
    def found(x):
        bands = [banded.local_model(bent, x, b).bands for b in (2, 3, 4)]
        return banded.widest(bent, x), [banded.reaches_beyond(bent, x, b) for b in bands]

    with jax.enable_x64(True):
        width, beyond = found(x)
        assert width == 3
        assert np.array_equal(beyond, [True, False, False])
