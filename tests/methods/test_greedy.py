import numpy as np
import oracles
import pytest
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE, cylinder_problem, wavy

import jaxclay
from jaxclay import Material, Squash, Status, minimize, pose, rough_shape

SOFT = Material(alpha=0.01, beta=1e-6)
SCENES = {
    "snake": (REFERENCE, SNAKE, 1e-3),
    "snake, small steps": (REFERENCE, SNAKE, 2e-4),
    "printed": (REFERENCE, PRINTED, 1e-6),
    "middle band": (MIDDLE, SNAKE, 5e-4),
    "middle band, between": (MIDDLE, SOFT, 1e-4),
    "drawing in": (Squash(0.0, 0.25, 0.55), SNAKE, 3e-4),
    "top held": (Squash(0.0, 0.3, 0.4, top_fixed=True), Material(1, 0.1, 1e-3, 1e-7), 3e-4),
    "free top": (Squash(0.0, 0.3, 0.4), Material(1, 0.1, 0.05, 1e-6), 3e-4),
}


def twin(problem, start, step, threshold, sweeps):
    constants = oracles.constants_of(problem)
    return oracles.greedy(
        start / float(problem.clay.unit),
        free=np.asarray(problem.free),
        floor=float(problem.material.floor),
        step=step,
        threshold=threshold,
        sweeps=sweeps,
        **constants,
    )


def steps_taken(problem, start, solution, step):
    exact = (solution.heights - start) / float(problem.clay.unit) / step
    steps = np.rint(exact).astype(int)
    np.testing.assert_allclose(exact, steps, atol=1e-4)  # whole steps only
    return steps


def start_of(problem):
    """The rough shape, each free node set off so that there is work and no decision is a tie."""
    heights = rough_shape(problem).heights
    noise = np.random.default_rng(7).uniform(-1, 1, len(heights)) * 2e-3
    noise = noise * float(problem.clay.unit) * np.asarray(problem.free)
    return heights + noise


def assert_same_moves(problem, start, step, threshold, sweeps):
    expected, history = twin(problem, start, step, threshold, sweeps)
    solution = minimize(
        problem, "greedy", start, step=step, threshold=threshold, max_iterations=sweeps
    )
    np.testing.assert_array_equal(steps_taken(problem, start, solution, step), expected)
    assert solution.iterations == len(history)
    stopped = history[-1] < threshold
    if solution.status is not Status.CONVERGED:
        assert solution.status is (Status.STALLED if stopped else Status.ITERATION_LIMIT)
    return expected, history


@pytest.mark.parametrize("threshold", [1, 4])
@pytest.mark.parametrize("name", SCENES)
def test_moves_are_those_of_the_plain_loop(name, threshold):
    squash, material, step = SCENES[name]
    problem = cylinder_problem(squash, material)
    moves, _ = assert_same_moves(problem, start_of(problem), step, threshold, 12)
    assert np.abs(moves).sum() > 5


@pytest.mark.parametrize("threshold", [1, 4])
@pytest.mark.parametrize("seed", [1, 2])
def test_moves_on_a_piece_with_a_history(threshold, seed):
    problem = pose(wavy(seed), MIDDLE, SNAKE, "paper")
    assert_same_moves(problem, start_of(problem), 5e-4, threshold, 12)


@pytest.mark.parametrize("threshold", [1, 4])
def test_sweeps_until_fewer_nodes_than_the_threshold_move(threshold):
    problem = cylinder_problem(REFERENCE, SNAKE)
    _, history = assert_same_moves(problem, start_of(problem), 1e-3, threshold, 400)
    assert history[-1] < threshold
    assert all(moved >= threshold for moved in history[:-1])


def test_printed_constants_stop_greedy_far_from_the_minimum():
    problem = cylinder_problem(REFERENCE, PRINTED)
    expected, history = twin(problem, rough_shape(problem).heights, 1e-2, 1, 50)
    solution = minimize(problem, "greedy", step=1e-2)
    assert not expected.any()
    assert solution.iterations == len(history) == 1
    np.testing.assert_array_equal(solution.heights, rough_shape(problem).heights)
    assert solution.status is Status.STALLED
    assert solution.energy > 1e3 * minimize(problem).energy


@pytest.mark.parametrize("step", [1e-3, 1e-4])
def test_floor_is_never_crossed(step):
    # Without smoothing the minimum lies at the lower bound, so greedy runs down onto it.
    problem = cylinder_problem(Squash(0, 0.5, 0.3), Material(mu=3.0, alpha=0.0, beta=0.0))
    minimum = rough_shape(problem, discrete=True)
    assert minimum.floored
    loose = np.asarray(problem.free)[1:]
    lift = np.random.default_rng(1).uniform(2e-4, 2e-3, 64) * loose
    start = minimum.heights + np.append(0, np.cumsum(lift))
    assert_same_moves(problem, start, step, 1, 40)
    solution = minimize(problem, "greedy", start, step=step)
    ratio = np.diff(solution.heights) / np.diff(problem.clay.heights)
    assert 0.05 * (1 - 1e-10) <= ratio.min() < 0.05 + 64 * step


def test_refined_ends_where_no_smallest_step_helps():
    problem = cylinder_problem(REFERENCE, SNAKE)
    smallest = 1e-2 / 2**10
    solution = minimize(problem, "greedy-refined", smallest_step=smallest)
    energy = float(solution.energy)
    constants = oracles.constants_of(problem)
    for node in np.flatnonzero(problem.free):
        for direction in (1, -1):
            heights = solution.heights + direction * smallest * (np.arange(65) == node)
            assert oracles.total_energy(heights, **constants) >= energy - 1e-15
    assert float(minimize(problem).energy) < energy  # no single move helps, a joint one does


def test_refined_gets_nearer_with_smaller_steps():
    problem = cylinder_problem(REFERENCE, SNAKE)
    best = float(minimize(problem).energy)
    gaps = [
        float(minimize(problem, "greedy-refined", smallest_step=s).energy) - best
        for s in (1e-3, 1e-5, 1e-7)
    ]
    assert gaps[0] > gaps[1] > gaps[2] > 0
    assert gaps[2] < 1e-6


def test_iteration_limit_is_reported():
    problem = cylinder_problem(REFERENCE, SNAKE)
    solution = minimize(problem, "greedy", step=1e-5, max_iterations=3)
    assert solution.status is Status.ITERATION_LIMIT
    assert solution.iterations == 3


def test_step_is_a_multiple_of_the_unit():
    small = cylinder_problem(REFERENCE, SNAKE)
    big = pose(jaxclay.Clay.cylinder(150, 300), Squash(0, 0.29296875 * 300, 120), SNAKE, "paper")
    one = minimize(small, "greedy", start_of(small), step=3e-4, max_iterations=12)
    other = minimize(big, "greedy", 300 * start_of(small), step=3e-4, max_iterations=12)
    np.testing.assert_allclose(other.heights, 300 * one.heights, rtol=1e-10)
