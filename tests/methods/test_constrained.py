"""The minimisers that know the lower bound as such, eq. 22 as a constraint, or neither: Adam."""

import numpy as np
import oracles
import pytest
from scenes import (
    MIDDLE,
    PRINTED,
    REFERENCE,
    SNAKE,
    cylinder_problem,
    piece,
    population_problems,
)
from scipy import optimize

import jaxclay
from jaxclay import Material, Squash, Status, minimize

BOUNDED = ["lbfgsb", "projected-gradient", "adam"]
ALL = [*BOUNDED, "augmented-lagrangian"]


def floor_scenes():
    """Convex scenes whose minimum is at the lower bound: end free, end held, band in the middle."""
    squashes = [
        (Squash(0.0, 0.5, 0.3), 3.0),
        (Squash(0.0, 0.75, 0.2, top_fixed=True), 3.0),
        (Squash(0.3, 0.6, 0.3), 9.0),
        (Squash(0.35, 0.75, 0.25, top_fixed=True), 4.0),
    ]
    u = (np.arange(64) + 0.5) / 64
    uneven = piece(1 + 0.6 * np.sin(7 * u))
    for squash, mu in squashes:
        for clay in (jaxclay.Clay.cylinder(), uneven):
            problem = jaxclay.pose(clay, squash, Material(mu=mu, alpha=0.0, beta=0.0), "paper")
            assert jaxclay.rough_shape(problem, discrete=True).floored
            yield problem


def gap(solution, best):
    return float(solution.energy - best.energy) / float(best.certificate.energy_free)


@pytest.mark.parametrize("method", BOUNDED)
def test_minimum_on_the_floor_is_the_quadratic_programs(method):
    for problem in floor_scenes():
        solution = minimize(problem, method).raise_for_status()
        np.testing.assert_allclose(
            solution.heights, oracles.discrete_minimum(problem), rtol=0, atol=2e-6
        )
        thinnest = np.min(solution.clay.thickness / problem.rest.thickness)
        assert thinnest == pytest.approx(0.05, rel=1e-9)


def test_augmented_lagrangian_says_that_it_is_slow_on_the_floor():
    for problem in floor_scenes():
        solution = minimize(problem, "augmented-lagrangian", max_iterations=5000)
        assert solution.status is Status.ITERATION_LIMIT
        assert 1e-9 < gap(solution, minimize(problem)) < 0.5


@pytest.mark.parametrize("method", ALL)
def test_snake_units_end_at_the_certified_minimum(method):
    held = Squash(0.4, 0.6, 0.4, top_fixed=True)
    for squash in (REFERENCE, MIDDLE, held, Squash(0.0, 0.3, 0.6)):
        problem = cylinder_problem(squash, SNAKE)
        best = minimize(problem).raise_for_status()
        solution = minimize(problem, method).raise_for_status()
        assert abs(gap(solution, best)) < 1e-12
        np.testing.assert_allclose(solution.heights, best.heights, rtol=0, atol=1e-6)


@pytest.mark.parametrize("method", ALL)
def test_without_friction_or_anything_to_move(method):
    slippery = cylinder_problem(MIDDLE, Material(mu=0.0, alpha=0.0, beta=0.0))
    solution = minimize(slippery, method).raise_for_status()
    expected = oracles.discrete_minimum(slippery)
    np.testing.assert_allclose(solution.heights, expected, rtol=0, atol=1e-6)
    swallowed = minimize(cylinder_problem(Squash(0.0, 1.7, 0.4), SNAKE), method)
    assert swallowed.raise_for_status().iterations == 0


@pytest.mark.parametrize("method", ALL)
def test_the_unit_of_energy_does_not_matter(method):
    stiff = cylinder_problem(MIDDLE, Material.from_snake_units(1e6, 1e6, 1e6, 1e6))
    solution = minimize(stiff, method).raise_for_status()
    best = minimize(cylinder_problem(MIDDLE, SNAKE))
    np.testing.assert_allclose(solution.heights, best.heights, rtol=0, atol=1e-6)


