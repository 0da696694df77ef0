"""Each kind of failure in its smallest scene: what is reported, and what ``newton`` answers."""

import re

import jax
import numpy as np
import pytest
from scenes import PRINTED, REFERENCE, SNAKE, cylinder_problem, gap, solved, squash_by

from jaxclay import Clay, Material, Squash, Status, deform, minimize, pose, rough_shape
from jaxclay.experiments import contestants as single
from jaxclay.methods.loop import initial_guess, solve
from jaxclay.solve.minimize import conclude, method_settings

BARE = Material(alpha=0.0, beta=0.0)
N = 64


# The sliced cylinder model past 2|d|mu/k = 1


@pytest.mark.parametrize("past", [0.8, 0.98, 1.1])
def test_the_rough_shape_past_its_limit_is_on_the_floor_and_says_so(past):
    for material in (Material(mu=4.0, alpha=0.0, beta=0.0), Material.from_snake_units(mu=4.0)):
        problem = pose(Clay.cylinder(), squash_by(past / (2 * 4.0)), material, "paper")
        rough = rough_shape(problem)
        assert rough.case == "I"
        # Without a floor the slope at the band's edge would be 1 - sigma.
        assert rough.sigma == pytest.approx(past**0.5, rel=0.05)
        assert rough.floored == (rough.sigma > 1 - material.floor)
        assert rough.point.thickness.min() >= 0.05 / N - 1e-15
        solved(problem)


def test_a_squash_far_past_the_limit_is_solved_with_slices_on_the_floor():
    problem = pose(Clay.cylinder(), squash_by(0.4), Material.from_snake_units(mu=1000.0), "paper")
    assert solved(problem).certificate.on_floor > 10


def test_preconditioned_lbfgs_breaks_down_on_the_floor_and_says_so():
    problem = pose(Clay.cylinder(), squash_by(0.2), Material.from_snake_units(mu=30.0), "paper")
    best = solved(problem)
    broken = minimize(problem, "lbfgs-preconditioned")
    assert broken.status in (Status.NON_FINITE, Status.STALLED)  # which, is a matter of rounding
    assert np.isfinite(broken.heights).all()
    # Where it ends is rounding's matter too: 2.2 and 3e-4 with two settings of one BLAS.
    assert gap(broken, best) > 1e-5


# Greedy stuck by stiffness


def test_greedy_is_stuck_by_stiffness():
    """No node can gain alone: neighbours 1e-3 apart cost thousands times E_free."""
    problem = cylinder_problem(REFERENCE, PRINTED)
    best, stuck = solved(problem), minimize(problem, "greedy", step=1e-3)
    assert stuck.status is Status.STALLED
    assert stuck.iterations <= 2
    assert np.abs(stuck.heights - stuck.rough.heights).max() < 1.01e-3
    assert gap(stuck, best) > 1e3


def test_greedy_with_a_step_a_thousand_times_finer_only_creeps():
    problem = cylinder_problem(REFERENCE, PRINTED)
    slow = minimize(problem, "greedy", step=1e-6)
    assert slow.status is Status.ITERATION_LIMIT
    assert gap(slow, solved(problem)) > 100


# float32


def test_float32_is_refused_inside_a_transformation():
    problem = cylinder_problem(REFERENCE, SNAKE)
    with jax.enable_x64(False), pytest.raises(TypeError, match="float32, which cannot resolve"):
        jax.jit(lambda p: minimize(p).energy)(problem)


def test_float32_cannot_see_a_minimum_on_a_fine_grid():
    """The certificate, and every method with it, looks for a curvature below its rounding."""
    best = solved(cylinder_problem(REFERENCE, PRINTED, slices=128))
    seen = single.rounding_at(best)
    assert np.isinf(seen.decrement)
    assert seen.gradient > 100  # times all that friction and strain could balance
    assert seen.energy < 1e-5  # though the energy itself looks good


