import re

import numpy as np
import oracles
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE, cylinder_problem, wavy

import jaxclay
from jaxclay import Clay, Material, Squash, pose, rough_shape


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((-0.1, 0.3, 0.4), "bottom must be finite and at least 0, got -0.1"),
        ((float("nan"), 0.3, 0.4), "bottom must be finite and at least 0, got nan"),
        ((0.3, 0.3, 0.4), "the band is empty: top must .* above bottom = 0.3, got 0.3"),
        ((0.3, 0.2, 0.4), "the band is empty"),
        ((0.0, float("inf"), 0.4), "the band is empty: top must be finite"),
        ((0.0, 0.3, 0.0), "radius must be positive and finite, got 0"),
        ((0.0, 0.3, -1.0), "radius must be positive and finite, got -1"),
        ((0.0, 0.3, float("nan")), "radius must be positive and finite, got nan"),
    ],
)
def test_bad_squashes_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        Squash(*arguments)


@pytest.mark.parametrize(
    ("squash", "message"),
    [
        (Squash(1.0, 1.2, 0.4), "bottom = 1, above the clay: .* height 1"),
        (Squash(0.5, 1.2, 0.4, top_fixed=True), "held at 1, .* no room above top = 1.2"),
        (Squash(0.0, 1.0, 0.4, top_fixed=True), "no room above top = 1"),
        (Squash(0.0, 0.9, 0.6, top_fixed=True), "takes all the clay and leaves no room"),
    ],
)
def test_squashes_that_do_not_fit_are_named(squash, message):
    with pytest.raises(ValueError, match=message):
        pose(Clay.cylinder(), squash, SNAKE, "paper")


@pytest.mark.parametrize("bottom", [0.0, 0.41])
def test_band_too_thin_for_the_grid_names_a_grid_that_works(bottom):
    squash = Squash(bottom, bottom + 0.02, 0.4)  # w = 0.0128, less than one slice of 64
    with pytest.raises(ValueError, match=r"imposes no radius: use at least \d+ slices") as error:
        pose(Clay.cylinder(), squash, SNAKE, "paper")
    named = int(re.search(r"at least (\d+) slices", str(error.value)).group(1))
    assert named >= 2 / 0.0128
    problem = pose(Clay.cylinder(slices=named), squash, SNAKE, "paper")
    held = np.flatnonzero(problem.fixed[1:] & problem.fixed[:-1])
    assert held.size >= 1
    np.testing.assert_allclose(np.diff(rough_shape(problem).heights)[held] * named, 1 / 0.64)


def test_bottom_band_fixes_nodes_where_the_paper_does():
    problem = cylinder_problem(Squash(0.0, 0.3, 0.4), SNAKE)
    u = np.arange(65) / 64
    held = u <= 0.192 + 1e-9 / 64  # u0 = 0.64 * 0.3
    np.testing.assert_array_equal(problem.fixed, held)
    heights = rough_shape(problem).heights
    np.testing.assert_allclose(heights[held], u[held] / 0.64, rtol=1e-14)


def test_a_node_on_the_edge_belongs_to_the_band():
    fixed = cylinder_problem(REFERENCE).fixed  # u0 = 3/16 is node 12
    np.testing.assert_array_equal(np.flatnonzero(fixed), np.arange(13))


def test_effective_top_is_the_last_fixed_node():
    for top in (0.29296875, 0.3, 0.31):
        rough = rough_shape(cylinder_problem(Squash(0.0, top, 0.4)))
        last = np.floor(0.64 * top * 64 + 1e-9)
        assert rough.top == pytest.approx(last / 64 / 0.64, rel=1e-13)
        assert rough.bottom == 0.0


def test_top_of_the_piece_is_swallowed():
    # From u = 0.5 upwards the clay makes 0.5 / 0.81 of height at radius 0.45.
    problem = cylinder_problem(Squash(0.5, 1.5, 0.45))
    rough = rough_shape(problem)
    assert rough.top == pytest.approx(0.5 + 0.5 / 0.81, rel=1e-13)
    np.testing.assert_allclose(rough.band, [0.5, 1.0], rtol=1e-13)
    np.testing.assert_array_equal(rough.heights[:33], np.arange(33) / 64)
    assert (rough.case, rough.case_below) == ("none", "I")


def test_a_band_over_everything_makes_a_cylinder():
    solution = jaxclay.deform(Clay.cylinder(), Squash(0.0, 2.0, 0.4), PRINTED, scheme="paper")
    assert solution.unknowns == 0
    np.testing.assert_allclose(solution.clay.radii, 0.4, rtol=1e-13)
    assert solution.clay.height == pytest.approx(1 / 0.64, rel=1e-13)
    assert solution.status is jaxclay.Status.CONVERGED


def side_energy(slopes, widths, displacement, held, ratio, floor):
    """E_move / k of one side: model.md's formula on slices away from the edge, midpoint rule."""
    x = np.cumsum(widths) - widths / 2
    sign = np.sign(displacement)

    def slope_after(sigma):
        bent = slopes - sign * np.maximum(sigma - ratio * x, 0) * slopes**2
        return np.maximum(bent, floor * slopes)

    low, high = 0.0, 1e4
    if not held:
        high = ratio * widths.sum()
    for _ in range(60):
        sigma = (low + high) / 2
        under = np.sum(np.abs(slope_after(sigma) - slopes) * widths) < abs(displacement)
        low, high = (sigma, high) if under else (low, sigma)
    after = slope_after(high)
    shift = displacement + np.cumsum((after - slopes) * widths) - (after - slopes) * widths / 2
    return np.sum(((after / slopes - 1) ** 2 / 2 + ratio * np.abs(shift)) * widths)


