"""What holds whatever is done to a piece: volume, the resting clay, the length unit."""

import numpy as np
import pytest
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE

from jaxclay import Clay, Material, Squash, deform
from jaxclay.files.piece import Piece, load_piece, save_piece

BARE = Material(alpha=0.0, beta=0.0)


def random_squash(rng, clay):
    """A squash in proportion to the piece, mostly pressing, now and then drawing in."""
    height = float(clay.height)
    radius = float(clay.r0) / height**0.5 * rng.uniform(0.75, 1.1)
    bottom = 0.0 if rng.random() < 0.5 else rng.uniform(0.15, 0.6) * height
    return Squash(bottom, bottom + rng.uniform(0.15, 0.3) * height, radius)


def exported_volume(path):
    clay = load_piece(path).clay
    return np.pi * np.sum(clay.radii**2 * clay.thickness)


def test_two_hundred_squashes_keep_the_volume(tmp_path):
    first = clay = Clay.cylinder(radius=0.4)
    rng = np.random.default_rng(8)
    for number in range(200):
        clay = deform(clay, random_squash(rng, clay), SNAKE, scheme="paper").clay
        assert clay.r0 == first.r0
        assert (np.diff(clay.heights) > 0).all()
        np.testing.assert_allclose(np.diff(clay.heights), clay.thickness, rtol=1e-10)
        if number % 10 == 9:
            save_piece(tmp_path / "piece.json", Piece(clay))
            volume = exported_volume(tmp_path / "piece.json")
            assert volume == pytest.approx(np.pi * 0.16, rel=1e-12)


def test_resting_clay_is_untouched_to_the_bit():
    thickness = np.random.default_rng(0).uniform(0.4, 0.6, 64)
    heights = np.concatenate([[0], np.cumsum(thickness)])
    worn = Clay(heights, thickness, r0=90.0, unit=29.3)
    # A snake would iron this piece out everywhere.
    solution = deform(worn, Squash(0.0, 5.0, 15.0), BARE, scheme="paper").raise_for_status()
    assert solution.rough.case == "I"
    far = np.arange(65) / 64 > solution.rough.reach + 0.1
    assert far.sum() > 10
    there_and_back = worn.heights / worn.unit * worn.unit
    assert (there_and_back != worn.heights)[far].any()  # which a careless program would return
    np.testing.assert_array_equal(solution.heights[far], worn.heights[far])
    np.testing.assert_array_equal(solution.clay.thickness[far[:-1]], worn.thickness[far[:-1]])
    np.testing.assert_array_equal(solution.clay.radii[far[:-1]], worn.radii[far[:-1]])


@pytest.mark.parametrize("squash", [REFERENCE, MIDDLE])
@pytest.mark.parametrize("material", [SNAKE, PRINTED])
def test_minimum_does_not_depend_on_the_unit(squash, material):
    one = deform(Clay.cylinder(), squash, material, scheme="paper").raise_for_status()
    scaled = Squash(300 * squash.bottom, 300 * squash.top, 300 * squash.radius)
    big = deform(Clay.cylinder(150, 300), scaled, material, scheme="paper").raise_for_status()
    np.testing.assert_allclose(big.heights, 300 * one.heights, rtol=1e-8)
    assert big.energy == pytest.approx(one.energy, rel=1e-9)
    assert big.clay.unit == 300


def test_held_top_stays_where_it_is():
    for bottom in (0.0, 0.4):
        squash = Squash(bottom, bottom + 0.3, 0.4, top_fixed=True)
        for material in (SNAKE, Material(mu=0.1, alpha=0.1, beta=1e-4)):
            solution = deform(Clay.cylinder(), squash, material, scheme="paper").raise_for_status()
            assert solution.clay.height == 1.0


@pytest.mark.parametrize("squash", [REFERENCE, MIDDLE, Squash(0.5, 1.5, 0.45)])
def test_band_has_the_tools_radius(squash):
    solution = deform(Clay.cylinder(), squash, PRINTED, scheme="paper").raise_for_status()
    middles = (solution.heights[1:] + solution.heights[:-1]) / 2
    u = (np.arange(64) + 0.5) / 64
    inside = (u > solution.rough.band[0] + 0.5 / 64) & (u < solution.rough.band[1] - 0.5 / 64)
    assert inside.sum() > 5
    np.testing.assert_allclose(solution.clay.radii[inside], squash.radius, rtol=1e-12)
    assert (middles[inside] > squash.bottom).all()


def test_squashing_upside_down_lies_mirrored_when_both_ends_are_held():
    # With the top held and the lower end on the table the two sides are alike.
    one = deform(Clay.cylinder(), Squash(0.3, 0.5, 0.42, True), BARE, scheme="paper")
    two = deform(Clay.cylinder(), Squash(0.5, 0.7, 0.42, True), BARE, scheme="paper")
    np.testing.assert_allclose(1 - two.rough.band[::-1], one.rough.band, atol=1e-9)
    np.testing.assert_allclose(1 - two.rough.heights[::-1], one.rough.heights, atol=1e-9)
