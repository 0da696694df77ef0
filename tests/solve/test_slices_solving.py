"""Solving on second-order slices: every method, every status, units, starts, batches."""

import jax
import numpy as np
import pytest
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE, compilations

from jaxclay import (
    METHODS,
    Clay,
    Material,
    Squash,
    Status,
    contour_error,
    deform,
    minimize,
    minimize_batch,
    pose,
)

N = 24
COUNTS = {"one-sided": (REFERENCE, (0, 6, 18)), "two-sided": (MIDDLE, (9, 5, 10))}
EXACT = ("newton", "lbfgs-preconditioned", "augmented-lagrangian", "projected-gradient")


def posed(name, material=SNAKE, spacing="equal"):
    squash, counts = COUNTS[name]
    return pose(Clay.cylinder(), squash, material, slices=counts, spacing=spacing)


def gap(solution, best):
    return float(solution.energy - best.energy) / float(best.certificate.energy_free)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_runs(method):
    for name in COUNTS:
        problem = posed(name)
        best = minimize(problem).raise_for_status()
        solution = minimize(problem, method)
        assert solution.problem.scheme == "slices"
        assert np.isfinite(solution.heights).all()
        assert (np.diff(solution.heights) > 0).all()
        assert (solution.status is Status.CONVERGED) == bool(solution.certificate.accepted)
        assert gap(solution, best) > -1e-10
        if method in EXACT:
            assert solution.status is Status.CONVERGED, solution.message
            assert abs(gap(solution, best)) < 1e-9
            np.testing.assert_allclose(solution.heights, best.heights, atol=1e-6)
        if method == "greedy-refined":
            assert gap(solution, best) < 1e-5
        held = np.asarray(problem.fixed)
        at = (problem.rest.heights + problem.shift)[held]
        np.testing.assert_allclose(solution.heights[held], at, rtol=0, atol=1e-15)


def test_a_small_enough_answer_is_the_same_by_deform():
    """Placed nodes come from newton's answers, whatever the method."""
    for method in ("newton", "lbfgs-preconditioned"):
        answer = deform(Clay.cylinder(), MIDDLE, SNAKE, method, slices=N).raise_for_status()
        again = minimize(answer.problem).raise_for_status()
        assert abs(gap(answer, again)) < 1e-9
        newton = deform(Clay.cylinder(), MIDDLE, SNAKE, slices=N)
        np.testing.assert_array_equal(answer.problem.rest.material, newton.problem.rest.material)


def test_each_status_has_its_scene():
    cylinder = Clay.cylinder()
    crushed = Squash(0, 0.99, 0.4, top_fixed=True)
    found = {
        "converged": deform(cylinder, MIDDLE, SNAKE, slices=N),
        "stalled": minimize(pose(cylinder, MIDDLE, PRINTED, slices=N), "greedy"),
        "iteration limit": deform(cylinder, MIDDLE, SNAKE, slices=N, max_iterations=1),
        "non-finite": deform(cylinder, MIDDLE, Material(alpha=1e308), slices=N),
        "infeasible": deform(cylinder, crushed, SNAKE, slices=N),
    }
    cures = {
        "stalled": "another method|finer step",
        "iteration limit": "raise max_iterations",
        "non-finite": "constants against the clay's size",
        "infeasible": "Lower top.*Above top are 0.01, and the clay there needs",
    }
    for name, solution in found.items():
        assert str(solution.status) == name
        assert np.isfinite(solution.heights).all()
        assert (solution.clay.thickness > 0).all()
        if name == "converged":
            assert solution.raise_for_status() is solution
        else:
            assert not solution.certificate.accepted
            with pytest.raises(RuntimeError, match=f"{name}.*({cures[name]})"):
                solution.raise_for_status()
    room, least = found["infeasible"].problem.room()
    assert room == pytest.approx(0.01)
    assert room < least


@pytest.mark.parametrize("material", [SNAKE, PRINTED], ids=["snake", "printed"])
@pytest.mark.parametrize("squash", [REFERENCE, MIDDLE])
def test_a_scene_in_other_units(squash, material):
    """Nothing depends on the length unit, where slices go included."""
    big = Squash(300 * squash.bottom, 300 * squash.top, 300 * squash.radius)
    small = deform(Clay.cylinder(), squash, material, slices=N).raise_for_status()
    scaled = deform(Clay.cylinder(150, 300, 64), big, material, slices=N).raise_for_status()
    # Nodes are placed by answers, so they agree as closely as those have converged.
    u = np.linspace(0, 1, 101)
    nodes = small.problem.rest.material
    np.testing.assert_allclose(scaled.problem.rest.material, nodes, rtol=0, atol=1e-6)
    np.testing.assert_allclose(
        scaled.clay.height_at(u), 300 * small.clay.height_at(u), rtol=1e-8, atol=1e-8
    )
    assert scaled.energy == pytest.approx(small.energy, rel=1e-7)


def test_given_the_nodes_units_do_not_matter():
    for name, (squash, counts) in COUNTS.items():
        big = Squash(300 * squash.bottom, 300 * squash.top, 300 * squash.radius)
        small = minimize(posed(name)).raise_for_status()
        problem = pose(Clay.cylinder(150, 300, 7), big, SNAKE, slices=counts, spacing="equal")
        scaled = minimize(problem).raise_for_status()
        np.testing.assert_allclose(scaled.heights, 300 * small.heights, rtol=1e-9)
        assert scaled.energy == pytest.approx(small.energy, rel=1e-9)


