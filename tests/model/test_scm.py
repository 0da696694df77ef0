import jax
import numpy as np
import oracles
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scenes import SNAKE, cylinder_problem, piece, population_problems, wavy

from jaxclay import Clay, Material, Squash, pose, rough_shape

SMALL_FLOOR = 1e-6
DEEP = [Squash(0, 0.9, 0.25), Squash(0, 0.75, 0.2, True), Squash(0.3, 0.9, 0.2)]
U = np.arange(65) / 64


def closed_form(clay, u0, y0, ratio, held):
    """Case and heights at the nodes above u0, straight from eqs. 13-19; None at the lower bound."""
    field = oracles.SlopeField(np.diff(clay.heights) * clay.slices)
    displacement = y0 - field.height(u0)
    pivot = oracles.rough_case_one(field, u0, displacement, ratio)
    case, end = "I", pivot
    if pivot is None:
        pivot = oracles.pivot_held(field, u0, displacement, ratio) if held else 1.0
        case, end = ("III" if held else "II"), 1.0
    nodes = U[u0 + 1e-9 < U]
    moved = [oracles.rough_height(field, u, u0, y0, ratio, pivot) for u in nodes]
    heights = np.where(nodes <= end, moved, clay.heights[u0 + 1e-9 < U])
    steps = np.diff(np.concatenate([[y0], heights]))
    return case, pivot, None if (steps <= 1e-3).any() else heights


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 100),
    top=st.floats(0.1, 0.6),
    radius=st.floats(0.35, 0.65),
    mu=st.sampled_from([0.01, 0.05, 0.2, 0.7, 1.5]),
    held=st.booleans(),
)
def test_above_a_bottom_band(seed, top, radius, mu, held):
    share = (radius / 0.5) ** 2 * top
    assume(share < 0.9)
    clay = wavy(seed)
    case, pivot, expected = closed_form(clay, share, top, mu, held)
    assume(expected is not None)
    squash = Squash(0, top, radius, top_fixed=held)
    rough = rough_shape(pose(clay, squash, Material(mu=mu, floor=SMALL_FLOOR), "paper"))
    np.testing.assert_allclose(rough.heights[share + 1e-9 < U], expected, rtol=0, atol=1e-11)
    assert rough.case == case
    assert rough.reach == pytest.approx(pivot if case == "I" else 1.0, rel=1e-9)
    assert rough.feasible
    assert not rough.floored


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 100),
    bottom=st.floats(0.25, 0.5),
    radius=st.floats(0.4, 0.6),
    mu=st.sampled_from([0.05, 0.3, 1.0]),
)
def test_both_sides_of_a_middle_band(seed, bottom, radius, mu):
    clay, top = wavy(seed), bottom + 0.2
    squash = Squash(bottom, top, radius)
    rough = rough_shape(pose(clay, squash, Material(mu=mu, floor=SMALL_FLOOR), "paper"))
    lower, upper = rough.band
    # The lower side is solved upside down, its far end held on the table.
    flipped = piece(clay.thickness[::-1])
    case, _, above = closed_form(clay, upper, top, mu, held=False)
    case_below, _, below = closed_form(flipped, 1 - lower, 1 - bottom, mu, held=True)
    assume(above is not None and below is not None)
    np.testing.assert_allclose(rough.heights[upper + 1e-9 < U], above, rtol=0, atol=1e-9)
    under = U[::-1][1 - lower + 1e-9 < U]
    picked = rough.heights[np.isin(U, under)]
    np.testing.assert_allclose(picked, 1 - below[::-1], rtol=0, atol=1e-9)
    assert (rough.case, rough.case_below) == (case, case_below)


def test_unit_cylinder_by_hand():
    # Case I: d = 0.3 - 0.192 = 0.108, reach = sqrt(2 d k/mu), Y = Y0 + mu/2k (u1 - u)^2.
    rough = rough_shape(cylinder_problem(Squash(0, 0.3, 0.4), SNAKE))
    u1 = 0.192 + 0.216**0.5
    above = U > 0.192
    expected = U + np.maximum(u1 - U, 0) ** 2 / 2
    np.testing.assert_allclose(rough.heights[above], expected[above], rtol=1e-13)
    assert (rough.case, rough.case_below) == ("I", "none")
    assert rough.reach == pytest.approx(u1, rel=1e-13)
    assert rough.sigma == pytest.approx(u1 - 0.192, rel=1e-13)
    np.testing.assert_array_equal(rough.heights[u1 < U], U[u1 < U])  # rests bit for bit


def test_cases_two_and_three_by_hand():
    free = rough_shape(cylinder_problem(Squash(0, 0.3, 0.4), Material(mu=0.1)))
    held = rough_shape(cylinder_problem(Squash(0, 0.3, 0.4, True), Material(mu=0.1)))
    assert (free.case, held.case) == ("II", "III")
    # Eq. 18 on a cylinder: the end rises by d - mu/2k (1 - u0)^2, its slope stays 1.
    assert free.heights[-1] == pytest.approx(1 + 0.108 - 0.05 * 0.808**2, rel=1e-13)
    assert held.heights[-1] == 1.0
    for rough in (free, held):
        assert rough.reach == 1.0
        bend = np.diff(rough.heights, 2)[13:] * 64**2
        np.testing.assert_allclose(bend, 0.1, rtol=1e-8)  # Euler's equation, Y_uu = mu/k


