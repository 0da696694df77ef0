import numpy as np
import pytest
from scenes import piece

from jaxclay import Clay, area_error, contour_error
from jaxclay.clay.clay import unchecked_clay
from jaxclay.clay.contour import polyline


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


def folded(clay):
    """The clay with its second half below its first, as a solve that failed may leave it."""
    down = 1 - 2 * (np.arange(clay.slices + 1) > 30)
    return unchecked_clay(clay.heights * down, clay.thickness * down[:-1], clay.r0, clay.unit)


def test_a_shape_that_does_not_rise_has_no_distance():
    whole = Clay.cylinder()
    fallen = folded(whole)
    for pair in ((fallen, whole), (whole, fallen)):
        assert np.isnan(contour_error(*pair))
        assert np.isnan(area_error(*pair))
