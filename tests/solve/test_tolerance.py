"""As many slices as a tolerance needs, single squashes, sessions and batches of them."""

import dataclasses
import functools

import jax
import numpy as np
import pytest
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE

import jaxclay
from jaxclay import Clay, Material, Squash, Status, contour_error, deform
from jaxclay.schemes.slices.posing import place
from jaxclay.solve import refining

SCENES = [
    (Clay.cylinder(), REFERENCE, SNAKE),
    (Clay.cylinder(), MIDDLE, SNAKE),
    (Clay.cylinder(0.3), Squash(0.2, 0.5, 0.25, top_fixed=True), SNAKE),
    (Clay.cylinder(), MIDDLE, PRINTED),
    (Clay.cylinder(), Squash(0.0, 0.3, 0.55), Material(alpha=0.1, beta=1e-4)),
]


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4])
def test_the_contour_is_as_near_as_asked_and_the_estimate_says_how_near(tolerance):
    for clay, squash, material in SCENES:
        answer = deform(clay, squash, material, tolerance=tolerance).raise_for_status()
        exact = deform(clay, squash, material, slices=1024).raise_for_status()
        error = contour_error(answer.clay, exact.clay)
        assert error <= tolerance
        assert answer.error_estimate <= tolerance
        assert 0.2 < answer.error_estimate / error < 5
        assert answer.clay.slices in refining.SIZES
        assert len(answer.levels) == np.log2(answer.clay.slices / 32)


def test_a_coarser_tolerance_takes_fewer_slices():
    counts = [deform(*SCENES[1], tolerance=tol).clay.slices for tol in (1e-2, 1e-3, 1e-4)]
    assert counts == sorted(counts)
    assert counts[0] < counts[-1]


def test_clay_cut_too_coarsely_for_the_tolerance_is_seen():
    """A narrow groove of fine clay: an answer that does not see it would be far off."""
    y = np.linspace(0, 1, 2001)
    groove = 0.4 - 0.1 * np.exp(-(((y - 0.9) / 0.01) ** 2))
    clay = Clay.from_profile(y, groove, slices=512)
    answer = deform(clay, Squash(0.1, 0.3, 0.35), SNAKE, tolerance=1e-3).raise_for_status()
    exact = deform(clay, Squash(0.1, 0.3, 0.35), SNAKE, slices=1024).raise_for_status()
    assert contour_error(answer.clay, exact.clay) <= 1e-3


def test_out_of_slices_the_answer_says_what_it_reached(monkeypatch):
    assert tuple(32 << i for i in range(8)) == refining.SIZES
    coarse = functools.partial(refining.to_tolerance, sizes=(32, 64))
    monkeypatch.setattr("jaxclay.solve.minimize.to_tolerance", coarse)
    answer = deform(*SCENES[1], tolerance=1e-6)
    assert answer.status is Status.UNRESOLVED
    assert answer.certificate.accepted
    told = float(answer.message.split("tolerance of ")[1].split(",")[0])
    assert answer.problem.slices <= 64
    assert told >= answer.error_estimate
    with pytest.raises(RuntimeError, match="unresolved"):
        answer.raise_for_status()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"scheme": "paper"}, "give slices"),
        ({"scheme": "spline"}, "give elements"),
        ({"slices": 64}, "slices=64 or a tolerance"),
        ({"spacing": "equal"}, "spacing='equal' or a tolerance"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": 2.0}, "tolerance"),
        ({"tolerance": float("nan")}, "tolerance"),
        ({"method": "newtn"}, "unknown method"),
    ],
)
def test_what_does_not_go_with_a_tolerance_is_refused(arguments, words):
    with pytest.raises(ValueError, match=words):
        deform(*SCENES[0], **{"tolerance": 1e-3} | arguments)


def test_inside_a_transformation_slices_are_asked_for():
    def height(radius):
        squash = Squash(0.0, 0.3, radius)
        return deform(Clay.cylinder(), squash, SNAKE, tolerance=1e-3).clay.height

    with jax.enable_x64(True), pytest.raises(ValueError, match="slices=128"):
        jax.grad(height)(0.4)


def test_another_method_solves_the_problem_that_newton_placed():
    newton = deform(*SCENES[1], tolerance=1e-3)
    other = deform(*SCENES[1], "lbfgs-preconditioned", tolerance=1e-3)
    assert other.method == "lbfgs-preconditioned"
    assert other.error_estimate == newton.error_estimate
    np.testing.assert_array_equal(other.clay.material, newton.clay.material)
    np.testing.assert_allclose(other.heights, newton.heights, atol=1e-6)


