import itertools
from pathlib import Path

import numpy as np
import oracles
import pytest
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE, cylinder_problem, wavy

import jaxclay
from jaxclay import Material, Squash, Status, minimize, pose, rough_shape
from jaxclay.methods.lattice import best_on_lattice, label_steps
from jaxclay.numerics.host import compiled, in_float64

SCRIPTS = Path(__file__).parents[2] / "scripts" / "benchmarks"
COARSE = Material(mu=0.5, alpha=0.02, beta=1e-4)
PLAIN = Material(alpha=0.0, beta=0.0)
FLOORED = Squash(0.0, 0.5, 0.3), Material(mu=3.0, alpha=0.0, beta=0.0)
TINY = {
    "smooth": (Squash(0.0, 0.3, 0.4), COARSE),
    "printed": (Squash(0.0, 0.3, 0.4), PRINTED),
    "no smoothing": (Squash(0.0, 0.5, 0.4), PLAIN),
    "middle band": (Squash(0.3, 0.7, 0.45), COARSE),
    "drawing in": (Squash(0.0, 0.2, 0.6), COARSE),
    "top held": (Squash(0.0, 0.3, 0.4, top_fixed=True), COARSE),
    "at the lower bound": FLOORED,
}


def start_of(problem):
    """The rough shape, its slices a little thicker so that no two contours are equally good."""
    noise = np.random.default_rng(5).uniform(0, 2e-3, problem.slices + 1)
    return rough_shape(problem).heights + np.cumsum(noise) * np.asarray(problem.free)


