"""As many slices as a tolerance needs, against closed forms and the scheme "spline"."""

import jax
import numpy as np
import pytest
from oracles import SlopeField, population, rough_case_one, rough_height
from scenes import PRINTED

import jaxclay
from jaxclay.bernstein import hermite

MOVED_ONLY = jaxclay.Material(alpha=0.0, beta=0.0)
BAND = jaxclay.Squash(0.0, 0.31, 0.4)  # its edge u0 = 0.1984 lies on no grid's node


def continuum(squash=BAND, r0=0.5):
    """The minimum of E_move on the unit cylinder, k = mu = 1, bottom = 0 (eqs. 13-15)."""
    field, density = SlopeField([1.0]), (r0 / squash.radius) ** 2
    u0 = squash.top / density
    u1 = rough_case_one(field, u0, squash.top - u0, 1.0)

    slope = 1 - (u1 - u0)  # Y_u just above the band; it rises evenly to 1 at u1
    reached = rough_height(field, u1, u0, squash.top, 1.0, u1)
    # Y, Y_u and Y_uu at the lower and the upper ends of the band, of what moves and what rests.
    lower = np.array([[0.0, density, 0.0], [squash.top, slope, 1.0], [reached, 1.0, 0.0]])
    upper = np.array([[squash.top, density, 0.0], [reached, 1.0, 1.0], [1.0, 1.0, 0.0]])
    breaks = np.array([0.0, u0, u1, 1.0])
    control = hermite(np.diff(breaks), tuple(lower.T), tuple(upper.T))
    return jaxclay.SmoothClay(breaks, control, r0, 1.0)


def on_slices(tolerance, clay=None, squash=BAND, material=MOVED_ONLY, **options):
    clay = jaxclay.Clay.cylinder() if clay is None else clay
    return jaxclay.deform(clay, squash, material, slices="auto", tolerance=tolerance, **options)


def slices(solution):
    return len(solution.heights) - 1


def estimate(solution):
    assert solution.error_estimate is not None
    return float(solution.error_estimate)


@pytest.mark.parametrize("tolerance", [3e-2, 1.5e-2])
def test_the_contour_is_within_the_tolerance_of_the_closed_form(tolerance):
    solution = on_slices(tolerance).raise_for_status()
    error = jaxclay.contour_error(solution.clay, continuum())
    assert error <= estimate(solution) <= min(tolerance, 3 * error)
    assert solution.clay.volume == pytest.approx(np.pi / 4, rel=1e-15)


def test_it_takes_no_more_slices_than_twice_what_the_tolerance_needs():
    solution = on_slices(1.5e-2)
    half = jaxclay.Clay.cylinder(slices=slices(solution) // 2)
    fewer = jaxclay.deform(half, BAND, MOVED_ONLY, scheme="paper")
    needed = 1.5e-2 / 1.5  # estimates are on the safe side by half
    assert jaxclay.contour_error(fewer.clay, continuum()) > needed
    assert slices(solution) == 256
    assert solution.unknowns == 206  # of 257 nodes the band holds those up to 50, u0 n = 50.8


def test_levels_are_the_iterations_on_the_grids_before():
    solution = on_slices(1.5e-2)
    alone = jaxclay.deform(jaxclay.Clay.cylinder(slices=64), BAND, MOVED_ONLY, scheme="paper")
    assert slices(solution) == 256
    assert len(solution.levels) == 2  # 64 and 128
    assert solution.levels[0] == pytest.approx(alone.iterations, abs=2)


def test_a_function_and_its_slices_give_the_same_answer():
    cylinder = jaxclay.Clay.cylinder(slices=100)
    one, other = on_slices(3e-2, cylinder), on_slices(3e-2, cylinder.as_function().clay)
    assert (one.heights == other.heights).all()
    assert estimate(other) == estimate(one)


def test_a_tolerance_out_of_reach_gives_the_nearest_answer_and_says_so(monkeypatch):
    monkeypatch.setattr("jaxclay.auto_slices._MOST", 128)
    solution = on_slices(1e-4)
    assert solution.status is jaxclay.Status.UNRESOLVED
    assert slices(solution) == 128
    error = jaxclay.contour_error(solution.clay, continuum())
    assert 0.5 * error < estimate(solution) < 10 * error
    with pytest.raises(RuntimeError, match="tolerance cannot be reached"):
        solution.raise_for_status()


def test_a_method_that_does_not_converge_keeps_its_own_status():
    solution = on_slices(1e-2, max_iterations=1)
    assert solution.status is jaxclay.Status.ITERATION_LIMIT
    assert solution.error_estimate is None


@pytest.mark.parametrize("tolerance", [0, -1e-3, float("nan"), 1.0, 1e-10, "fine"])
def test_a_tolerance_that_nobody_can_meet_is_an_error(tolerance):
    with pytest.raises(ValueError, match=f"tolerance must .*{tolerance}"):
        on_slices(tolerance)


def test_inside_a_transformation_the_error_asks_for_a_number_of_slices():
    with jax.enable_x64(True), pytest.raises(TypeError, match="give a number of slices"):
        jax.jit(lambda radius: on_slices(1e-2, squash=jaxclay.Squash(0.0, 0.3, radius)))(0.4)


@pytest.mark.slow
def test_on_random_scenes_the_estimate_tells_the_distance_from_the_splines_answer():
    ratios, within = [], []
    for r0, squashes, material in population(14, seed=2):
        squash = squashes[-1]
        clay = jaxclay.Clay.cylinder(radius=r0)
        if squash.bottom > 0.8:
            continue
        truth = jaxclay.deform(clay, squash, material, tolerance=1e-4).raise_for_status()
        solution = on_slices(1e-2, clay, squash, material)
        error = jaxclay.contour_error(solution.clay, truth.clay)
        ratios.append(estimate(solution) / error)
        within.append(error <= 1e-2 or solution.status is jaxclay.Status.UNRESOLVED)
    assert np.mean(within) > 0.95
    assert np.mean((np.array(ratios) > 0.5) & (np.array(ratios) < 10)) > 0.95


@pytest.mark.slow
def test_printed_constants_stop_where_rounding_would_hide_the_answer():
    solution = on_slices(1e-4, material=PRINTED)
    assert solution.status is jaxclay.Status.UNRESOLVED
    assert 1024 < slices(solution) <= 2657  # as measured: refused beyond
    truth = jaxclay.deform(jaxclay.Clay.cylinder(), BAND, PRINTED, tolerance=1e-6)
    error = jaxclay.contour_error(solution.clay, truth.clay)
    assert 0.5 * error < estimate(solution) < 10 * error


@pytest.mark.slow
def test_a_narrow_band_starts_on_a_grid_that_holds_some_of_it():
    squash = jaxclay.Squash(0.5, 0.51, 0.45)
    solution = on_slices(1e-2, squash=squash, material=PRINTED)
    assert solution.status is jaxclay.Status.CONVERGED
    assert slices(solution) >= 512