def test_newton_in_float32_is_refused_by_the_certificate():
    problem = cylinder_problem(REFERENCE, PRINTED)
    rough, settings = rough_shape(problem), method_settings("newton", {})
    with jax.enable_x64(False):
        arguments = single.rounded(
            (problem, initial_guess(problem, rough.point), settings, rough.feasible)
        )
        outcome = jax.tree.map(np.asarray, solve(*arguments, method="newton"))
    answer = conclude(problem, rough, single.widened(problem, outcome), "newton")
    assert answer.status in (Status.STALLED, Status.ITERATION_LIMIT)
    assert gap(answer, solved(problem)) > 1e-9


# What the model does, though one may not expect it


def in_steps(count, material):
    """The reference squash in so many steps that hold the same clay: statuses, last clay."""
    clay, found = Clay.cylinder(), []
    for radius in np.linspace(0.5, 0.4, count + 1)[1:]:
        solution = deform(
            clay, Squash(0.0, 3 / 16 * 0.25 / radius**2, radius), material, scheme="paper"
        )
        clay = solution.clay
        found.append(solution.status)
    return set(found), clay


@pytest.mark.parametrize(("material", "moved"), [(SNAKE, 0.039), (BARE, 0.047), (PRINTED, 0.0127)])
def test_a_hundred_small_squashes_are_not_one_big_squash(material, moved):
    """Strain is measured from the last shape, and so forgotten: the pile sharpens."""
    (one_found, one), (many_found, many) = (in_steps(n, material) for n in (1, 100))
    assert one_found == many_found == {Status.CONVERGED}
    np.testing.assert_allclose(one.heights[:13], many.heights[:13], atol=1e-12)
    assert np.abs(one.heights - many.heights).max() == pytest.approx(moved, rel=0.02)
    if material is not PRINTED:
        assert many.radii.max() > 1.3 * one.radii.max()
        assert (many.heights > np.arange(N + 1) / N).sum() < (
            one.heights > np.arange(N + 1) / N
        ).sum()


def test_a_material_that_slumps_lowers_its_free_top_below_the_next_band():
    """alpha > 0 pulls a free top down; pose then says that the clay is not there."""
    slumping = Material(alpha=1.0, beta=0.0)
    hardly = deform(Clay.cylinder(), Squash(0.0, 0.1, 0.5 - 1e-9), slumping, scheme="paper")
    assert hardly.status is Status.CONVERGED
    assert hardly.clay.height == pytest.approx(0.687, abs=1e-3)
    message = r"starts at bottom = 0\.75, above the clay: .* below its height 0\.687"
    with pytest.raises(ValueError, match=message):
        pose(hardly.clay, Squash(0.75, 0.9, 0.4), slumping, "paper")


# What is refused, with its reason


def test_a_band_too_thin_for_the_grid_is_refused_with_the_slices_it_needs():
    with pytest.raises(ValueError, match=r"imposes no radius: use at least 200 slices"):
        pose(Clay.cylinder(), squash_by(0.59), SNAKE, "paper")


def test_a_held_end_without_room_is_refused_with_the_room_it_needs():
    solution = minimize(cylinder_problem(Squash(0, 0.99, 0.4, top_fixed=True), SNAKE))
    assert solution.status is Status.INFEASIBLE
    assert re.search(r"Above top are 0\.01, and the clay there needs 0\.0\d+", solution.message)


@pytest.mark.slow
def test_more_slices_than_float64_resolves_are_refused_with_the_largest_number():
    refused = minimize(cylinder_problem(REFERENCE, PRINTED, slices=4096))
    assert refused.status is Status.UNRESOLVED
    assert not refused.certificate.accepted
    found = re.search(
        r"cannot resolve the bending term.* Use at most (\d+) slices", refused.message
    )
    assert found
    most = int(found[1])
    assert 1024 < most < 4096
    solved(cylinder_problem(REFERENCE, PRINTED, slices=most))
