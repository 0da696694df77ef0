import jax
import numpy as np
import oracles
import pytest
from scenes import piece

from jaxclay import Clay, SmoothClay, area_error, contour_error
from jaxclay.clay import unchecked_clay
from jaxclay.contour import polyline


def wavy_clay(size, r0=0.5, slices=64):
    u = (np.arange(slices) + 0.5) / slices
    return piece(1 + size * np.sin(2 * np.pi * u) + 0.1 * np.cos(9 * u), r0).as_function().clay


def test_the_polyline_of_a_function_lies_on_its_contour():
    clay = wavy_clay(0.5)
    line = polyline(clay)
    assert len(line) <= 20_000
    np.testing.assert_array_equal(line[[0, -1]], [[0, 0], [0, clay.height]])
    X, y = line[1:-1].T
    assert (np.diff(y) > 0).all()
    np.testing.assert_allclose(X, clay.radius_at(y), rtol=1e-9)
    # Half way along a chord the contour is less than 1e-8 away, measured across it.
    half = (line[2:-1] + line[1:-2]) / 2
    along = np.diff(line[1:-1], axis=0)
    across = np.abs(clay.radius_at(half[:, 1]) - half[:, 0]) * along[:, 1] / np.hypot(*along.T)
    assert across.max() < 1.1e-8
    assert len(polyline(clay, chord=1e-4)) < len(line) / 50


def test_a_jump_of_the_radius_has_both_radii():
    y = np.arange(6) / 5
    clay = SmoothClay([0, 0.5, 1], [0.5 * y, 0.5 + 2 * y], 0.5, 1.0)
    line = polyline(clay)
    X = 0.5 / 2  # r0 / sqrt(4)
    np.testing.assert_allclose(
        line, [[0, 0], [0.5, 0], [0.5, 0.5], [X, 0.5], [X, 2.5], [0, 2.5]], atol=1e-15
    )


def test_the_polyline_of_slices_goes_through_their_middles_and_on_to_both_ends():
    clay = piece([1, 2, 0.5, 1.5])
    y, X = clay.heights, clay.radii
    middle = (y[1:] + y[:-1]) / 2
    beyond = X[0] - (X[1] - X[0]) / (middle[1] - middle[0]) * middle[0]
    above = X[3] + (X[3] - X[2]) / (middle[3] - middle[2]) * (y[4] - middle[3])
    points = [[0, 0], [beyond, 0], *zip(X, middle, strict=True), [above, y[4]], [0, y[4]]]
    np.testing.assert_allclose(polyline(clay), points, atol=1e-15)


def test_an_end_stays_off_the_axis_where_the_radius_falls_steeply():
    clay = piece([1, 1, 100, 10_000])
    middle = (clay.heights[1:] + clay.heights[:-1]) / 2
    fall = (clay.radii[3] - clay.radii[2]) / (middle[3] - middle[2])
    assert clay.radii[3] + fall * (clay.height - middle[3]) < 0  # where the line would lead
    assert polyline(clay)[-2] == pytest.approx([clay.radii[3] / 4, clay.height], rel=1e-14)


@pytest.mark.parametrize(("size", "r0"), [(0.5001, 0.5), (0.45, 0.5), (0.3, 0.4)])
def test_distances_between_functions_against_dense_points(size, r0):
    a, b = wavy_clay(0.5), wavy_clay(size, r0)
    distance = contour_error(a, b)
    dense = oracles.hausdorff(polyline(a, 1e-5), polyline(b, 1e-5), points=3000)
    assert distance == pytest.approx(dense, rel=1e-2, abs=2e-5)
    assert distance == pytest.approx(contour_error(b, a), rel=1e-12)


def test_errors_of_any_mix_of_cylinders_by_hand():
    straight = Clay.cylinder(0.5, 1.0), Clay.cylinder(0.5, 1.0).as_function().clay
    wider = Clay.cylinder(0.6, 1.0), Clay.cylinder(0.6, 1.0).as_function().clay
    for a in straight:
        for b in wider:
            assert contour_error(a, b) == pytest.approx(0.1, rel=1e-12)
            assert area_error(a, b) == pytest.approx(0.1 / 0.6, rel=1e-12)


def folded(clay):
    """The clay with its second half below its first, as a solve that failed may leave it."""
    if isinstance(clay, Clay):
        down = 1 - 2 * (np.arange(clay.slices + 1) > 30)
        return unchecked_clay(clay.heights * down, clay.thickness * down[:-1], clay.r0, clay.unit)
    turned = np.where(np.arange(6) < 3, np.arange(6.0), 4 - np.arange(6.0)) / 5
    leaves, structure = jax.tree.flatten(clay)
    leaves = [turned[None] if np.shape(leaf)[-1:] == (6,) else leaf for leaf in leaves]
    return jax.tree.unflatten(structure, leaves)


@pytest.mark.parametrize("whole", [Clay.cylinder(), Clay.cylinder().as_function().clay])
def test_a_shape_that_does_not_rise_has_no_distance(whole):
    fallen = folded(whole)
    for pair in ((fallen, whole), (whole, fallen)):
        assert np.isnan(contour_error(*pair))
        assert np.isnan(area_error(*pair))
