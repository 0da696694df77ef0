"""``repr``: a few lines that say what a person wants to know, never the arrays."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import REFERENCE, SNAKE

from jaxclay import Clay, Squash, Status, deform, minimize, pose

HELD = Squash(0.3, 0.5, 0.4, top_fixed=True)


def parts_of(solution):
    problem = solution.problem
    return solution, problem, problem.clay, solution.clay, solution.rough, solution.certificate


def check(*objects):
    """All are short and none shows an array."""
    for obj in objects:
        text = repr(obj)
        assert text.startswith(type(obj).__name__.removeprefix("Spline")), text
        assert 2 <= len(text.splitlines()) <= 8, text
        assert len(text) <= 600, text
        assert max(map(len, text.splitlines())) <= 100, text
        assert "array(" not in text, text


@pytest.fixture(scope="module")
def middle():
    return deform(Clay.cylinder(slices=32), HELD, SNAKE, slices=32)


def test_a_solution_says_how_it_ended_and_what_it_costs(middle):
    check(*parts_of(middle))
    text = repr(middle)
    assert middle.message in text.replace("\n    ", " ")
    assert f"{float(middle.energy):.6g} = strain {float(middle.terms.strain):.4g}" in text
    assert f"decrement {float(middle.certificate.decrement):.2g} (at most " in text
    assert f"{int(middle.unknowns)} unknowns, {int(middle.iterations)} iterations" in text
    assert f"height {float(middle.clay.height):.6g}, radius 0.4 to" in text
    assert "contour within" not in text
    told = dataclasses.replace(middle, error_estimate=np.float64(3.2e-5))
    assert "contour within 3.2e-05 l" in repr(told)


def test_the_parts_of_an_answer_say_what_they_are(middle):
    problem = repr(middle.problem)
    assert 'scheme "slices": 32 slices' in problem
    assert "bottom 0.3, top 0.5, radius 0.4, upper end held" in problem
    assert "k 1, mu 1, alpha 0.0002441" in problem
    assert repr(middle.clay).startswith("Clay: 32 slices, 2 radii of edges\n")
    assert f"above it: case {middle.rough.case}, reach" in repr(middle.rough)
    assert repr(middle.certificate).startswith("Certificate: accepted\n")
    assert "positive curvature: yes, admissible: yes" in repr(middle.certificate)


@pytest.mark.parametrize("status", Status)
def test_answers_that_did_not_converge_say_why(middle, status):
    """Estimates of the error change the message, so both are looked at."""
    for estimate in (None, np.float64(2e-4)):
        end = dataclasses.replace(middle, status_code=np.int64(status), error_estimate=estimate)
        check(end)
        assert f"newton: {status}: " in repr(end)


def test_a_solve_cut_short_is_refused_and_says_so(middle):
    end = minimize(middle.problem, max_iterations=1)
    assert end.status is Status.ITERATION_LIMIT
    check(*parts_of(end))
    assert "iteration limit" in repr(end)
    assert repr(end.certificate).startswith("Certificate: refused\n")


def test_not_a_number_is_said(middle):
    def spoilt(dtype):
        return jax.tree.map(lambda leaf: np.full(np.shape(leaf), np.nan, dtype), middle.clay)

    for dtype in (np.float32, np.float64):
        check(spoilt(dtype))
        assert "height nan, radius nan" in repr(spoilt(dtype))
    halves = jax.tree.map(lambda x: np.asarray(x, np.float32), middle.clay)
    check(halves)
    assert "radius 0.4 to" in repr(halves)


def test_a_batch_is_counted_and_tracers_are_named():
    clay, seen = Clay.cylinder(slices=16), []

    def one(radius):
        answer = deform(clay, Squash(0.3, 0.5, radius), SNAKE, scheme="paper")
        seen.extend(map(repr, parts_of(answer)))
        check(*parts_of(answer))
        return answer

    with jax.enable_x64(True):
        batch = jax.jit(jax.vmap(one))(jnp.asarray([0.4, 0.45, 0.38]))
    assert "float64[]" in seen[0]
    assert "16 slices" in seen[1]
    for answers in (batch, jax.tree.map(np.asarray, batch)):
        check(*parts_of(answers))
        assert repr(answers).startswith("Solution by newton: 3 converged\n")
        assert "batch of 3, 16 slices" in repr(answers.problem)
        assert repr(answers.certificate).startswith("Certificate: 3 accepted\n")
        assert "case 3 I" in repr(answers.rough)


def test_stand_ins_for_arrays_do_no_harm(middle):
    shapes = jax.tree.map(lambda leaf: jax.ShapeDtypeStruct(np.shape(leaf), np.float32), middle)
    empty = jax.tree.map(lambda leaf: object(), middle)
    for answer in (shapes, empty):
        for obj in (answer, answer.problem, answer.problem.clay, answer.certificate):
            check(obj)


def test_a_squash_of_splines_says_what_it_is():
    clay = Clay.cylinder(slices=16)
    problem = pose(clay, REFERENCE, SNAKE, "spline", elements=8)
    check(problem)
    assert 'scheme "spline"' in repr(problem)