def summed_move_energy(problem, lower, fine=40):
    """E_move / k of both sides of a band whose material starts at ``lower``."""
    tool, rest = problem.tool, problem.rest
    ratio, floor = float(problem.material.mu / problem.material.k), float(problem.material.floor)
    heights, nodes = np.asarray(rest.heights), np.linspace(0, 1, 65)
    upper = lower + (tool.radius / rest.r0) ** 2 * (tool.top - tool.bottom)
    cuts = np.union1d(np.linspace(0, 1, 64 * fine + 1), [lower, upper])
    slopes = np.diff(np.interp(cuts, nodes, heights)) / np.diff(cuts)
    below, above = cuts[1:] <= lower + 1e-15, cuts[:-1] >= upper - 1e-15
    widths = np.diff(cuts)
    pushed_down = np.interp(lower, nodes, heights) - tool.bottom
    pushed_up = tool.top - np.interp(upper, nodes, heights)
    return side_energy(
        slopes[below][::-1], widths[below][::-1], pushed_down, True, ratio, floor
    ) + side_energy(slopes[above], widths[above], pushed_up, bool(tool.top_fixed), ratio, floor)


@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 50),
    bottom=st.floats(0.2, 0.5),
    radius=st.sampled_from([0.35, 0.42, 0.47, 0.55]),
    mu=st.sampled_from([0.1, 0.5, 1.0]),
    top_fixed=st.booleans(),
)
def test_middle_band_lies_where_both_sides_cost_least(seed, bottom, radius, mu, top_fixed):
    squash = Squash(bottom, bottom + 0.25, radius, top_fixed)
    problem = pose(wavy(seed), squash, Material(mu=mu), "paper")
    rough = rough_shape(problem)
    lower, upper = rough.band
    assume(upper < 1)  # else the top is swallowed
    found = summed_move_energy(problem, lower)
    # Where both sides are pushed the same way: between the clay at the two edges of the tool.
    ends = np.interp([bottom, min(bottom + 0.25, 1.0)], problem.rest.heights, np.linspace(0, 1, 65))
    share = upper - lower
    reachable = np.linspace(ends[0], min(ends[1] - share, 1 - share), 60)
    best = min(summed_move_energy(problem, start) for start in reachable)
    assert found <= best * (1 + 1e-4) + 1e-7  # the midpoint rule's own error


@pytest.mark.parametrize("mu", [0.1, 1.0])
def test_edge_tensions_balance(mu):
    problem = cylinder_problem(MIDDLE, Material(mu=mu))
    rough = rough_shape(problem)
    lower, upper = rough.band
    assert not rough.floored
    ratio = mu
    tensions = []
    for displacement, span, held in ((lower - 0.35, lower, True), (0.6 - upper, 1 - upper, False)):
        assert displacement > 0
        push = np.sqrt(2 * displacement * ratio)  # Case I: d = push^2 / (2 ratio)
        if push > ratio * span:
            push = displacement / span + ratio * span / 2 if held else ratio * span
        tensions.append(((1 - push) ** 2 - 1) / 2 - mu * displacement)
    assert tensions[0] == pytest.approx(tensions[1], abs=1e-9)


def test_nothing_is_displaced_where_the_tool_has_the_clays_radius():
    rough = rough_shape(cylinder_problem(Squash(0.25, 0.5, 0.5)))
    np.testing.assert_allclose(rough.heights, np.arange(65) / 64, rtol=1e-12)
    assert (rough.sigma, rough.sigma_below) == pytest.approx((0, 0), abs=1e-6)


@pytest.mark.parametrize("bottom", [0.0, 0.4])
def test_a_scene_in_millimetres_gives_the_same_shape(bottom):
    one = pose(Clay.cylinder(), Squash(bottom, bottom + 0.3, 0.4), PRINTED, "paper")
    big = Squash(300 * bottom, 300 * (bottom + 0.3), 120.0)
    other = pose(Clay.cylinder(radius=150, height=300), big, PRINTED, "paper")
    a, b = rough_shape(one), rough_shape(other)
    np.testing.assert_allclose(b.heights, 300 * a.heights, rtol=1e-11)
    np.testing.assert_allclose(b.band, a.band, rtol=1e-11)
    assert jaxclay.total_energy(other, b.heights) == pytest.approx(
        jaxclay.total_energy(one, a.heights), rel=1e-10
    )


def test_the_unit_stays_that_of_the_first_piece():
    slippery = Material.from_snake_units(mu=0.1)
    clay = jaxclay.deform(
        Clay.cylinder(height=2.0), Squash(0, 0.6, 0.4), slippery, scheme="paper"
    ).clay
    assert clay.unit == 2.0
    assert clay.height > 2.0
    problem = pose(clay, Squash(0, 0.4, 0.35), SNAKE, "paper")
    rest = oracles.constants_of(problem)
    np.testing.assert_allclose(rest["Y0"], clay.heights / 2.0, rtol=1e-13)


def test_a_band_a_hair_above_the_bottom_is_a_bottom_band():
    at_bottom = rough_shape(cylinder_problem(Squash(0.0, 0.3, 0.4)))
    for bottom in (1e-6, 1e-9, 1e-12):
        rough = rough_shape(cylinder_problem(Squash(bottom, 0.3, 0.4)))
        assert rough.feasible
        np.testing.assert_allclose(rough.band, at_bottom.band, atol=1e-4)
        np.testing.assert_allclose(rough.heights[13:], at_bottom.heights[13:], atol=1e-4)


def test_unknown_scheme_is_named():
    with pytest.raises(ValueError, match="unknown scheme 'finite elements': choose from slices"):
        pose(Clay.cylinder(), REFERENCE, SNAKE, scheme="finite elements")
