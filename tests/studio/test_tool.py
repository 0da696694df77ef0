"""The tool: which clay its face reaches, and its way in steps that no sampling changes."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxclay.clay.clay import Clay
from jaxclay.studio.tool import STEP, Place, Way, contact, is_near

CYLINDER = Clay.cylinder(0.4, 1.0)
CONE = Clay.from_profile([0.0, 1.0], [0.5, 0.2], slices=256)
BEADS = Clay.from_profile(
    [0, 0.3, 0.4, 0.5, 0.6, 0.7, 1.0], [0.3, 0.3, 0.4, 0.3, 0.45, 0.3, 0.3], 512
)


@pytest.mark.parametrize("place", [(0.5, 0.41), (0.5, 0.4), (1.2, 0.1), (-0.2, 0.1)])
def test_a_tool_that_stands_off_does_nothing(place):
    assert contact(CYLINDER, Place(*place), 0.2) is None


def test_the_whole_face_presses_where_all_of_it_reaches_clay():
    squash = contact(CYLINDER, Place(0.5, 0.35), 0.2)
    assert (squash.bottom, squash.top, squash.radius) == pytest.approx((0.4, 0.6, 0.35))


def test_only_clay_that_the_face_reaches_is_pressed():
    # The cone has the radius 0.35 at the height 0.5; a face above that hangs in the air.
    squash = contact(CONE, Place(0.5, 0.35), 0.4)
    assert squash.bottom == pytest.approx(0.3)
    assert squash.top == pytest.approx(0.5, abs=0.01)


def test_of_two_beads_the_one_deeper_in_the_tool_is_pressed():
    squash = contact(BEADS, Place(0.5, 0.38), 0.5)
    assert 0.5 < squash.bottom < 0.6 < squash.top < 0.7


def test_clay_at_the_ends_goes_with_the_tool():
    assert contact(CYLINDER, Place(0.1, 0.3), 0.3).bottom == 0
    top = contact(CYLINDER, Place(0.95, 0.3), 0.2)
    share = 1 - float(CYLINDER.material_at(top.bottom))
    assert 0.3**2 * (top.top - top.bottom) >= share * 0.4**2  # room for all clay above the edge


def test_near_is_near():
    assert is_near(CYLINDER, Place(0.5, 0.43), 0.2, 0.05)
    assert not is_near(CYLINDER, Place(0.5, 0.47), 0.2, 0.05)


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=2, max_size=6),
    st.lists(st.floats(0.001, 0.999), max_size=20),
)
def test_steps_are_equal_and_depend_on_the_way_alone(corners, cuts):
    """Against the corners' own polyline, cut anywhere."""
    corners = np.array(corners)
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    finer = np.union1d(along, np.array(cuts) * along[-1])
    path = np.stack([np.interp(finer, along, corners[:, i]) for i in (0, 1)], axis=1)

    def steps(points):
        way = Way(Place(*points[0]), 1.0)
        found = [place for point in points[1:] for place in way.to(Place(*point))]
        return np.array(found).reshape(-1, 2), way.rest

    (coarse, rest), (fine, other) = steps(corners), steps(path)
    count = along[-1] / STEP
    if abs(count - round(count)) > 1e-6:
        assert len(coarse) == len(fine) == math.floor(count)
        np.testing.assert_allclose(coarse, fine, atol=1e-9)
        assert rest == pytest.approx(other, abs=1e-9)
    at = STEP * np.arange(1, len(coarse) + 1)
    distinct = np.append(True, np.diff(along) > 0)
    expected = [np.interp(at, along[distinct], corners[distinct, i]) for i in (0, 1)]
    np.testing.assert_allclose(coarse, np.stack(expected, axis=1), atol=1e-9)