@pytest.mark.parametrize("method", ALL)
def test_any_answer_obeys_floor_and_tool_and_is_certified(method):
    for problem in [*population_problems(12, seed=4), *floor_scenes()]:
        best = minimize(problem).raise_for_status()
        for limit in (1, 7, 400):
            solution = minimize(problem, method, max_iterations=limit)
            assert solution.iterations <= limit
            slack = solution.clay.thickness / problem.rest.thickness - 0.05
            assert slack[np.asarray(problem.loose)].min() > -1e-12
            held = np.asarray(problem.fixed)
            wanted = (problem.rest.heights + problem.shift) * problem.clay.unit
            np.testing.assert_allclose(solution.heights[held], wanted[held], rtol=1e-14)
            converged = solution.status is Status.CONVERGED
            assert converged == bool(solution.certificate.accepted)
            assert gap(solution, best) > -1e-10
            if converged:
                assert gap(solution, best) < 1e-9


def test_printed_constants_take_thousands_of_iterations_and_unfinished_runs_say_so():
    problem = cylinder_problem(REFERENCE, PRINTED)
    best = minimize(problem)
    for method in ALL:
        early = minimize(problem, method, max_iterations=1500)
        assert early.status is Status.ITERATION_LIMIT, method
        assert gap(early, best) > 1e-4, method
    assert gap(minimize(problem, "lbfgsb").raise_for_status(), best) < 1e-11
    slow = minimize(problem, "projected-gradient")
    assert slow.iterations > 5000
    assert gap(slow, best) < 1e-8
    adam = minimize(problem, "adam")
    assert adam.status is Status.ITERATION_LIMIT
    assert 1e-3 < gap(adam, best) < 1


def test_eliminating_the_radii_pays_in_snake_units_but_not_with_printed_constants():
    soft, stiff = (cylinder_problem(REFERENCE, material) for material in (SNAKE, PRINTED))
    both = minimize(soft, "augmented-lagrangian").raise_for_status()
    assert both.iterations > 2 * minimize(soft, "lbfgs").raise_for_status().iterations
    both = minimize(stiff, "augmented-lagrangian").raise_for_status()
    assert abs(gap(both, minimize(stiff))) < 1e-11
    heights_only = minimize(stiff, "lbfgs", max_iterations=int(both.iterations))
    assert heights_only.status is not Status.CONVERGED
    assert gap(heights_only, minimize(stiff)) > 1e-3


def test_projection_is_the_nearest_shape_above_the_floor_with_held_ends():
    from jaxclay.methods.thickness import Segments, Simplex

    rng = np.random.default_rng(0)
    number, ends = np.repeat([1, 2, 3, 4], [5, 1, 7, 3]), np.array([5, 6, 13])
    weight, least = rng.uniform(0.2, 3, 16), -rng.uniform(0, 1, 16)
    allowed = Simplex(least, weight, Segments(number, number < 4))
    for size in (0.1, 1.0, 10.0):
        x = rng.normal(size=16) * size
        nearest = np.asarray(allowed.nearest(x))
        for part in np.split(np.arange(16), ends)[:-1]:
            w, low, here = weight[part], least[part], x[part]

            def moved(m, w=w, low=low, here=here):
                return np.maximum(low, here - m * w)

            m = optimize.brentq(lambda m, w=w, moved=moved: w @ moved(m), -1e3, 1e3, xtol=1e-15)
            np.testing.assert_allclose(nearest[part], moved(m), rtol=0, atol=1e-5)
        np.testing.assert_allclose(nearest[13:], np.maximum(x, least)[13:], rtol=1e-6)


@pytest.mark.parametrize(
    ("method", "settings", "message"),
    [
        ("lbfgsb", {"tolerance": 0.0}, "tolerance must be between .*, got 0"),
        ("projected-gradient", {"max_iterations": 0}, "max_iterations must be at least 1, got 0"),
        ("projected-gradient", {"step": 0.1}, "projected-gradient has no setting 'step'"),
        ("augmented-lagrangian", {"tolerance": "tight"}, "tolerance must be a number, got 'tight'"),
        ("adam", {"step": 0.0}, "step must be between 1e-06 and 1, got 0"),
        ("adam", {"step": float("nan")}, "step must be between 1e-06 and 1, got nan"),
    ],
)
def test_bad_settings_are_named(method, settings, message):
    with pytest.raises(ValueError, match=message):
        minimize(cylinder_problem(REFERENCE, SNAKE), method, **settings)
