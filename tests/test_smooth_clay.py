import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BPoly

import jaxclay
from jaxclay.bernstein import evaluate
from jaxclay.smooth_clay import SmoothClay


def random_clay(seed, pieces=6, empty=0, ratio=5.0):
    """Pieces with positive Bernstein coefficients of Y_u, continuous in Y alone."""
    rng = np.random.default_rng(seed)
    width = rng.uniform(0.3, 1, pieces)
    breaks = np.concatenate([[0.0], np.cumsum(width) / width.sum()])
    breaks[-1] = 1.0
    steps = np.diff(breaks)[:, None] * ratio ** rng.uniform(-1, 1, (pieces, 5)) / 5
    start = np.concatenate([[0.0], np.cumsum(steps.sum(axis=1))[:-1]])[:, None]
    control = np.concatenate([start, start + np.cumsum(steps, axis=1)], axis=1)
    control[1:, 0] = control[:-1, 5]
    for _ in range(empty):
        i = rng.integers(0, len(control) + 1)
        height = np.append(control[:, 0], control[-1, 5])[i]
        breaks = np.insert(breaks, i, breaks[i])
        control = np.insert(control, i, height, axis=0)
    return SmoothClay(breaks, control, r0=rng.uniform(0.2, 2), unit=rng.uniform(0.5, 3))


def bpoly(clay):
    filled = np.diff(clay.breaks) > 0
    breaks = np.append(clay.breaks[:-1][filled], 1.0)
    return BPoly(clay.control[filled].T, breaks)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), pieces=st.integers(1, 9), empty=st.integers(0, 3))
def test_values_and_derivatives_are_those_of_scipy(seed, pieces, empty):
    clay = random_clay(seed, pieces, empty)
    u = np.concatenate([np.linspace(0, 1, 57), clay.breaks])  # breaks: from above, as SciPy's
    oracle = bpoly(clay)
    for order, values in enumerate(clay.derivatives(u)):
        expected = oracle.derivative(order)(u) if order else oracle(u)
        scale = np.abs(expected).max() * 10.0**order
        np.testing.assert_allclose(values, expected, rtol=1e-11, atol=1e-13 * scale)
    assert clay.pieces == pieces
    assert clay.height == clay.heights[-1]


def test_derivatives_of_a_power_by_hand():
    # Y = u^5 + u on one piece: Bernstein coefficients k / 5, and 2 at the end.
    clay = SmoothClay([0, 1], [[0, 0.2, 0.4, 0.6, 0.8, 2.0]], 0.5, 1.0)
    u = np.array([0.0, 0.3, 1.0])
    expected = u**5 + u, 5 * u**4 + 1, 20 * u**3, 60 * u**2
    for values, by_hand in zip(clay.derivatives(u), expected, strict=True):
        np.testing.assert_allclose(values, by_hand, rtol=1e-13, atol=1e-14)
    assert clay.radius_at(2.0) == pytest.approx(0.5 / 6**0.5, rel=1e-13)


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10**6), empty=st.integers(0, 2), ratio=st.sampled_from([1.5, 5.0, 300.0])
)
def test_the_inverse_inverts_to_rounding(seed, empty, ratio):
    clay = random_clay(seed, 5, empty, ratio)
    u = np.random.default_rng(seed).uniform(0, 1, (4, 25))
    heights = bpoly(clay)(u)
    np.testing.assert_allclose(clay.height_at(u), heights, rtol=1e-13)

    def rounding(u):
        return 1e-14 * (1 + clay.height / clay.derivatives(u)[1])

    assert (np.abs(clay.material_at(heights) - u) <= rounding(u)).all()
    expected = clay.r0 / np.sqrt(bpoly(clay).derivative()(u))
    np.testing.assert_allclose(clay.radius_at(heights), expected, rtol=1e-7)
    ends = np.array([0.0, 1.0])
    assert (np.abs(clay.material_at([0.0, clay.height]) - ends) <= rounding(ends)).all()


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_solid_of_revolution_has_the_volume(seed):
    clay = random_clay(seed, pieces=4)
    points, weights = np.polynomial.legendre.leggauss(60)
    total = 0.0
    for low, high in zip(clay.heights[:-1], clay.heights[1:], strict=True):
        y = (low + high) / 2 + (high - low) / 2 * points
        total += np.sum(weights * np.pi * clay.radius_at(y) ** 2) * (high - low) / 2
    assert total == pytest.approx(clay.volume, rel=1e-5)
    assert clay.volume == pytest.approx(np.pi * clay.r0**2, rel=1e-15)


