"""Scheme "spline": splines against SciPy's, energies against the paper's scheme, published orders.

The energy of the reference scene in the continuum, 2.55342007, is model.md's, to which
the paper's scheme tends too: test_the_papers_scheme_tends_to_the_same_energy checks it.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE
from scipy.interpolate import BSpline

import jaxclay
from jaxclay.schemes.spline import bspline
from jaxclay.solve.on_spans import rising

CONTINUUM = 2.55342007
CYLINDER, FINE = jaxclay.Clay.cylinder(), jaxclay.Clay.cylinder(slices=1024)


def minimum(squash=REFERENCE, material=PRINTED, clay=CYLINDER, **sizes):
    solution = jaxclay.minimize(jaxclay.pose(clay, squash, material, scheme="spline", **sizes))
    assert solution.status is jaxclay.Status.CONVERGED, solution.message
    return solution


@settings(max_examples=8, deadline=None)
@given(degree=st.sampled_from([3, 4, 5]), elements=st.integers(1, 9), seed=st.integers(0, 1000))
def test_samples_are_those_of_scipys_splines(degree, elements, seed):
    """Two sides, of 0.4 and of 0.3 of the clay."""
    rng, s = np.random.default_rng(seed), np.array([0.1, 0.5, 0.9])
    coefficients = rng.normal(size=(2, elements + degree))
    length = np.repeat([0.4, 0.3], elements) / elements
    with jax.enable_x64(True):
        basis = bspline.basis(jnp.asarray(length), degree, jnp.asarray(s), (0, 1, 2))
        local = bspline.local(jnp.asarray(coefficients.reshape(-1)), degree)
        values = np.asarray(jnp.einsum("sgoa,sa->sgo", basis, local))
    for side, width in enumerate((0.4, 0.3)):
        knots = np.pad(np.linspace(0, width, elements + 1), degree, mode="edge")
        spline = BSpline(knots, coefficients[side], degree)
        u = (np.arange(elements)[:, None] + s) * width / elements
        mine = values[side * elements : (side + 1) * elements]
        for order in (0, 1, 2):
            expected = spline.derivative(order)(u) if order else spline(u)
            scale = max(1.0, np.abs(expected).max())
            np.testing.assert_allclose(mine[..., order], expected, rtol=0, atol=1e-11 * scale)


@pytest.mark.parametrize(
    ("degree", "elements", "unknowns", "error"),
    [(3, 8, 8, 6.7e-3), (4, 4, 5, 1.3e-3), (5, 8, 10, 5.2e-7)],
)
def test_published_energy_errors(degree, elements, unknowns, error):
    solution = minimum(degree=degree, elements=elements)
    assert int(solution.unknowns) == unknowns
    assert float(solution.energy) - CONTINUUM == pytest.approx(error, rel=0.05)


@pytest.mark.slow
def test_the_papers_scheme_tends_to_the_same_energy():
    coarse, fine = (
        jaxclay.deform(jaxclay.Clay.cylinder(slices=n), REFERENCE, PRINTED, scheme="paper")
        for n in (256, 512)
    )
    extrapolated = 2 * float(fine.energy) - float(coarse.energy)
    assert float(minimum().energy) == pytest.approx(extrapolated, abs=3e-4)


@pytest.mark.parametrize("squash", [REFERENCE, MIDDLE, jaxclay.Squash(0.0, 0.3, 0.6)])
def test_conditions_at_the_bands_edge(squash):
    """The contour meets the band with its radius, and with bending with no slope."""
    clay = minimum(squash, clay=FINE).clay
    top, unit = float(squash.top), 1e-7
    assert clay.radius_at(top - unit) == pytest.approx(float(squash.radius), abs=1e-6)
    assert clay.radius_at(top + unit) == pytest.approx(float(squash.radius), abs=1e-6)
    for edge in (squash.bottom, squash.top):
        u = clay.material_at(edge)
        assert np.min(np.abs(clay.material - u)) < 1e-12
    # Y_u goes on across the edge without a kink: (Y_u - (r0/x0)^2) / du falls with du.
    u, slope = clay.material_at(top), (clay.r0 / float(squash.radius)) ** 2
    kinks = [(clay.interpolant.slope(u + d) - slope) / d for d in (4e-3, 1e-3)]
    assert abs(kinks[1]) < 0.5 * abs(kinks[0])


def test_what_the_spline_gives_is_no_higher_than_any_function_of_its_kind():
    """The energy is least: random changes of the coefficients raise it."""
    solution = minimum(MIDDLE, SNAKE)
    problem, best = solution.problem, float(solution.energy)
    rng = np.random.default_rng(0)
    free = np.asarray(problem.free)
    for size in (1e-3, 1e-4, 1e-5):
        change = size * rng.normal(size=free.shape) * free
        energy = jaxclay.total_energy(problem, solution.point.coefficients + change)
        assert float(energy) > best


def test_volume_and_height_of_the_answer():
    clay = minimum(MIDDLE, SNAKE).clay
    y = np.linspace(0, float(clay.height), 20_001)
    volume = np.pi * np.trapezoid(clay.radius_at(y) ** 2, y)
    assert volume == pytest.approx(float(clay.volume), rel=1e-6)


def test_a_scene_scaled_by_300_gives_300_times_the_heights_and_the_same_energy():
    small = minimum()
    big = minimum(
        jaxclay.Squash(0.0, 300 * 0.29296875, 120.0), clay=jaxclay.Clay.cylinder(150.0, 300.0)
    )
    assert float(big.energy) == pytest.approx(float(small.energy), rel=1e-9)
    np.testing.assert_allclose(
        big.clay.height_at(np.linspace(0, 1, 50)),
        300 * small.clay.height_at(np.linspace(0, 1, 50)),
        rtol=1e-9,
        atol=1e-9,
    )


@pytest.mark.slow
def test_the_answer_follows_the_tool_smoothly():
    """On the paper's scheme d(heights)/d(top) is zero between jumps; here it is right."""

    def height(top):
        squash = jaxclay.Squash(0.0, top, 0.4)
        problem = jaxclay.pose(CYLINDER, squash, PRINTED, scheme="spline")
        return jaxclay.minimize(problem).clay.height

    with jax.enable_x64(True):
        rate = float(jax.jit(jax.grad(height))(0.3))
    step = 1e-4
    slope = (float(height(0.3 + step)) - float(height(0.3 - step))) / (2 * step)
    assert rate == pytest.approx(slope, rel=1e-4)
    assert abs(rate) > 0.1


