import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxclay import Clay, Material

EXACT = {"rtol": 1e-14, "atol": 0}


def slice_volumes(clay):
    return np.pi * clay.radii**2 * clay.thickness


def frusta_volume(heights, radii):
    """Volume of the solid of revolution of a polyline, frustum by frustum."""
    total = 0.0
    for i in range(len(heights) - 1):
        a, b = radii[i], radii[i + 1]
        total += np.pi / 3 * (heights[i + 1] - heights[i]) * (a * a + a * b + b * b)
    return total


def test_cylinder_has_equal_slices_of_its_radius():
    clay = Clay.cylinder(radius=0.3, height=2.0, slices=10)
    np.testing.assert_allclose(clay.heights, np.linspace(0, 2, 11), **EXACT)
    np.testing.assert_allclose(clay.radii, np.full(10, 0.3), **EXACT)
    assert clay.volume == pytest.approx(np.pi * 0.09 * 2, rel=1e-14)
    assert clay.r0 == pytest.approx(0.3 * 2**0.5, rel=1e-14)
    assert (clay.height, clay.unit, clay.slices) == (2.0, 2.0, 10)


def test_radii_follow_from_thickness_by_volume():
    thickness = np.array([0.1, 0.4, 0.2, 0.3])
    clay = Clay(np.concatenate([[0], np.cumsum(thickness)]), thickness, r0=0.5, unit=1.0)
    for i in range(4):
        assert clay.radii[i] == pytest.approx(0.5 * (0.25 / thickness[i]) ** 0.5, rel=1e-14)


def test_cone_is_cut_where_calculus_says():
    # Radius 1 + y up to y = 2: volume below y is pi/3 ((1 + y)^3 - 1), in all 26 pi/3.
    clay = Clay.from_profile([5.0, 7.0], [1.0, 3.0], slices=16)
    u = np.arange(17) / 16
    np.testing.assert_allclose(clay.heights, (1 + 26 * u) ** (1 / 3) - 1, rtol=1e-13, atol=1e-15)
    assert clay.volume == pytest.approx(26 * np.pi / 3, rel=1e-14)
    assert clay.unit == 2.0


def test_sphere_of_frusta():
    angle = np.linspace(0, np.pi, 201)
    heights, radii = -np.cos(angle), np.maximum(np.sin(angle), 0.02)
    clay = Clay.from_profile(heights, radii, slices=32)
    assert clay.volume == pytest.approx(frusta_volume(heights, radii), rel=1e-13)
    assert clay.volume == pytest.approx(4 * np.pi / 3, rel=1e-3)
    assert clay.heights[16] == pytest.approx(1.0, abs=1e-13)  # by symmetry
    np.testing.assert_allclose(slice_volumes(clay), clay.volume / 32, rtol=1e-13)


@settings(max_examples=30, deadline=None)
@given(
    steps=st.lists(st.floats(0.01, 10), min_size=1, max_size=12),
    seed=st.integers(0, 1000),
    slices=st.integers(3, 100),
)
def test_any_profile_keeps_its_volume(steps, seed, slices):
    heights = np.concatenate([[0], np.cumsum(steps)])
    radii = np.random.default_rng(seed).uniform(0.05, 3, len(heights))
    clay = Clay.from_profile(heights, radii, slices=slices)
    assert clay.volume == pytest.approx(frusta_volume(heights, radii), rel=1e-13)
    assert clay.height == pytest.approx(heights[-1], rel=1e-14)
    for i in range(1, slices):  # the cuts below each hold their share of the profile
        below = np.append(heights[heights < clay.heights[i]], clay.heights[i])
        share = frusta_volume(below, np.interp(below, heights, radii)) / clay.volume
        assert share == pytest.approx(i / slices, rel=1e-10)


def test_pointed_tip_is_clipped_on_request():
    clay = Clay.from_profile([0, 1, 2], [1, 1, 0], minimum_radius=0.1)
    assert clay.volume == pytest.approx(frusta_volume([0, 1, 2], [1, 1, 0.1]), rel=1e-14)
    with pytest.warns(UserWarning, match="radius 0 at the top clipped to the floor 0.03"):
        clay = Clay.from_profile([0, 1, 2], [1, 1, 0])
    assert clay.volume == pytest.approx(frusta_volume([0, 1, 2], [1, 1, 0.03]), rel=1e-14)


