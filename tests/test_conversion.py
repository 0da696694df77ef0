import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import piece
from scipy.interpolate import BPoly, CubicHermiteSpline

import jaxclay
from jaxclay import Clay, SmoothClay, contour_error
from jaxclay.bernstein import evaluate
from jaxclay.conversion import interpolated


def smooth_heights(u, order=0):
    """A Y with smooth derivatives, from 0 to 1.25."""
    waves = ((0.1, 2 * np.pi, 0.0), (0.03, 5.0, 1.0))
    total = (1.25 * u if order == 0 else 1.25 * (order == 1)) + 0 * u
    for size, speed, phase in waves:
        rate = size * speed**order
        total = total + rate * np.sin(speed * u + phase + order * np.pi / 2)
        if order == 0:
            total = total - size * np.sin(phase)
    return total


def test_the_interpolation_is_of_order_four_in_the_radius_and_five_in_the_height():
    u, errors = np.linspace(0, 1, 3001), []
    for n in (32, 64, 128):
        heights = smooth_heights(np.arange(n + 1) / n)
        Y, Y_u = evaluate(*interpolated(np.diff(heights), heights), u, 2)
        errors.append(
            [np.abs(Y - smooth_heights(u)).max(), np.abs(Y_u - smooth_heights(u, 1)).max()]
        )
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > [4.7, 3.7]).all()
    assert errors[-1][0] < 2e-9


thicknesses = st.lists(st.floats(-3, 0), min_size=3, max_size=12).map(lambda x: 10.0 ** np.array(x))


@settings(max_examples=60, deadline=None)
@given(thickness=thicknesses)
def test_it_goes_through_every_height_twice_continuously_and_always_rises(thickness):
    heights = np.concatenate([[0.0], np.cumsum(thickness)])
    breaks, control = interpolated(thickness, heights)
    assert (np.diff(control, axis=1) > 0).all()
    np.testing.assert_array_equal(control[:, 0], heights[:-1])
    np.testing.assert_array_equal(control[:, 5], heights[1:])
    oracle = BPoly(control.T, breaks)
    inner, size = breaks[1:-1], np.abs(control).max()
    for order in (1, 2):
        derivative = oracle.derivative(order)
        jump = derivative(inner) - derivative(np.nextafter(inner, 0))
        np.testing.assert_allclose(jump, 0, atol=1e-11 * size * len(thickness) ** order)


def test_it_can_be_compiled():
    thickness = np.random.default_rng(0).uniform(0.5, 2, 9)
    heights = np.concatenate([[0.0], np.cumsum(thickness)])
    with jax.enable_x64(True):
        for ours, host in zip(
            jax.jit(interpolated)(thickness, heights),
            interpolated(thickness, heights),
            strict=True,
        ):
            np.testing.assert_allclose(ours, host, rtol=1e-13)
        rate = jax.grad(lambda t: interpolated(t, heights)[1].sum())(np.ones(9))
    assert np.isfinite(rate).all()  # equal slices: every ratio of differences is 0 / 0


@pytest.mark.parametrize(
    ("slopes", "overshoot"),
    [
        ([1.0] * 6 + [1.56] * 6, 0.2),  # a jump of the radius, as a tool leaves it
        ([1.56] * 5 + [1.0] * 4 + [1.56] * 3, 0.2),
        ([1.0] * 6 + [10.0] * 6, 0.35),
        ([1.0] * 5 + [1.05, 1.15, 1.25, 1.35, 1.45], 0.1),  # a kink
    ],
)
def test_corners_are_hardly_overshot(slopes, overshoot):
    smooth = piece(slopes).as_function().clay
    n = len(slopes)
    u = np.linspace(1 / n, 1 - 1 / n, 4001)[:-1]  # ends may go on rising
    X = smooth.r0 / np.sqrt(smooth.derivatives(u)[1])
    radii = piece(slopes).radii
    beside = np.stack([np.roll(radii, j) for j in (-1, 0, 1)])[:, (u * n).astype(int)]
    room = overshoot * np.ptp(radii)
    assert (beside.max(axis=0) + room >= X).all()
    assert (beside.min(axis=0) - room <= X).all()
    # Slices with equal neighbours on both sides feel nothing of it.
    rest = np.all([np.roll(radii, j) == radii for j in (-2, -1, 0, 1, 2)], axis=0)
    rest[:2] = rest[-2:] = False
    still = rest[(u * n).astype(int)]
    np.testing.assert_allclose(X[still], radii[(u[still] * n).astype(int)], rtol=1e-12)