def test_no_squash_leaves_clay_that_holds_itself_where_it_is():
    squash = jaxclay.Squash(0.2, 0.5, 0.5)
    material = jaxclay.Material(alpha=0.0, beta=1e-6)
    solution = minimum(squash, material)
    np.testing.assert_allclose(solution.clay.height_at(np.linspace(0, 1, 9)), np.linspace(0, 1, 9),
                               rtol=0, atol=1e-12)  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"scheme": "spline", "tolerance": 1e-4}, 'belongs to scheme "slices".*give elements'),
        ({"scheme": "paper", "tolerance": 1e-4}, 'belongs to scheme "slices".*give slices'),
        ({"scheme": "spline", "degree": 6}, "degree must be 3, 4 or 5"),
        ({"scheme": "spline", "degree": 2}, "degree must be 3, 4 or 5"),
        ({"scheme": "spline", "elements": 0}, "elements"),
        ({"scheme": "spline", "elements": 2.5}, "elements must be a whole number"),
        ({"slices": "auto"}, "slices must be a whole number of at least 3, got 'auto'"),
        ({"scheme": "cubic"}, "choose from slices, paper, spline"),
        ({"scheme": "spline", "method": "greedy"}, "choose from newton"),
    ],
)
def test_bad_settings_get_one_clear_error(arguments, words):
    with pytest.raises(ValueError, match=words):
        jaxclay.deform(CYLINDER, REFERENCE, PRINTED, **arguments)


def test_a_shape_that_is_none_between_gauss_points_is_not_accepted():
    solution = minimum(elements=2)
    problem, coefficients = solution.problem, np.array(solution.point.coefficients)
    folded = coefficients.copy()
    folded[-2] += 1.0  # pulls the last span back below its neighbours
    with jax.enable_x64(True):
        assert rising(problem, coefficients)
        assert not rising(problem, folded)


@pytest.mark.parametrize(
    "squash",
    [REFERENCE, MIDDLE, jaxclay.Squash(0.3, 0.6, 0.55), jaxclay.Squash(0.0, 0.3, 0.4, True)],
    ids=["bottom", "middle", "drawn in", "held"],
)
def test_agreement_with_second_order_slices(squash):
    spline = minimum(squash, clay=FINE, elements=32)
    slices = jaxclay.deform(FINE, squash, PRINTED).raise_for_status()
    assert jaxclay.contour_error(spline.clay, slices.clay) < 1e-5


def test_orders_in_the_contour():
    """Twice the spans divide the error by 2^3 and more; at most what slices draw is seen."""
    clays = {e: minimum(clay=FINE, degree=5, elements=e).clay for e in (2, 4, 32)}
    errors = [jaxclay.contour_error(clays[e], clays[32]) for e in (2, 4)]
    assert errors[0] > 8 * errors[1]


def test_the_answer_can_be_squashed_again_by_every_scheme():
    clay = minimum(MIDDLE, clay=FINE, elements=32).clay
    assert clay.slices == FINE.slices
    assert sorted({*clay.edges[:, 1]}) == [float(MIDDLE.radius)]
    again = jaxclay.Squash(0.1, 0.3, 0.45)
    spline = minimum(again, clay=clay, elements=32).clay
    slices = jaxclay.deform(clay, again, PRINTED).raise_for_status().clay
    assert jaxclay.contour_error(spline, slices) < 2e-2  # the first edge lies within a span
    jaxclay.deform(clay, again, PRINTED, scheme="paper", slices=64).raise_for_status()


def test_a_band_that_takes_all_the_clay_above_it():
    squash = jaxclay.Squash(0.3, 5.0, 0.45)
    solution = minimum(squash)
    assert float(solution.problem.band.upper) == 1.0
    assert float(solution.clay.radius_at(float(solution.clay.height) - 1e-6)) == pytest.approx(0.45)


def test_a_mesh_too_coarse_to_make_a_shape_does_not_say_converged():
    snake = jaxclay.Material(mu=0.0984, alpha=3.13e-4, beta=4.04e-7)
    problem = jaxclay.pose(
        jaxclay.Clay.cylinder(radius=0.8582), jaxclay.Squash(0.1236, 0.4846, 0.5181), snake,
        scheme="spline", degree=3, elements=2,
    )  # fmt: skip
    solution = jaxclay.minimize(problem)
    assert solution.status is not jaxclay.Status.CONVERGED
    with pytest.raises(RuntimeError, match=str(solution.status)):
        solution.raise_for_status()