def test_evaluation_and_inverse_can_be_compiled_and_differentiated():
    clay = random_clay(3, empty=2)
    u = np.linspace(0, 1, 23)
    with jax.enable_x64(True):
        compiled = jax.jit(evaluate)(clay.breaks, clay.control, u)
        u_of = jax.jit(jax.value_and_grad(lambda c, y: c.material_at(y), argnums=1))
        where, rate = u_of(clay, clay.height_at(0.4))
    for ours, host in zip(compiled, clay.derivatives(u), strict=True):
        np.testing.assert_allclose(ours, host, rtol=1e-12, atol=1e-10)
    assert where == pytest.approx(0.4, abs=1e-14)
    assert rate == pytest.approx(1 / clay.derivatives(0.4)[1], rel=1e-12)


def test_it_is_a_pytree():
    clay = random_clay(0)
    leaves, tree = jax.tree.flatten(clay)
    again = jax.tree.unflatten(tree, leaves)
    assert isinstance(again, SmoothClay)
    np.testing.assert_array_equal(again.control, clay.control)


STRAIGHT = np.arange(6) / 5
DIPPING = [0, 0.5, 0.4, 0.6, 0.8, 1.0]  # the slope's second coefficient is -0.5, its least is not


def test_a_slope_is_judged_by_its_values_not_by_its_coefficients():
    u = np.linspace(0, 1, 1001)
    slope = BPoly(np.array([DIPPING]).T, [0, 1]).derivative()(u)
    assert slope.min() > 0
    assert SmoothClay([0, 1], [DIPPING], 0.5, 1.0).height == 1.0


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"breaks": [0, 0.5, 0.4, 1]}, r"breaks\[2\] = 0.4 follows breaks\[1\] = 0.5"),
        ({"breaks": [0, 1.5]}, "run from 0 to 1, got 0 to 1.5"),
        ({"breaks": [0.1, 1]}, "run from 0 to 1, got 0.1 to 1"),
        ({"breaks": [0, np.nan, 1]}, "breaks must be finite"),
        ({"breaks": [0, 0.5, 1], "control": [STRAIGHT]}, r"shapes \(1, 6\) and \(3,\)"),
        ({"control": [STRAIGHT + 1]}, "Y must start at 0, got 1"),
        ({"control": [STRAIGHT * np.nan]}, r"control\[0\] is .*must be finite"),
        ({"control": [[0, 0.9, -0.3, 0.3, 0.8, 1.0]]}, "Y must increase.*Y_u falls to -.* near u"),
        ({"control": [[0, 0, 0.4, 0.6, 0.8, 1.0]]}, "Y must increase.*falls to 0 near u = 0$"),
        (
            {"breaks": [0, 0.5, 1], "control": [STRAIGHT, STRAIGHT + 1.1]},
            r"jumps by 0.1 at breaks\[1\] = 0.5",
        ),
        (
            {"breaks": [0, 0.5, 0.5, 1], "control": [STRAIGHT, STRAIGHT + 1, STRAIGHT + 2]},
            r"jumps by 1 at breaks\[1\] = 0.5",
        ),
        ({"r0": 0.0}, "r0 must be positive and finite, got 0"),
        ({"unit": -1.0}, "unit must be positive and finite, got -1"),
    ],
)
def test_bad_pieces_are_named(fields, message):
    good = {"breaks": [0, 1], "control": [STRAIGHT], "r0": 0.5, "unit": 1.0}
    if "breaks" in fields and "control" not in fields:
        good["control"] = [STRAIGHT] * (len(fields["breaks"]) - 1)
    with pytest.raises(ValueError, match=message):
        SmoothClay(**(good | fields))


def test_places_outside_the_clay_are_named():
    clay = SmoothClay([0, 1], [2 * STRAIGHT], 0.5, 1.0)
    for function in (clay.material_at, clay.radius_at):
        with pytest.raises(ValueError, match=r"height must lie between 0 and 2, got 2\.1"):
            function([1.0, 2.1])
    for function in (clay.height_at, clay.derivatives):
        with pytest.raises(ValueError, match=r"u must lie between 0 and 1, got -0\.1"):
            function(-0.1)
    with pytest.raises(ValueError, match="got nan"):
        clay.radius_at(np.nan)
    assert clay.radius_at(2.0 + 1e-14) == pytest.approx(0.5 / 2**0.5, rel=1e-15)


def test_host_results_are_numpy_float64_whatever_the_flag():
    for flag in (False, True):
        with jax.enable_x64(flag):
            clay = random_clay(1)
            for value in (clay.height_at(0.3), clay.radius_at(clay.height), clay.volume):
                assert isinstance(value, np.ndarray | np.float64)
                assert np.asarray(value).dtype == np.float64
    assert isinstance(clay, jaxclay.SmoothClay)