@pytest.mark.parametrize("slices", [3, 4, 64, 2048])
def test_slices_of_one_thickness_are_one_straight_piece(slices):
    converted = Clay.cylinder(0.3, 2.0, slices=slices).as_function()
    smooth = converted.clay
    assert isinstance(smooth, SmoothClay)
    assert len(smooth.breaks) == 2
    assert (smooth.height, smooth.unit) == (2.0, 2.0)
    np.testing.assert_allclose(smooth.control[0], 2.0 * np.arange(6) / 5, rtol=1e-14)
    np.testing.assert_allclose(smooth.radius_at([0, 0.7, 2.0]), 0.3, rtol=1e-14)
    assert converted.error < 1e-14


def test_a_measured_contour_becomes_a_function_and_slices_again():
    clay = jaxclay.load_profile("teapot")
    smooth, error = clay.as_function(1e-5)
    assert isinstance(smooth, SmoothClay)
    assert smooth.pieces < 20
    assert 1e-4 < error < 2e-2  # the polyline through 64 slices is no nearer
    assert error == contour_error(smooth, clay)
    again, error = smooth.sliced(64)
    np.testing.assert_allclose(again.heights, clay.heights, atol=3e-5)
    np.testing.assert_allclose(again.heights, smooth.height_at(np.arange(65) / 64), rtol=1e-15)
    assert error == contour_error(again, smooth)
    assert smooth.sliced(1024).error < error / 8


def test_bad_requests_are_named():
    clay = Clay.cylinder(slices=8)
    with pytest.raises(ValueError, match="tolerance must be positive and finite, got 0"):
        clay.as_function(0.0)
    with pytest.raises(ValueError, match="slices must be a whole number of at least 3, got 2"):
        clay.as_function().clay.sliced(2)


def cubic_of(clay, i):
    """Y on slice i of five: Hermite's cubic, slopes those of the quartics through five nodes."""
    u, mean = np.arange(6) / 5, 5 * clay.thickness[i]
    slopes = []
    for node in (i, i + 1):
        five = slice(0, 5) if node <= 2 else slice(1, 6)
        quartic = np.polynomial.Polynomial.fit(u[five], clay.heights[five], 4)
        slopes.append(np.clip(quartic.deriv()(u[node]), 0.05 * mean, 2.5 * mean))
    ends = slice(i, i + 2)
    return CubicHermiteSpline(u[ends], clay.heights[ends], slopes)


def test_clay_in_slices_is_cubic_between_its_nodes():
    clay = piece([1, 2, 0.5, 1.5, 1])
    u = np.arange(6) / 5
    np.testing.assert_allclose(clay.height_at(u), clay.heights, rtol=1e-15)
    np.testing.assert_allclose(clay.material_at(clay.heights), u, atol=1e-15)
    for i in range(5):
        cubic, inside = cubic_of(clay, i), u[i] + np.linspace(0.01, 0.99, 9) / 5
        heights = clay.height_at(inside)
        np.testing.assert_allclose(heights, cubic(inside), rtol=1e-13)
        np.testing.assert_allclose(clay.material_at(heights), inside, rtol=1e-13)
        radii = float(clay.r0) / np.sqrt(cubic(inside, 1))
        np.testing.assert_allclose(clay.radius_at(heights), radii, rtol=1e-11)
    assert clay.radius_at(0.0) == pytest.approx(clay.r0 / cubic_of(clay, 0)(0.0, 1) ** 0.5)
    with pytest.raises(ValueError, match=r"height must lie between 0 and 1, got 1\.5"):
        clay.radius_at(1.5)
    with pytest.raises(ValueError, match=r"u must lie between 0 and 1, got 2"):
        clay.height_at([0.5, 2.0])