@pytest.mark.parametrize(
    ("heights", "radii", "options", "message"),
    [
        ([0, 2, 1.5], [1, 1, 1], {}, r"point 2: height 1.5 follows 2: the wall overhangs"),
        ([1, 1, 1], [1, 1, 1], {}, r"point 0: 3 rows of one height"),
        ([0, np.nan, 1], [1, 1, 1], {}, r"point 1: height is nan"),
        ([0, 1, np.inf], [1, 1, 1], {}, r"point 2: height is inf"),
        ([0, 1, 2], [1, 0, 1], {}, r"point 1: radius is 0 between the ends"),
        ([0, 1], [-2, 1], {}, r"point 0: radius is -2, alone on the left"),
        ([0, 1], [-2, 1], {"minimum_radius": 0.1}, r"point 0: radius is -2"),
        ([0, 1], [1, np.nan], {}, r"point 1: radius is nan"),
        ([0, 1], [1, 1, 1], {}, r"same length.*\(2,\) and \(3,\)"),
        ([0], [1], {}, r"at least 2"),
        ([0, 1], [1, 1], {"slices": 2}, r"slices .* at least 3, got 2"),
        ([0, 1], [1, 1], {"slices": 4.5}, r"slices .* whole number .* got 4.5"),
        ([0, 1], [1, 1], {"minimum_radius": 0.0}, r"minimum_radius must be positive"),
    ],
)
def test_bad_profiles_are_named(heights, radii, options, message):
    with pytest.raises(ValueError, match=message):
        Clay.from_profile(heights, radii, **options)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"radius": 0.0}, "radius must be positive and finite, got 0"),
        ({"height": -1.0}, "height must be positive and finite, got -1"),
        ({"radius": float("inf")}, "radius must be positive and finite, got inf"),
        ({"radius": "wide"}, "radius must be a number, got 'wide'"),
        ({"slices": 0}, "slices must be a whole number of at least 3, got 0"),
        ({"slices": True}, "slices must be a whole number"),
    ],
)
def test_bad_cylinders_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        Clay.cylinder(**arguments)


@pytest.mark.parametrize("slices", ["many", float("nan")])
def test_slices_that_are_no_number_are_named(slices):
    with pytest.raises(ValueError, match="slices must be a whole number"):
        Clay.cylinder(slices=slices)


@pytest.mark.parametrize(
    ("name", "value"),
    [("k", 0.0), ("k", -1.0), ("mu", -0.1), ("alpha", float("nan")), ("beta", float("inf"))]
    + [("floor", 0.0), ("floor", 1.0), ("floor", float("nan"))],
)
def test_bad_constants_are_named(name, value):
    with pytest.raises(ValueError, match=f"{name} must .*{value:g}"):
        Material(**{name: value})


def test_clay_must_start_at_the_bottom_and_increase():
    with pytest.raises(ValueError, match="heights must start at 0, got 1"):
        Clay([1, 2, 3, 4], [1, 1, 1], r0=1, unit=1)
    with pytest.raises(ValueError, match="heights must be one more than thickness"):
        Clay([0, 1, 2, 3], [1, 1], r0=1, unit=1)
    with pytest.raises(ValueError, match="r0 must be positive"):
        Clay([0, 1, 2, 3], [1, 1, 1], r0=0, unit=1)


def test_float32_input_becomes_float64():
    profile = np.linspace(0, 1, 5, dtype=np.float32), np.full(5, 0.5, np.float32)
    for clay in (Clay.from_profile(*profile), Clay.cylinder(np.float32(0.5), np.float32(1))):
        for array in (clay.heights, clay.thickness, clay.radii, clay.r0, clay.unit, clay.volume):
            assert np.asarray(array).dtype == np.float64


def test_clay_is_a_pytree():
    clay = Clay.cylinder(slices=5)
    leaves, tree = jax.tree.flatten(clay)
    again = jax.tree.unflatten(tree, leaves)
    assert isinstance(again, Clay)
    for name in ("heights", "thickness", "r0", "unit"):
        np.testing.assert_array_equal(getattr(again, name), getattr(clay, name))
    doubled = jax.tree.map(lambda leaf: 2 * leaf, clay)
    assert doubled.height == 2.0


def test_clay_goes_through_jit():
    with jax.enable_x64(True):
        volume, clay = jax.jit(lambda c: (c.volume, c))(Clay.cylinder(radius=0.3, slices=5))
        assert isinstance(clay, Clay)
        np.testing.assert_allclose(clay.radii, 0.3, rtol=1e-14)
    assert volume == pytest.approx(0.09 * np.pi, rel=1e-14)