def test_new_values_compile_nothing():
    log = compilations()
    clay = deform(Clay.cylinder(), MIDDLE, SNAKE, slices=32).clay
    log.clear()
    cone = Clay.from_profile([0, 1], [1, 2], 17)
    scenes = [
        (Clay.cylinder(), REFERENCE, SNAKE),
        (Clay.cylinder(1, 2, 9), Squash(0.3, 0.9, 0.9), Material(2, 0.5, 0.1, 0.01)),
        (cone, Squash(0, 0.4, 1.2, True), Material.from_snake_units(mu=1)),
        (cone, Squash(0.2, 0.5, 1.6), Material(mu=0.0, alpha=0.0, beta=0.0)),
        (clay, Squash(0.1, 0.4, 0.45), PRINTED),
        (clay, Squash(0.8, 3.0, np.float32(0.45)), Material(k=1, mu=2, floor=0.1)),
        (clay, Squash(0, 1, 0.3, False), SNAKE),
    ]
    for squashed, squash, material in scenes:
        for spacing in ("placed", "equal"):
            deform(squashed, squash, material, slices=32, spacing=spacing)
    deform(Clay.cylinder(), MIDDLE, SNAKE, slices=(10, 6, 16), max_iterations=50)
    assert log == []
    deform(Clay.cylinder(), MIDDLE, SNAKE, slices=31)
    assert log  # the counter counts


def test_an_answer_close_by_as_a_start():
    for name, (squash, counts) in COUNTS.items():
        first = minimize(posed(name))
        nudged = Squash(squash.bottom, squash.top + 1e-4, squash.radius - 1e-4)
        problem = pose(Clay.cylinder(), nudged, SNAKE, slices=counts, spacing="equal")
        anew, warm = minimize(problem), minimize(problem, start=first)
        assert warm.raise_for_status().iterations < anew.raise_for_status().iterations
        np.testing.assert_allclose(warm.heights, anew.heights, rtol=0, atol=1e-7)
        again = minimize(problem, start=anew.heights).raise_for_status()
        np.testing.assert_allclose(again.heights, anew.heights, rtol=0, atol=1e-7)


def test_a_batch_of_posed_problems():
    squashes = [Squash(0.3, 0.5, 0.42), MIDDLE, Squash(0.2, 0.6, 0.45), Squash(0.4, 0.6, 0.55)]
    problems = [pose(Clay.cylinder(), squash, SNAKE, slices=(9, 5, 10)) for squash in squashes]
    stacked = jax.tree.map(lambda *leaves: np.stack(leaves), *problems)

    def answer(problem):
        solution = minimize(problem)
        return solution.heights, solution.energy, solution.status_code

    with jax.enable_x64(True):
        heights, energies, codes = jax.tree.map(np.asarray, jax.jit(jax.vmap(answer))(stacked))
    assert (codes == Status.CONVERGED).all()
    for i, problem in enumerate(problems):
        alone = minimize(problem)
        np.testing.assert_allclose(heights[i], alone.heights, rtol=0, atol=1e-8)
        assert energies[i] == pytest.approx(float(alone.energy), rel=1e-10)


def test_the_edges_of_earlier_tools_stay_whichever_way_a_squash_is_solved():
    grippy = Material(mu=8.0, alpha=0.0, beta=0.0)  # nothing creeps, so the tool's edge stays
    worked = deform(Clay.cylinder(), Squash(0.5, 0.7, 0.45), grippy, slices=64).clay
    assert len(worked.edges) > 0
    squash = Squash(0.0, 0.1, 0.49)
    problem = pose(worked, squash, grippy, slices=64)
    alone = minimize(problem)
    (batch,) = minimize_batch([problem])
    assert alone.problem is problem
    for answer in (alone, batch, deform(worked, squash, grippy, slices=64)):
        np.testing.assert_array_equal(answer.before.heights, worked.heights)
        assert len(answer.clay.edges) > 2
        assert set(worked.edges[:, 0]) & set(answer.clay.edges[:, 0])


# Bottom, top and radius of sessions whose last squash leaves a node at rest among moving ones,
# where on 2,048 slices the rounding of gradients is many times what friction holds.
ROUNDED = (
    (
        (0.627622, 0.893821, 0.361102),
        (0.07057, 0.185932, 0.374647),
        (0.002173, 0.205621, 0.347523),
        (0.209939, 0.50614, 0.387755),
        (0.420263, 0.490865, 0.350695),
    ),
    (
        (0.267914, 0.52566, 0.350274),
        (0.471349, 0.736379, 0.369499),
        (0.543985, 0.784564, 0.301804),
        (0.617069, 0.810184, 0.216059),
        (0.609284, 0.821003, 0.17278),
    ),
)


@pytest.mark.parametrize("squashes", ROUNDED)
def test_rounding_on_fine_slices_is_not_taken_for_friction(squashes):
    clay = Clay.cylinder(radius=0.4)
    for squash in squashes:
        before = clay
        clay = deform(before, Squash(*squash), SNAKE, slices=2048).raise_for_status().clay
    coarser = deform(before, Squash(*squashes[-1]), SNAKE, slices=1024).raise_for_status().clay
    assert contour_error(coarser, clay) < 1e-4
