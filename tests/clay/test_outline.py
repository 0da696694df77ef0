"""Outlines of points: the same contour however it is drawn, by hand and at random."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from jaxclay.clay.clay import cut
from jaxclay.clay.outline import outline


def of(*points, **options):
    return outline(*np.array(points, float).T, **options)


@settings(max_examples=60, deadline=None)
@given(data=st.data(), count=st.integers(2, 7))
def test_a_contour_is_the_same_however_it_is_drawn(data, count):
    """With steps; turned, mirrored, closed, with rows twice, and both halves of it."""
    steps = data.draw(st.lists(st.integers(0, 50), min_size=count - 1, max_size=count - 1))
    y = np.append(0, np.cumsum(steps)) / 8.0
    assume(steps[0] > 0 and steps[-1] > 0)  # rows of one height at an end close it
    r = np.array(data.draw(st.lists(st.integers(1, 99), min_size=count, max_size=count))) / 16
    plain = outline(y, r)
    again = np.sort(data.draw(st.lists(st.integers(0, count - 1), max_size=3)))
    order = np.sort(np.append(np.arange(count), again)).astype(int)
    drawn = np.stack([y[order], r[order]], axis=1)
    foot = [[y[0], 0.0]] if data.draw(st.booleans()) else np.empty((0, 2))
    lid = [[y[-1], 0.0]] if data.draw(st.booleans()) else np.empty((0, 2))
    drawn = np.concatenate([foot, drawn, lid])
    left = drawn * [1, -1]
    for points in (drawn, drawn[::-1], left, left[::-1], np.concatenate([left[::-1], drawn])):
        found = of(*points)
        np.testing.assert_array_equal(found.heights, plain.heights)
        np.testing.assert_allclose(found.radii, plain.radii, rtol=1e-15)


def test_the_mean_of_halves_by_hand():
    """The left one has no point at 1, the right one none at 2, and a step at 3."""
    left = [(0, -4), (2, -6), (4, -6)]
    right = [(0, 4), (1, 6), (3, 6), (3, 4), (4, 4)]
    found = of(*left[::-1], *right)
    expected = [(0, 4), (1, 5.5), (2, 6), (3, 6), (3, 5), (4, 5)]
    np.testing.assert_allclose(np.stack([found.heights, found.radii], 1), expected, rtol=1e-15)
    assert found.altered == ("both halves averaged, whose radii differ by up to 2",)


def test_halves_of_unlike_height_keep_what_both_have():
    found = of((5, -1), (1, -1), (0, 1), (4, 1))
    np.testing.assert_array_equal(found.heights, [1, 4])
    assert "whose ends by 1, which was left out" in found.told[0]
    with pytest.raises(ValueError, match="no height in common"):
        of((1, -1), (0, -1), (2, 1), (3, 1))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), near=st.sampled_from([1e-2, 1e-4, 1e-6]))
def test_cut_near_is_as_near_as_it_says_and_keeps_the_volume(seed, near):
    rng = np.random.default_rng(seed)
    y = np.append(0, np.cumsum(rng.uniform(0.0, 1, 7) * (rng.uniform(size=7) > 0.3)))
    y[-1] += 1.0
    r = rng.uniform(0.2, 2, 8)
    drawn = outline(y, r)
    clay, error = cut(drawn, near=near)
    assert error <= near
    y, r = drawn.heights, drawn.radii
    frusta = np.sum(np.diff(y) * (r[1:] ** 2 + r[1:] * r[:-1] + r[:-1] ** 2)) / 3
    assert clay.r0**2 == pytest.approx(frusta, rel=1e-14)
    assert clay.material[0] == 0
    assert clay.material[-1] == 1
    steps = np.flatnonzero(np.diff(y) == 0)
    inner = [radius for u, radius in clay.edges if 0 < u < 1]
    np.testing.assert_array_equal(inner, r[np.stack([steps, steps + 1], 1)].ravel())
