import numpy as np
import pytest
from scenes import piece

from jaxclay import Clay, area_error, contour_error, save_profile, save_svg
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


def stack(radii, thickness, jumps=()):
    """Slices of these radii; between slices i - 1 and i, for i in ``jumps``, the radius jumps."""
    radii, thickness = np.asarray(radii, float), np.asarray(thickness, float)
    below = np.append(0.0, np.cumsum(radii**2 * thickness))
    nodes = below / below[-1]
    edges = [[nodes[i], radii[j]] for i in jumps for j in (i - 1, i)]
    heights = np.append(0.0, np.cumsum(thickness))
    return Clay(heights, thickness, np.sqrt(below[-1]), heights[-1], nodes, edges or None)


def test_the_area_between_two_steps_is_that_of_the_ring_between_them():
    low, high = (
        stack([0.4] * 3 + [0.5] * 3, [y / 3] * 3 + [(1 - y) / 3] * 3, jumps=[3])
        for y in (0.3, 0.32)
    )
    ring = 0.02 * (0.5 - 0.4)
    assert area_error(low, high) == pytest.approx(ring / (0.32 * 0.4 + 0.68 * 0.5), rel=1e-12)
    assert area_error(high, low) == pytest.approx(ring / (0.3 * 0.4 + 0.7 * 0.5), rel=1e-12)


def test_the_area_between_crossing_cones_is_that_of_two_triangles():
    """Radii run on straight to both ends: from 0.4 to 0.6 and from 0.6 to 0.4."""
    radii = 0.4 + 0.2 * (np.arange(4) + 0.5) / 4
    widening, narrowing = (stack(r, [0.25] * 4) for r in (radii, radii[::-1]))
    assert area_error(widening, narrowing) == pytest.approx(2 * 0.5 * 0.2 * 0.5 / 0.5, rel=1e-12)


@pytest.mark.parametrize("seed", range(12))
def test_the_area_between_contours_with_jumps_is_that_of_a_slow_quadrature(seed):
    rng = np.random.default_rng(seed)
    clays = []
    for slices in rng.integers(4, 20, 2):
        jumps = np.sort(rng.choice(np.arange(1, slices), min(3, slices - 1), replace=False))
        clays.append(stack(rng.uniform(0.2, 0.6, slices), rng.uniform(0.02, 0.2, slices), jumps))
    steps = 400_000
    y = (np.arange(steps) + 0.5) / steps * max(clay.height for clay in clays)
    radius = []
    for clay in clays:
        X, Y = polyline(clay)[1:-1].T
        radius.append(np.interp(y, Y, X, right=0.0))  # no y is that of a jump
    oracle = np.abs(radius[0] - radius[1]).sum() / radius[1].sum()
    assert area_error(*clays) == pytest.approx(oracle, rel=1e-4)


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


@pytest.mark.parametrize("save", [save_svg, save_profile])
def test_a_shape_that_does_not_rise_is_not_saved(tmp_path, save):
    whole = Clay.cylinder(slices=8)
    thickness = whole.thickness.copy()
    thickness[5] = -0.1
    heights = np.append(0.0, np.cumsum(thickness))
    broken = unchecked_clay(heights, thickness, whole.r0, whole.unit)
    lost = unchecked_clay(heights * np.nan, thickness * np.nan, whole.r0, whole.unit)
    path = tmp_path / "out"
    with pytest.raises(ValueError, match=r"slice 5 does not rise: .*0.625 and 0.525, .* -0.1"):
        save(broken, path)
    with pytest.raises(ValueError, match=r"slice 0 does not rise: .*nan"):
        save(lost, path)
    assert not list(tmp_path.iterdir())
