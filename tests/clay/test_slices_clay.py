"""Clay on material nodes: its function Y(u), its contour, and its volume through many squashes."""

import numpy as np
import pytest
import slices_oracle as oracle
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import MIDDLE, SNAKE

from jaxclay import Clay, Material, Squash, contour_error, deform
from jaxclay.clay.contour import polyline

EXAMPLES = settings(max_examples=60, deadline=None, derandomize=True)


def shuffled(seed, slices, spread, unit=1.0, jumps=0):
    """Clay of random slices, widths and thicknesses over 10^spread, some nodes with edges."""
    rng = np.random.default_rng(seed)
    width = 10 ** rng.uniform(-spread / 2, spread / 2, slices)
    nodes = np.concatenate([[0.0], np.cumsum(width) / width.sum()])
    nodes[-1] = 1.0
    steps = np.diff(nodes) * 10 ** rng.uniform(-spread / 2, spread / 2, slices)
    heights = np.concatenate([[0.0], np.cumsum(steps * unit / steps.sum())])
    at = np.sort(rng.choice(np.arange(1, slices), jumps, replace=False))
    slope = np.diff(heights) / np.diff(nodes)
    radius = 0.5 * unit**1.5 / np.sqrt(slope)
    edges = [[nodes[i], x] for i in at for x in (radius[i - 1], radius[i])]
    return Clay(heights, np.diff(heights), 0.5 * unit**1.5, unit, nodes, np.reshape(edges, (-1, 2)))


clays = st.builds(
    shuffled,
    st.integers(0, 10**6),
    st.integers(4, 40),
    st.floats(0.0, 2.0),
    st.sampled_from([1.0, 300.0]),
    st.integers(0, 3),
)


@EXAMPLES
@given(clays)
def test_heights_rise_everywhere(clay):
    u = np.unique(np.concatenate([np.linspace(0, 1, 4001), clay.material]))
    for side in ("above", "below"):
        assert (clay.interpolant.slope(u, side) > 0).all()
    assert (np.diff(clay.height_at(u)) > 0).all()


@EXAMPLES
@given(clays)
def test_heights_at_nodes_are_the_clays_own(clay):
    assert np.array_equal(clay.height_at(clay.material), clay.heights)
    np.testing.assert_allclose(clay.material_at(clay.heights), clay.material, rtol=0, atol=1e-14)


@EXAMPLES
@given(clays, st.integers(0, 10**6))
def test_material_at_is_the_inverse(clay, seed):
    u = np.random.default_rng(seed).uniform(0, 1, 50)
    steepest = clay.interpolant.slope(u).min() / float(clay.height)
    tolerance = 1e-15 * 10 / steepest + 1e-14
    np.testing.assert_allclose(clay.material_at(clay.height_at(u)), u, rtol=0, atol=tolerance)


@EXAMPLES
@given(clays)
def test_slope_and_rise_are_those_of_the_heights(clay):
    """Y_u integrates to differences of Y, piece by piece."""
    points, weights = np.polynomial.legendre.leggauss(3)
    low, width = clay.material[:-1, None], np.diff(clay.material)[:, None]
    slope = clay.interpolant.slope(low + width * (points + 1) / 2)
    np.testing.assert_allclose((slope * weights).sum(axis=1) * width[:, 0] / 2, clay.thickness)
    some = np.sort(np.append(low + width * [0.0, 0.3, 0.6], 1.0))
    heights, rises = clay.interpolant.on(some)
    assert np.array_equal(heights, clay.height_at(some))
    np.testing.assert_allclose(rises, np.diff(heights), atol=1e-13 * float(clay.height))
    heights, rises = clay.interpolant.on(clay.material)
    assert np.array_equal(heights, clay.heights)
    assert np.array_equal(rises, clay.thickness)


def volume(clay):
    return float(np.sum(np.pi * clay.radii**2 * clay.thickness))


@EXAMPLES
@given(clays, st.integers(0, 10**6))
def test_resliced_keeps_the_volume_and_states_its_error(clay, seed):
    other = np.asarray(shuffled(seed, 24, 1.0).material)
    for nodes in (other, 30):
        new = clay.resliced(nodes)
        assert volume(new.clay) == pytest.approx(float(clay.volume), rel=1e-15 * 4)
        assert (new.clay.r0, new.clay.unit) == (clay.r0, clay.unit)
        assert new.error == contour_error(new.clay, clay)
    same = clay.resliced(clay.material)
    assert np.array_equal(same.clay.heights, clay.heights)
    assert same.error <= 1e-15


def smooth_height(u):
    return u + 0.15 * np.sin(5 * u)


def test_height_at_is_of_order_four():
    sizes, errors = (16, 32, 64, 128), []
    u = np.linspace(0, 1, 2001)
    for n in sizes:
        s = np.arange(n + 1) / n
        nodes = s + 0.08 * np.sin(2 * np.pi * s)
        nodes[-1] = 1.0
        heights = smooth_height(nodes)
        clay = Clay(heights, np.diff(heights), 0.5, heights[-1], nodes)
        errors.append(abs(clay.height_at(u) - smooth_height(u)).max())
    assert -np.polyfit(np.log(sizes), np.log(errors), 1)[0] > 3.7, errors