def every_contour(problem, start, labels, spacing):
    """All admissible contours on the lattice around a start."""
    rest, fixed = np.asarray(problem.rest.heights), np.asarray(problem.fixed)
    choices = []
    for i, height in enumerate(start):
        others = height + spacing * np.delete(np.arange(labels) - labels // 2, labels // 2)
        if 0 < abs(height - rest[i]) <= spacing * labels / 2:
            others[np.argmin(np.abs(others - rest[i]))] = rest[i]
        choices.append([height] if fixed[i] else [height, *others])
    least = np.asarray(problem.floor) * (1 - 1e-12)
    for heights in itertools.product(*choices):
        if (np.diff(heights) >= least).all():
            yield np.array(heights)


@pytest.mark.parametrize("spacing", [0.1, 0.03, 0.004])
@pytest.mark.parametrize("name", TINY)
def test_no_contour_on_the_lattice_is_better(name, spacing):
    problem = cylinder_problem(*TINY[name], slices=6)
    start = start_of(problem)
    constants = oracles.constants_of(problem)
    contours = list(every_contour(problem, start, 3, spacing))
    energies = [oracles.total_energy(heights, **constants) for heights in contours]
    once = {"labels": 3, "spacing": spacing, "smallest_spacing": spacing, "max_iterations": 1}
    found = minimize(problem, "lattice", start, **once)
    assert found.energy == pytest.approx(min(energies), rel=1e-12)
    np.testing.assert_allclose(found.heights, contours[np.argmin(energies)], atol=1e-13)
    assert min(energies) < oracles.total_energy(start, **constants)


@compiled()
def best(problem, heights, spacing):
    point = problem.imposed(problem.point(heights))
    move, energy = best_on_lattice(problem, point, label_steps(problem, point, spacing, 7))
    return heights + move * problem.clay.unit, energy


@pytest.mark.parametrize("spacing", [1e-2, 1e-4, 1e-7])
def test_its_least_value_is_the_energy_of_its_contour(spacing):
    problems = [cylinder_problem(REFERENCE, SNAKE), cylinder_problem(MIDDLE, PRINTED)]
    problems += [cylinder_problem(*FLOORED), pose(wavy(1), MIDDLE, SNAKE, "paper")]
    big = jaxclay.Clay.cylinder(150, 300), Squash(0, 90, 120, top_fixed=True)
    for problem in [*problems, pose(*big, Material(mu=0.1), scheme="paper")]:
        heights, energy = in_float64("best", best, problem, rough_shape(problem).heights, spacing)
        assert energy == pytest.approx(jaxclay.total_energy(problem, heights), rel=1e-10)
        start = jaxclay.total_energy(problem, rough_shape(problem).heights)
        assert energy <= start * (1 + 1e-12)


def test_ends_where_no_contour_on_the_last_lattice_is_better():
    problem = cylinder_problem(REFERENCE, SNAKE)
    coarse = minimize(problem, "lattice", smallest_spacing=1e-3)
    assert coarse.status is Status.STALLED
    spacing = 1e-2 / 2**3  # the last one not below 1e-3
    again = minimize(problem, "lattice", coarse.heights, spacing=spacing, smallest_spacing=spacing)
    assert again.iterations == 1
    np.testing.assert_array_equal(again.heights, coarse.heights)
    finer = minimize(problem, "lattice", coarse.heights, spacing=spacing, smallest_spacing=1e-4)
    assert finer.energy < coarse.energy


@pytest.mark.parametrize("material", [SNAKE, Material.from_snake_units(mu=0.1)])
@pytest.mark.parametrize("squash", [REFERENCE, MIDDLE, Squash(0.0, 0.25, 0.55)])
def test_ends_at_the_certified_minimum_in_snake_units(squash, material):
    problem = cylinder_problem(squash, material)
    newton = minimize(problem).raise_for_status()
    lattice = minimize(problem, "lattice").raise_for_status()
    np.testing.assert_allclose(lattice.heights, newton.heights, rtol=0, atol=1e-6)
    gap = float(lattice.energy - newton.energy)
    assert -1e-15 <= gap <= 1e-10 * float(newton.certificate.energy_free)


def test_goes_on_from_where_no_node_gains_by_itself():
    """Greedy's end with the printed constants: there, too, nodes gain together."""
    problem = cylinder_problem(REFERENCE, PRINTED)
    greedy = minimize(problem, "greedy", step=1e-4)
    joint = minimize(problem, "lattice", greedy.heights, spacing=1e-4, smallest_spacing=1e-4)
    assert joint.energy < 0.9 * greedy.energy


@pytest.mark.parametrize("squash", [REFERENCE, MIDDLE, Squash(0.0, 0.25, 0.55)])
def test_rests_exactly_where_newton_rests_without_smoothing(squash):
    problem = cylinder_problem(squash, PLAIN)
    newton = minimize(problem).raise_for_status()
    lattice = minimize(problem, "lattice")
    rest = problem.clay.heights
    np.testing.assert_array_equal(lattice.heights == rest, newton.heights == rest)
    assert 2 < np.sum(newton.heights == rest) < np.sum(problem.free)


def test_never_below_the_floor():
    problem = cylinder_problem(*FLOORED)
    minimum = rough_shape(problem, discrete=True)
    assert minimum.floored
    for limit in (1, 3, 10, 500):
        solution = minimize(problem, "lattice", max_iterations=limit)
        ratio = np.diff(solution.heights) / np.diff(problem.clay.heights)
        assert ratio.min() >= 0.05 * (1 - 1e-10)
    np.testing.assert_allclose(solution.heights, minimum.heights, atol=1e-6)


def test_energy_never_rises_and_stopping_early_is_reported():
    for material in (SNAKE, PRINTED):
        problem = cylinder_problem(REFERENCE, material)
        answers = [minimize(problem, "lattice", max_iterations=j) for j in range(1, 21)]
        energies = [jaxclay.total_energy(problem, rough_shape(problem).heights)]
        energies += [answer.energy for answer in answers]
        assert (np.diff(energies) <= 0).all()
        assert energies[-1] < energies[5] < energies[0]
        assert {answer.status for answer in answers} == {Status.ITERATION_LIMIT}
        assert [int(answer.iterations) for answer in answers] == list(range(1, 21))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"labels": 8}, "labels must be an odd number from 3 to 15, got 8"),
        ({"labels": 1}, "labels must be an odd number from 3 to 15, got 1"),
        ({"labels": 17}, "labels must be an odd number from 3 to 15, got 17"),
        ({"labels": 7.0}, "labels must be an odd number from 3 to 15, got 7.0"),
        ({"spacing": 0.0}, "spacing must be between .*, got 0"),
        ({"spacing": -1e-3}, "spacing must be between .*, got -0.001"),
        ({"smallest_spacing": 0.1}, "smallest_spacing must be between .* and 0.01, got 0.1"),
        ({"max_iterations": 0}, "max_iterations must be at least 1, got 0"),
    ],
)
def test_bad_settings_are_named(settings, message):
    with pytest.raises(ValueError, match=message):
        minimize(cylinder_problem(REFERENCE, SNAKE), "lattice", **settings)


def test_the_search_sees_a_better_basin_and_finds_none_around_a_minimum(monkeypatch):
    monkeypatch.syspath_prepend(SCRIPTS)
    from lattice import search

    problem = cylinder_problem(REFERENCE, SNAKE)
    minimum = search("reference", "snake", minimize(problem))
    assert minimum.verdict == "no other found"
    assert minimum.back == minimum.contours > 10
    stuck = search("reference", "snake", minimize(problem, "greedy", step=1e-2))
    assert stuck.verdict == "a better basin"