@pytest.mark.parametrize("radius", [0.4, 0.6])
@pytest.mark.parametrize("held", [False, True])
def test_without_friction(radius, held):
    # A free end then shifts rigidly; a held one stretches or shrinks evenly on a cylinder.
    problem = cylinder_problem(Squash(0, 0.3, radius, held), Material(mu=0.0))
    rough = rough_shape(problem)
    u0 = (radius / 0.5) ** 2 * 0.3
    above = u0 < U
    even = 0.3 + (U - u0) * (0.7 / (1 - u0)) if held else U + 0.3 - u0
    np.testing.assert_allclose(rough.heights[above], even[above], rtol=1e-12)
    assert rough.case == ("III" if held else "II")


def heights_by(bottom, top, radius, mu, top_fixed, discrete=False):
    squash = Squash(bottom, top, radius, top_fixed)
    return rough_shape(pose(Clay.cylinder(), squash, Material(mu=mu), "paper"), discrete).heights


# The scene is traced, so that all scenes below share one compilation.
sensitivities = jax.jit(jax.jacfwd(heights_by, argnums=(2, 3)), static_argnames="discrete")


@pytest.mark.parametrize("discrete", [False, True])
def test_derivatives_are_finite_even_where_nothing_moves(discrete):
    for bottom, top, radius in [(0.0, 0.25, 0.5), (0.25, 0.5, 0.5), (0.35, 0.6, 0.4)]:
        for mu in (0.0, 1.0):
            with jax.enable_x64(True):
                jacobians = sensitivities(bottom, top, radius, mu, False, discrete=discrete)
                assert all(np.isfinite(jacobian).all() for jacobian in jacobians)
            assert np.isfinite(heights_by(bottom, top, radius, mu, False, discrete)).all()


@pytest.mark.parametrize(
    ("bottom", "radius", "mu", "held"),
    [
        (0.0, 0.42, 1.0, False),
        (0.0, 0.6, 0.1, False),
        (0.0, 0.42, 0.1, True),
        (0.4, 0.42, 1.0, False),
    ],
)
def test_derivatives_against_central_differences(bottom, radius, mu, held):
    with jax.enable_x64(True):
        exact = [
            np.asarray(j)
            for j in sensitivities(bottom, bottom + 0.3, radius, mu, held, discrete=False)
        ]
    step = 1e-6

    def heights(radius, mu):
        return heights_by(bottom, bottom + 0.3, radius, mu, held)

    by_radius = (heights(radius + step, mu) - heights(radius - step, mu)) / (2 * step)
    by_mu = (heights(radius, mu + step) - heights(radius, mu - step)) / (2 * step)
    np.testing.assert_allclose(exact, [by_radius, by_mu], rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("held", [False, True])
def test_floor_on_a_fine_grid(held):
    # mu/k = 3 and a deep squash: 2 d mu/k > 1, so eq. 15 would turn slices inside out.
    squash = Squash(0, 0.5, 0.3, top_fixed=held)
    rough = rough_shape(cylinder_problem(squash, Material(mu=3.0, floor=0.1)))
    u0 = 0.36 * 0.5
    x = (np.arange(200_000) + 0.5) / 200_000 * (1 - u0)
    push = 0.9 + 3.0 * thinned(0.32)
    slope = np.clip(1 - (push - 3.0 * x), 0.1, 1.0)
    expected = 0.5 + np.cumsum(slope) * (1 - u0) / 200_000
    above = u0 + 0.01 < U
    oracle = np.interp(U[above] - u0, x + (x[1] - x[0]) / 2, expected)
    np.testing.assert_allclose(rough.heights[above], oracle, atol=1e-8)
    assert rough.floored
    steps = np.diff(rough.heights) * 64
    assert steps[12] == pytest.approx(0.1, rel=1e-12)


def thinned(displacement, floor=0.1, ratio=3.0):
    """Length at the lower bound: d = (1 - f) (length + (1 - f) / (2 ratio))."""
    return displacement / (1 - floor) - (1 - floor) / (2 * ratio)


def test_discrete_form_is_the_minimum_of_the_sums():
    for problem in population_problems(25, seed=11, smoothing=False):
        rough = rough_shape(problem, discrete=True)
        expected = oracles.discrete_minimum(problem)
        np.testing.assert_allclose(rough.heights, expected, rtol=0, atol=1e-7)


@pytest.mark.parametrize("squash", DEEP)
def test_discrete_form_is_the_minimum_above_the_floor(squash):
    for mu in (3.0, 6.0):
        problem = pose(wavy(4), squash, Material(mu=mu, alpha=0, beta=0), "paper")
        rough = rough_shape(problem, discrete=True)
        assert rough.floored
        expected = oracles.discrete_minimum(problem)
        np.testing.assert_allclose(rough.heights, expected, rtol=0, atol=1e-7)


def test_no_room_above_the_band_is_reported():
    fits = rough_shape(cylinder_problem(Squash(0, 0.97, 0.4, top_fixed=True)))
    none = rough_shape(cylinder_problem(Squash(0, 0.99, 0.4, top_fixed=True)))
    # At the bound 0.05 the clay above needs 0.05 * (1 - 0.64 * 0.99) = 0.018 of the 0.01 left.
    assert fits.feasible
    assert not none.feasible