@pytest.mark.slow
def test_a_session_ends_within_two_tolerances():
    rng = np.random.default_rng(5)
    clay = exact = Clay.cylinder(0.4)
    for _ in range(10):
        tall = rng.uniform(0.05, 0.3)
        bottom = rng.uniform(0.0, float(exact.height) - tall)
        radius = float(exact.radius_at(bottom + tall / 2)) * rng.uniform(0.7, 0.95)
        squash = Squash(bottom, bottom + tall, radius)
        answer = deform(clay, squash, SNAKE, tolerance=1e-3).raise_for_status()
        assert answer.clay.volume == pytest.approx(Clay.cylinder(0.4).volume, rel=1e-13)
        clay = answer.clay
        exact = deform(exact, squash, SNAKE, slices=1024).raise_for_status().clay
    assert contour_error(clay, exact) <= 2e-3
    assert clay.slices < 1500


def test_a_batch_answers_as_single_calls_do():
    together = jaxclay.deform_batch(SCENES, tolerance=1e-3)
    for scene, answer in zip(SCENES, together, strict=True):
        alone = deform(*scene, tolerance=1e-3)
        assert answer.status is Status.CONVERGED
        assert answer.clay.slices == alone.clay.slices
        assert answer.error_estimate == pytest.approx(alone.error_estimate, rel=1e-6)
        np.testing.assert_allclose(answer.heights, alone.heights, atol=1e-6)
    on_slices = jaxclay.deform_batch(SCENES[:2], slices=32)
    for scene, answer in zip(SCENES, on_slices, strict=False):
        np.testing.assert_allclose(answer.heights, deform(*scene, slices=32).heights, atol=1e-6)


def test_a_batch_of_posed_problems_of_several_sizes_keeps_its_order():
    problems = [jaxclay.pose(*SCENES[i % 3], slices=n) for i, n in enumerate((32, 24, 32, 32, 24))]
    answers = jaxclay.minimize_batch(problems)
    for problem, answer in zip(problems, answers, strict=True):
        alone = jaxclay.minimize(problem)
        assert answer.problem is problem
        assert answer.status is Status.CONVERGED
        np.testing.assert_allclose(answer.heights, alone.heights, atol=1e-9)
    assert jaxclay.minimize_batch([]) == []


def test_a_large_batch_answers_as_single_calls_do():
    """From rough shapes that are compiled too; one of them infeasible."""
    squashes = [Squash(0.0, 0.3, 0.35 + 0.002 * i) for i in range(70)]
    squashes[3] = Squash(0.0, 0.99, 0.4, top_fixed=True)
    problems = [jaxclay.pose(Clay.cylinder(), squash, SNAKE, slices=24) for squash in squashes]
    answers = jaxclay.minimize_batch(problems)
    assert answers[3].status is Status.INFEASIBLE
    np.testing.assert_array_equal(answers[3].heights, problems[3].clay.heights)
    for problem, answer in list(zip(problems, answers, strict=True))[::6]:
        alone = jaxclay.minimize(problem)
        assert answer.status is alone.status
        np.testing.assert_allclose(answer.heights, alone.heights, atol=1e-9)


def test_a_batch_says_which_squash_is_wrong():
    with pytest.raises(ValueError, match="tolerance or slices"):
        jaxclay.deform_batch(SCENES)
    with pytest.raises(ValueError, match="tolerance or slices"):
        jaxclay.deform_batch(SCENES, tolerance=1e-3, slices=64)
    high = (Clay.cylinder(), Squash(2.0, 2.5, 0.4), SNAKE)
    with pytest.raises(ValueError, match="bottom"):
        jaxclay.deform_batch([SCENES[0], high], tolerance=1e-3)


def test_a_squash_without_room_is_infeasible_at_once():
    held = Squash(0.0, 0.99, 0.4, top_fixed=True)
    answer = deform(Clay.cylinder(), held, SNAKE, tolerance=1e-3)
    assert answer.status is Status.INFEASIBLE
    assert answer.levels.size == 0


def test_where_finer_slices_fail_the_best_answer_before_is_told():
    """As rounding may have it on clay squeezed into a wide lip."""
    found = place(*SCENES[1])

    def solve(wanted):
        answer = jaxclay.minimize(wanted.problem, start=wanted.start)
        fails = wanted.problem.slices > 1024
        code = Status.STALLED.value if fails else answer.status_code
        return dataclasses.replace(answer, status_code=np.asarray(code))

    answer = refining.followed(refining.to_tolerance(found, 1e-8, (512, 1024, 2048)), solve)
    assert (answer.status, answer.clay.slices) == (Status.UNRESOLVED, 1024)
    exact = deform(*SCENES[1], slices=4096).raise_for_status()
    error = contour_error(answer.clay, exact.clay)
    assert 0.2 < answer.error_estimate / error < 5
    told = float(answer.message.split("tolerance of ")[1].split(",")[0])
    assert deform(*SCENES[1], tolerance=told).status is Status.CONVERGED