def test_an_edge_with_a_jump_has_two_radii():
    nodes = np.array([0.0, 0.1, 0.25, 0.4, 0.7, 0.85, 1.0])
    slope = np.array([1.5, 1.5, 1.5, 0.6, 0.6, 0.6])
    heights = np.concatenate([[0.0], np.cumsum(slope * np.diff(nodes))])
    radius = 0.5 / np.sqrt(slope[[2, 3]])
    edges = [[0.4, radius[0]], [0.4, radius[1]]]
    clay = Clay(heights, np.diff(heights), 0.5, heights[-1], nodes, edges)
    assert clay.interpolant.slope(np.array(0.4), "below") == pytest.approx(1.5)
    assert clay.interpolant.slope(np.array(0.4)) == pytest.approx(0.6)
    at = heights[3]
    found = [float(clay.radius_at(at + shift)) for shift in (-1e-9, 0.0, 1e-9)]
    assert found == pytest.approx([radius[0], radius[1], radius[1]], abs=1e-7)
    # Nothing of the step is smeared over the slices beside it.
    u = np.array([0.05, 0.2, 0.399, 0.401, 0.6, 0.99])
    expected = np.where(u < 0.4, 1.5 * u, heights[3] + 0.6 * (u - 0.4))
    np.testing.assert_allclose(clay.height_at(u), expected, atol=1e-14)
    line = polyline(clay)
    assert [float(x) for x, y in line if y == at] == pytest.approx(list(radius))


@pytest.mark.parametrize("squash", [MIDDLE, Squash(0.0, 0.3, 0.4), Squash(0.5, 2.0, 0.45)])
def test_the_contour_goes_through_edges_middles_and_ends(squash):
    clay = deform(Clay.cylinder(), squash, SNAKE, slices=32).raise_for_status().clay
    line = polyline(clay)
    assert (line[[0, -1]] == [[0, 0], [0, clay.heights[-1]]]).all()
    # The oracle divides differences of heights, which float64 rounds.
    heights = np.cumsum(np.append(0.0, clay.thickness).astype(np.longdouble))
    expected = oracle.smooth_polyline(
        clay.material, heights, float(clay.r0), np.unique(clay.edges, axis=0)
    )
    edges = {tuple(edge) for edge in clay.edges}
    assert {radius for _, radius in edges} == {squash.radius}
    distinct = line[1:-1][np.append(True, np.abs(np.diff(line[1:-1], axis=0)).max(axis=1) > 0)]
    np.testing.assert_allclose(distinct, expected, rtol=0, atol=1e-14)


def succession(count, seed=0):
    """Random squashes of one piece: yields the clay before and the answer."""
    rng = np.random.default_rng(seed)
    clay = Clay.cylinder(0.4, 1.7, 32)
    for _ in range(count):
        bottom = 0.0 if rng.random() < 0.2 else rng.uniform(0.05, 0.8) * float(clay.height)
        top = bottom + rng.uniform(0.05, 0.3) * float(clay.height)
        radius = float(clay.radius_at(min((bottom + top) / 2, float(clay.height))))
        radius *= rng.uniform(1.02, 1.1) if rng.random() < 0.3 else rng.uniform(0.85, 0.98)
        material = Material.from_snake_units(mu=rng.uniform(0.5, 2.0))
        answer = deform(clay, Squash(bottom, top, radius), material, slices=32)
        yield clay, answer
        if (answer.clay.thickness > 0).all():
            clay = answer.clay


def check_succession(count):
    first, rested, shared = None, 0, 0
    for before, answer in succession(count):
        first = before if first is None else first
        clay, posed = answer.clay, answer.problem.clay
        assert volume(clay) == pytest.approx(float(first.volume), rel=4 * 2.3e-16)
        for name in ("r0", "unit"):
            assert np.array_equal(getattr(clay, name), getattr(first, name))
        assert np.array_equal(clay.volume, first.volume)
        rests = np.asarray(answer.point.shift) == 0
        assert np.array_equal(clay.heights[rests], posed.heights[rests])
        u = answer.problem.rest.material
        old = np.isin(u, before.material) & rests
        place = np.searchsorted(before.material, u[old])
        assert np.array_equal(clay.heights[old], before.heights[place])
        between = rests[1:] & rests[:-1]
        assert np.array_equal(clay.thickness[between], posed.thickness[between])
        rested += rests.sum() - 1
        shared += old.sum() - 1
    # The statements above are not about nothing.
    assert rested > 3 * count
    assert shared > 2 * count


def test_volume_and_resting_clay_through_many_squashes():
    check_succession(60)


@pytest.mark.slow
def test_volume_and_resting_clay_through_200_squashes():
    check_succession(200)
