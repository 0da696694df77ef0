"""Which methods know the scheme "spline", and where they end at newton's minimum."""

import numpy as np
import pytest
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE, gap

import jaxclay
from jaxclay import METHODS, Material, Squash, Status, minimize

GRADIENT = ["lbfgs", "optax-lbfgs", "lbfgs-preconditioned"]
HELD = Squash(0.0, 0.3, 0.4, top_fixed=True)


def posed(squash, material):
    clay = jaxclay.Clay.cylinder()
    return jaxclay.pose(clay, squash, material, scheme="spline", elements=8)


def agreeing(squash, material, method):
    """The method's answer, certified, with newton's energy and shape."""
    problem = posed(squash, material)
    best = minimize(problem).raise_for_status()
    solution = minimize(problem, method).raise_for_status()
    assert solution.certificate.accepted
    assert abs(gap(solution, best)) < 1e-10
    u = np.linspace(0, 1, 200)
    np.testing.assert_allclose(solution.clay.height_at(u), best.clay.height_at(u), atol=1e-6)
    return solution


@pytest.mark.parametrize("material", [SNAKE, PRINTED], ids=["snake", "printed"])
@pytest.mark.parametrize("squash", [REFERENCE, HELD], ids=["reference", "held"])
@pytest.mark.parametrize("method", GRADIENT)
def test_gradient_methods_end_at_newtons_minimum(method, squash, material):
    agreeing(squash, material, method)


@pytest.mark.parametrize("material", [SNAKE, PRINTED], ids=["snake", "printed"])
def test_preconditioned_on_both_sides_of_a_band(material):
    agreeing(MIDDLE, material, "lbfgs-preconditioned")


@pytest.mark.parametrize("method", GRADIENT)
def test_forces_at_the_minimum_are_frictions(method):
    """Full friction against the motion where clay moves, not more where it rests."""
    solution = agreeing(REFERENCE, SNAKE, method)
    limit, shift = solution.problem.friction_limit, solution.point.shift
    moves = np.abs(shift) > 1e-6
    assert 0 < moves.sum() < len(shift)
    expected = limit[moves] * np.sign(shift[moves])
    np.testing.assert_allclose(solution.forces.friction[moves], expected, rtol=1e-12)
    assert (np.abs(solution.forces.friction) <= limit).all()


def test_without_friction_there_is_nothing_to_hold():
    solution = agreeing(REFERENCE, Material.from_snake_units(mu=0.0), "lbfgs")
    assert not solution.forces.friction.any()
    assert solution.terms.friction == 0


def test_preconditioned_ends_on_the_floor():
    """Convex: no other minimum than the one at the lower bound that newton finds."""
    squash, material = Squash(0.0, 0.5, 0.3), Material(mu=2.5, alpha=0.0, beta=0.0)
    solution = agreeing(squash, material, "lbfgs-preconditioned")
    assert solution.certificate.on_floor > 0
    assert (solution.forces.floor >= 0).all()
    assert solution.forces.floor.max() > 0


@pytest.mark.parametrize("method", GRADIENT)
def test_an_early_stop_says_so(method):
    solution = minimize(posed(REFERENCE, PRINTED), method, max_iterations=5)
    assert solution.status is Status.ITERATION_LIMIT
    assert not solution.certificate.accepted


@pytest.mark.parametrize("method", [m for m in METHODS if m not in ("newton", *GRADIENT)])
def test_methods_that_move_nodes_name_those_that_know_splines(method):
    allowed = "choose from newton, lbfgs, lbfgs-preconditioned, optax-lbfgs$"
    with pytest.raises(ValueError, match=f"{method} moves nodes.*{allowed}"):
        minimize(posed(REFERENCE, SNAKE), method)
