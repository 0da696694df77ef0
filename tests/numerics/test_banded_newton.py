"""Newton's method for banded Hessians: problems from the literature, and how it ends."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.linalg import solveh_banded
from scipy.optimize import brentq

from jaxclay.numerics.banded_newton import minimize_banded


def chained_rosenbrock(x):
    """Toint 1978; 0 at ones."""
    return jnp.sum(100 * (x[1:] - x[:-1] ** 2) ** 2 + (1 - x[:-1]) ** 2)


def engval1(x):
    """Toint 1983, problem 31."""
    a, b = x[:-1], x[1:]
    return jnp.sum((a**2 + b**2) ** 2 - 4 * a + 3)


def edensch(x):
    """Extended Dennis and Schnabel, Li 1990."""
    a, b = x[:-1], x[1:]
    return 16 + jnp.sum((a - 2) ** 4 + (a * b - 2 * b) ** 2 + (b + 1) ** 2)


def freuroth(x):
    """Extended Freudenstein and Roth, More, Garbow and Hillstrom 1981, problem 2."""
    a, b = x[:-1], x[1:]
    one = a - 2 * b - 13 + 5 * b**2 - b**3
    other = a - 14 * b - 29 + b**2 + b**3
    return jnp.sum(one**2 + other**2)


def cragglvy(x):
    """Extended Cragg and Levy, Toint 1983, problem 32."""
    a, b, c, d = x[:-3:2], x[1:-2:2], x[2:-1:2], x[3::2]
    tangent = jnp.tan(c - d) + c - d
    return jnp.sum((jnp.exp(a) - b) ** 4 + 100 * (b - c) ** 6 + tangent**4 + a**8 + (d - 1) ** 2)


def schmvett(x):
    """Schmidt and Vetters 1970; -3 (n - 2)."""
    a, b, c = x[:-2], x[1:-1], x[2:]
    terms = 1 / (1 + (a - b) ** 2) + jnp.sin((jnp.pi * b + c) / 2)
    return -jnp.sum(terms + jnp.exp(-(((a + c) / b - 2) ** 2)))


def powell(x):
    """Extended Powell, singular at its minimum: More, Garbow and Hillstrom 1981, problem 22."""
    a, b, c, d = x.reshape(-1, 4).T
    pairs = (a + 10 * b) ** 2 + 5 * (c - d) ** 2
    return jnp.sum(pairs + (b - 2 * c) ** 4 + 10 * (a - d) ** 4)


def broyden(x):
    """Broyden 1965, tridiagonal, in least squares: problem 30 of the same."""
    y = jnp.pad(x, 1)
    return jnp.sum(((3 - 2 * x) * x - y[:-2] - 2 * y[2:] + 1) ** 2)


# Start, half-bandwidth, the published value and how far its digits go.
PUBLISHED = {
    chained_rosenbrock: (np.zeros(50), 1, 0.0, 1e-20),
    engval1: (np.full(10, 2.0), 1, 9.177469957181389, 1e-11),
    edensch: (np.full(5, 8.0), 1, 33.296001998982, 1e-11),
    freuroth: (np.r_[0.5, -2.0, np.zeros(48)], 1, 5881.0, 0.05),
    cragglvy: (np.r_[1.0, np.full(49, 2.0)], 1, 15.372, 6e-4),
    schmvett: (np.full(100, 0.5), 2, -294.0, 1e-10),
    powell: (np.tile([3.0, -1.0, 0.0, 1.0], 10), 3, 0.0, 1e-20),
    broyden: (-np.ones(50), 2, 0.0, 1e-20),
}


@pytest.mark.parametrize("fun", PUBLISHED, ids=lambda fun: fun.__name__)
def test_reaches_the_published_value(fun):
    start, half_bandwidth, value, digits = PUBLISHED[fun]
    result = minimize_banded(fun, start, half_bandwidth)
    assert result.converged, result.message
    assert abs(result.value - value) <= digits
    assert np.abs(result.gradient).max() < 1e-9


def beam(w, force, stiffness):
    """A beam clamped at 0 that stiffens as it bends, pulled at its end."""
    bend = jnp.diff(jnp.concatenate([jnp.zeros(2), w]), 2)
    return stiffness * jnp.sum(jnp.cosh(bend) - 1) - force * w[-1]


def test_a_stiffening_beam_takes_its_closed_form():
    """w_n = sum (n - i) bend_i, so each bend is on its own: sinh(bend_i) = (n - i) F / c."""
    n, force, stiffness = 200, 0.02, 3.0
    result = minimize_banded(beam, np.zeros(n), 2, args=(force, stiffness))
    bend = np.arcsinh(np.arange(n, 0, -1) * force / stiffness)
    assert result.converged, result.message
    np.testing.assert_allclose(result.x, np.cumsum(np.cumsum(bend)), rtol=1e-9)


def bratu(u, strength):
    """Whose minimum solves -u'' = strength e^u, u(0) = u(1) = 0, by finite differences."""
    h = 1 / (u.shape[0] + 1)
    return jnp.sum(jnp.diff(jnp.pad(u, 1)) ** 2) / (2 * h) - h * strength * jnp.sum(jnp.exp(u))


def test_bratu_approaches_its_closed_form_as_h_squared():
    theta = brentq(lambda t: t - np.sqrt(2 * 3.0) * np.cosh(t / 4), 0, 4)  # the lower branch
    errors = []
    for n in (20, 40):
        result = minimize_banded(bratu, np.zeros(n - 1), 1, args=(3.0,))
        x = np.arange(1, n) / n
        expected = -2 * np.log(np.cosh((x - 0.5) * theta / 2) / np.cosh(theta / 4))
        assert result.converged, result.message
        errors.append(np.abs(result.x - expected).max())
    assert errors[1] < 2e-3
    assert 3.8 < errors[0] / errors[1] < 4.2


def test_beyond_the_critical_strength_bratu_has_no_minimum():
    """3.5138...: there is none beyond it, and nothing may claim one."""
    assert minimize_banded(bratu, np.zeros(39), 1, args=(3.5,)).converged
    assert not minimize_banded(bratu, np.zeros(39), 1, args=(3.6,)).converged


traces = []


def quadratic(x, bands, rhs):
    """1/2 x^T H x - rhs^T x, H of half-bandwidth 2."""
    traces.append(len(x))
    H = jnp.diag(bands[0])
    for k in (1, 2):
        H += jnp.diag(bands[k, :-k], k) + jnp.diag(bands[k, :-k], -k)
    return x @ (H @ x) / 2 - rhs @ x


def quadratics(count):
    rng = np.random.default_rng(0)
    for _ in range(count):
        bands = rng.normal(size=(3, 30))
        bands[0] = 8 + rng.random(30)
        bands[1, -1:] = bands[2, -2:] = 0
        yield bands, rng.normal(size=30)


def test_quadratics_are_solved_at_once_and_changed_values_do_not_compile_anew():
    seen = []
    for bands, rhs in quadratics(4):
        result = minimize_banded(quadratic, np.zeros(30), 2, args=(bands, rhs))
        expected = solveh_banded(bands, rhs, lower=True)
        assert result.converged
        assert result.iterations == 2  # there, and to see that nothing is left
        np.testing.assert_allclose(result.x, expected, rtol=1e-12, atol=1e-14)
        seen.append(len(traces))
    minimize_banded(quadratic, np.ones(30), 2, (bands, rhs), tolerance=1e-8, max_iterations=7)
    assert set(seen) == {len(traces)}


def test_runs_under_vmap_and_inside_jit():
    many = [np.stack(part) for part in zip(*quadratics(3), strict=True)]

    @jax.jit
    def solve(bands, rhs):
        return jax.vmap(lambda *args: minimize_banded(quadratic, np.zeros(30), 2, args))(bands, rhs)

    with jax.enable_x64(True):
        result = solve(*many)
    assert result.converged.all()
    for x, bands, rhs in zip(result.x, *many, strict=True):
        np.testing.assert_allclose(x, solveh_banded(bands, rhs, lower=True), rtol=1e-12)
    with pytest.raises(TypeError, match="float32"):
        jax.jit(lambda rhs: minimize_banded(quadratic, np.zeros(30), 2, (bands, rhs)))(rhs)


def barrier(x, sign):
    """With sign 1 least at ones, 1 each; not a number below 0."""
    return jnp.sum(sign * x - jnp.log(x))


def test_never_steps_where_the_function_is_not_a_number():
    """From 5 a full Newton step leads to -15."""
    result = minimize_banded(barrier, np.full(4, 5.0), 1, args=(1.0,))
    assert result.converged
    np.testing.assert_allclose(result.x, 1, rtol=1e-9)


def test_no_minimum_is_never_called_one():
    result = minimize_banded(barrier, np.full(4, 5.0), 1, args=(-1.0,))  # falls for ever
    assert not result.converged
    assert np.isfinite(result.x).all()


def test_says_when_the_function_is_not_a_number():
    result = minimize_banded(barrier, np.array([1.0, -1.0, 1.0, 1.0]), 1, args=(1.0,))
    assert not result.converged
    assert result.message.startswith("non-finite")
    assert result.iterations == 1


def test_says_when_the_limit_comes_first():
    result = minimize_banded(chained_rosenbrock, np.zeros(50), 1, max_iterations=5)
    assert not result.converged
    assert result.message.startswith("iteration limit")
    assert result.iterations == 5
    assert result.value < 49.0  # its value at 0


def saddle(x):
    return jnp.sum(x[1:] * x[:-1]) + jnp.sum(x[1:] ** 4)


def test_a_saddle_is_no_minimum():
    result = minimize_banded(saddle, np.zeros(6), 1)
    assert not result.converged
    assert result.value < -1e6  # it has none: f falls along the first coordinate
    away = minimize_banded(saddle, 1e-3 * np.arange(1.0, 7.0), 1, max_iterations=1000)
    assert away.value < -0.1


def wide(x):
    return jnp.sum(jnp.cosh(jnp.diff(x, 2))) + jnp.sum((x - 1) ** 2)


def test_a_hessian_wider_than_stated_is_noticed():
    start = np.linspace(0, 3, 20) ** 2
    with pytest.raises(ValueError, match="must be 2 for this Hessian, got 1"):
        minimize_banded(wide, start, 1)
    with jax.enable_x64(True):
        assert not jax.jit(lambda x: minimize_banded(wide, x, 1).converged)(start)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"start": np.zeros((3, 3))}, "vector"),
        ({"start": [1.0]}, "at least 2"),
        ({"start": [1.0, np.nan, 2.0]}, r"start\[1\]"),
        ({"half_bandwidth": 0}, "half_bandwidth"),
        ({"half_bandwidth": 4}, "n - 1 = 3"),
        ({"half_bandwidth": 1.5}, "whole number"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"max_iterations": 0}, "max_iterations"),
    ],
)
def test_bad_input_is_named(change, match):
    arguments = {"start": [1.0, 2.0, 3.0, 4.0], "half_bandwidth": 1} | change
    with pytest.raises(ValueError, match=match):
        minimize_banded(chained_rosenbrock, **arguments)
