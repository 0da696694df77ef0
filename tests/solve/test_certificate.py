import jax
import numpy as np
import oracles
import pytest
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE, cylinder_problem, population_problems

import jaxclay
from jaxclay import Material, Squash, rough_shape
from jaxclay.schemes.base import no_forces
from jaxclay.solve.certificate import certify

BARE = Material(alpha=0.0, beta=0.0)
DEEP = [
    (Squash(0, 0.5, 0.3), 3.0),
    (Squash(0, 0.9, 0.25), 4.0),
    (Squash(0, 0.5, 0.3, top_fixed=True), 3.0),
    (Squash(0, 0.75, 0.2, top_fixed=True), 3.0),
    (Squash(0.3, 0.6, 0.3), 9.0),
]

_certify = jax.jit(lambda problem, *of: certify(problem.system, *of))


def verdict_on(problem, heights):
    """The verdict on heights of which no multipliers are known."""
    with jax.enable_x64(True):
        verdict = _certify(problem, problem.point(heights), no_forces(problem))
        return jax.tree.map(np.asarray, verdict)


def nudged(problem, heights, node, size=1e-4):
    """The heights with one free node moved."""
    assert problem.free[node]
    return heights + size * (np.arange(len(heights)) == node)


def bare_problems():
    scenes = [cylinder_problem(squash, BARE) for squash in (REFERENCE, MIDDLE)]
    return scenes + population_problems(12, seed=5, smoothing=False)


def test_exact_minimum_is_accepted():
    for problem in bare_problems():
        verdict = verdict_on(problem, rough_shape(problem, discrete=True).heights)
        assert verdict.accepted
        assert verdict.positive
        assert verdict.admissible
        assert verdict.decrement <= 1e-10 * max(verdict.energy_free, 1e-3)


def test_a_nudge_of_any_kind_of_node_is_refused():
    for problem in bare_problems():
        heights = rough_shape(problem, discrete=True).heights
        free = np.flatnonzero(problem.free)
        for node in (free[0], free[len(free) // 2], free[-1]):
            for size in (1e-4, -1e-4):
                assert not verdict_on(problem, nudged(problem, heights, node, size)).accepted


@pytest.mark.parametrize(("squash", "mu"), DEEP)
def test_exact_minimum_on_the_floor_is_accepted(squash, mu):
    problem = cylinder_problem(squash, Material(mu=mu, alpha=0.0, beta=0.0))
    rough = rough_shape(problem, discrete=True)
    assert rough.floored
    slopes = np.diff(rough.heights) * 64
    verdict = verdict_on(problem, rough.heights)
    assert verdict.accepted
    on_floor = np.count_nonzero(np.isclose(slopes, 0.05, rtol=1e-9))
    assert 1 <= verdict.on_floor <= on_floor


@pytest.mark.parametrize(("squash", "mu"), DEEP)
def test_a_shape_off_the_floor_is_refused_there(squash, mu):
    problem = cylinder_problem(squash, Material(mu=mu, alpha=0.0, beta=0.0))
    heights = rough_shape(problem, discrete=True).heights
    last = np.flatnonzero(problem.free)[-1]
    higher = verdict_on(problem, nudged(problem, heights, last, 1e-4))
    assert not higher.accepted


def test_a_shape_below_the_floor_is_refused():
    problem = cylinder_problem(REFERENCE, BARE)
    heights = rough_shape(problem, discrete=True).heights.copy()
    heights[40] = heights[39] + 0.04 / 64
    verdict = verdict_on(problem, heights)
    assert not verdict.admissible
    assert not verdict.accepted


def test_decrement_bounds_the_gain_of_a_convex_energy():
    # Without smoothing the local model is the energy itself, so the bound holds from anywhere.
    rng = np.random.default_rng(0)
    for problem in bare_problems():
        best = rough_shape(problem, discrete=True).heights
        lowest = oracles.total_energy(best, **oracles.constants_of(problem))
        for size in (1e-6, 1e-4, 1e-3):
            rates = size * rng.uniform(-1, 1, 65) * np.asarray(problem.free)
            thickness = np.diff(best) + np.diff(rates)
            if (thickness < np.asarray(problem.floor)).any():
                continue
            heights = best + rates
            gain = oracles.total_energy(heights, **oracles.constants_of(problem)) - lowest
            assert gain > 0
            assert verdict_on(problem, heights).decrement >= gain * (1 - 1e-6) - 1e-14


@pytest.mark.parametrize("material", [SNAKE, PRINTED])
def test_decrement_estimates_what_a_solver_gains_near_the_minimum(material):
    solution = jaxclay.deform(jaxclay.Clay.cylinder(), REFERENCE, material, scheme="paper")
    problem = solution.problem
    lowest = float(solution.energy)
    near = nudged(problem, solution.heights, 20, 1e-6)
    gain = float(jaxclay.total_energy(problem, near)) - lowest
    verdict = verdict_on(problem, near)
    assert not verdict.accepted
    assert verdict.decrement >= gain * (1 - 1e-3)
    assert verdict.decrement <= 10 * gain


@pytest.mark.parametrize("squash", [REFERENCE, MIDDLE])
@pytest.mark.parametrize("material", [SNAKE, PRINTED])
def test_rough_shapes_are_refused(squash, material):
    problem = cylinder_problem(squash, material)
    assert not verdict_on(problem, rough_shape(problem).heights).accepted


def test_printed_rough_shape_has_no_positive_curvature():
    # A jump of radius makes the Hessian indefinite: nothing bounds what may be gained.
    verdict = verdict_on(*with_rough(cylinder_problem(REFERENCE, PRINTED)))
    assert not verdict.positive
    assert verdict.decrement == verdict.step == np.inf


def with_rough(problem):
    return problem, rough_shape(problem).heights


def test_free_energy_leaves_the_fixed_band_out():
    problem = cylinder_problem(REFERENCE, SNAKE)
    heights = rough_shape(problem).heights
    parts = oracles.energy_terms(
        heights, free=np.asarray(problem.free), **oracles.constants_of(problem)
    )
    whole = oracles.total_energy(heights, **oracles.constants_of(problem))
    energy = verdict_on(problem, heights).energy_free
    assert energy == pytest.approx(sum(parts.values()), rel=1e-9)
    assert energy < 0.6 * whole


def test_clay_rests_where_the_tool_displaces_nothing():
    still = cylinder_problem(Squash(0.0, 0.25, 0.5), BARE)
    verdict = verdict_on(still, still.clay.heights)
    assert verdict.accepted
    assert verdict.decrement == verdict.energy_free == 0
