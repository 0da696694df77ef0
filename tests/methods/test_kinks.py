"""Kinks of friction and walls of infinite energy, at which line searches stop; nodes at a kink."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import REFERENCE, SNAKE, cylinder_problem, gap, solved, squash_by
from scipy import optimize

import jaxclay
from jaxclay import Clay, Material, Squash, Status, minimize, pose, rough_shape
from jaxclay.methods.loop import Outcome
from jaxclay.methods.stages import first_stage
from jaxclay.schemes.base import no_forces
from jaxclay.solve.minimize import conclude

BARE = Material(alpha=0.0, beta=0.0)
N = 64


def outside(problem, energy):
    """SciPy's L-BFGS-B on an energy (value, gradient) of the heights, certified as it stands."""
    free, heights = np.flatnonzero(problem.free), rough_shape(problem).heights.copy()

    def at(free_heights):
        heights[free] = free_heights
        value, gradient = energy(heights)
        return float(value), np.array(gradient)[free]

    options = {"maxiter": 5000, "maxfun": 50_000, "ftol": 1e-15, "gtol": 1e-12}
    result = optimize.minimize(at, heights[free], jac=True, method="L-BFGS-B", options=options)
    heights[free] = result.x
    point, none = problem.imposed(problem.point(heights)), np.asarray(0)
    forces = jax.tree.map(np.asarray, no_forces(problem))
    outcome = Outcome(point, forces, none, np.asarray(True), np.asarray(True))
    return result, conclude(problem, rough_shape(problem), outcome, "scipy")


@pytest.fixture(scope="module")
def derivative():
    """E_total and its gradient; penalised below the lower bound, at the kinks with 0."""

    def energy(problem, heights):
        point = problem.point(heights)
        kept = jnp.maximum(point.thickness, problem.floor / 2)
        below = jnp.maximum(problem.floor - point.thickness, 0.0) / problem.rest.thickness
        return problem.terms(point._replace(thickness=kept)).total + 10 * jnp.sum(below**2)

    return jax.jit(jax.value_and_grad(energy, argnums=1))


def test_an_infinite_energy_ends_a_line_search_with_success_and_is_refused(
    derivative,
):
    """The first step leaves the shapes whose heights increase."""
    problem = cylinder_problem(REFERENCE, SNAKE)

    def walled(heights):
        if (np.diff(heights) <= problem.floor).any():
            return np.inf, np.zeros_like(heights)
        return derivative(problem, heights)

    with jax.enable_x64(True):
        result, answer = outside(problem, walled)
    assert result.success
    assert result.nit <= 2
    assert answer.status is Status.STALLED
    assert not answer.certificate.accepted
    assert gap(answer, solved(problem)) > 0.01


def test_lbfgs_stops_at_a_friction_kink_and_the_certificate_refuses_it(derivative):
    problem = cylinder_problem(REFERENCE, SNAKE)
    with jax.enable_x64(True):
        result, answer = outside(problem, lambda heights: derivative(problem, heights))
    best = solved(problem)
    assert result.success
    assert answer.status is Status.STALLED
    assert answer.certificate.positive
    assert 1e-7 < gap(answer, best) < 1e-2
    # Nodes that should rest hang next to their kink.
    apart = np.abs(answer.point.shift)[np.asarray(problem.free)]
    assert (apart > 0).all()
    assert apart.min() < 1e-12


def test_lbfgs_that_ends_beside_a_kink_is_certified_by_forces_read_off():
    """The last node that moves is next to the first that rests, at high friction."""
    problem = pose(Clay.cylinder(), squash_by(0.1), Material.from_snake_units(mu=100.0), "paper")
    best, answer = solved(problem), minimize(problem, "lbfgs")
    assert answer.status is Status.CONVERGED
    assert gap(answer, best) < 1e-10


def test_the_methods_own_stages_are_finite_where_heights_decrease():
    problem = cylinder_problem(REFERENCE, SNAKE)
    rough = rough_shape(problem)
    heights = rough.heights.copy()
    heights[40] = heights[45]  # above the nodes that follow
    with jax.enable_x64(True):
        stage = first_stage(rough.point, (1e-2, 1e-6))
        energy = float(stage.energy(problem, problem.point(heights)))
    assert np.isfinite(energy)
    assert energy > float(jaxclay.total_energy(problem, rough.heights))


@pytest.mark.parametrize("moving", [1, 5, 40])
def test_a_node_that_rests_with_all_its_friction_used_up(moving):
    """In E_move alone: the tool's way is h^2 (1 + 2 + ... + m), and the next node just rests."""
    way = moving * (moving + 1) / 2 / N**2
    top = 3 / 16 + way
    problem = pose(Clay.cylinder(), Squash(0.0, top, 0.5 * (3 / 16 / top) ** 0.5), BARE, "paper")
    solution = solved(problem)
    with jax.enable_x64(True):
        force = np.abs(np.asarray(problem.system.gradient(solution.point)))[12 + moving]
    assert force * N == pytest.approx(1.0, abs=1e-5)
    assert abs(solution.point.shift[12 + moving]) < 1e-9
    exact = rough_shape(problem, discrete=True).heights
    np.testing.assert_allclose(solution.heights, exact, atol=1e-9)


def test_friction_at_which_a_node_begins_to_rest():
    """Bisected to the last bit; newton is certified all the way."""

    def moving(mu):
        solution = solved(cylinder_problem(REFERENCE, Material.from_snake_units(mu=mu)))
        return (solution.point.shift != 0).sum(), solution

    low, high = 1.0, 1.2
    (most, _), (fewest, _) = moving(low), moving(high)
    assert fewest < most
    while (low + high) / 2 not in (low, high):
        middle = (low + high) / 2
        low, high = (middle, high) if moving(middle)[0] == most else (low, middle)
    count, solution = moving(high)
    problem = solution.problem
    rests = np.asarray(problem.free) & (solution.point.shift == 0)
    with jax.enable_x64(True):
        force = np.abs(np.asarray(problem.system.gradient(solution.point)))[rests]
    assert count < most
    assert force.max() * N / high == pytest.approx(1.0, abs=1e-3)
