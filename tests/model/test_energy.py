import jax
import numpy as np
import oracles
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import REFERENCE, cylinder_problem, wavy

import jaxclay
from jaxclay import Clay, Material, Squash

WEIGHTS = Material(k=2.0, mu=3.0, alpha=5.0, beta=7.0)
PARTS = {
    "strain": jaxclay.strain_energy,
    "friction": jaxclay.friction_energy,
    "tension": jaxclay.tension_energy,
    "bending": jaxclay.bending_energy,
}


def unit_piece(slices):
    """A unit cylinder of r0 = 1, for which Y_u = 1/X^2 is easy by hand."""
    return jaxclay.pose(
        Clay.cylinder(radius=1.0, slices=slices), Squash(0, 0.7, 0.9), WEIGHTS, "paper"
    )


def heights_of(radii):
    """Heights of slices with these radii when r0 = 1."""
    radii = np.array(radii)
    return np.concatenate([[0.0], np.cumsum(1 / (len(radii) * radii**2))])


# Each by hand: Y_u = 1/X^2, h = 1/n, k/2 = 1, mu = 3, alpha = 5, beta = 7.
BY_HAND = [
    (
        (2, 1, 0.5),  # Y_u = 1/4, 1, 4; Y = 0, 1/12, 5/12, 21/12; Y0 = 0, 4/12, 8/12, 12/12
        {
            "strain": ((3 / 4) ** 2 + 0 + 3**2) / 3,
            "friction": 3 * (3 / 12 + 3 / 12 + 9 / 12) / 3,
            "tension": 5 * (3**2 + 1.5**2 + 1 / 16 + 1 + 16) / 3,
            "bending": 7 * ((0.5 * 9) ** 2 + (0.75 * 3) ** 2 + (3 * 3) ** 2) / 3,
        },
    ),
    (
        (2, 1, 0.5, 1),  # Y_u = 1/4, 1, 4, 1; Y = 0, 1/16, 5/16, 21/16, 25/16; Y0 = i/4
        {
            "strain": ((3 / 4) ** 2 + 0 + 3**2 + 0) / 4,
            "friction": 3 * (3 / 16 + 3 / 16 + 9 / 16 + 9 / 16) / 4,
            "tension": 5 * (4**2 + 2**2 + 2**2 + 1 / 16 + 1 + 16 + 1) / 4,
            "bending": 7 * (8**2 + 16**2 + 3**2 + 12**2 + 12**2) / 4,
        },
    ),
    (
        (2, 1, 0.5, 1, 2),  # Y_u = 1/4, 1, 4, 1, 1/4; 20 Y = 0, 1, 5, 21, 25, 26
        {
            "strain": (2 * (3 / 4) ** 2 + 2 * 0 + 3**2) / 5,
            "friction": 3 * (3 / 20 + 3 / 20 + 9 / 20 + 9 / 20 + 6 / 20) / 5,
            "tension": 5 * (2 * 5**2 + 2 * 2.5**2 + 2 * (1 / 16 + 1) + 16) / 5,
            "bending": 7 * (2 * 12.5**2 + 25**2 + 2 * 3.75**2 + 2 * 15**2) / 5,
        },
    ),
]


@pytest.mark.parametrize(("radii", "expected"), BY_HAND)
def test_terms_by_hand(radii, expected):
    problem, heights = unit_piece(len(radii)), heights_of(radii)
    for name, function in PARTS.items():
        assert function(problem, heights) == pytest.approx(expected[name], rel=1e-13), name
    total = jaxclay.total_energy(problem, heights)
    assert total == pytest.approx(sum(expected.values()), rel=1e-13)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), size=st.floats(0.01, 0.9))
def test_terms_agree_with_loops(seed, size):
    rng = np.random.default_rng(seed)
    problem = jaxclay.pose(wavy(seed % 7), REFERENCE, WEIGHTS, "paper")
    thickness = np.diff(problem.rest.heights) * rng.uniform(1 - size, 1 + size, 64)
    heights = np.concatenate([[0], np.cumsum(thickness)])
    expected = oracles.energy_terms(heights, **oracles.constants_of(problem))
    for name, function in PARTS.items():
        assert function(problem, heights) == pytest.approx(expected[name], rel=1e-9), name


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6), middle=st.booleans())
def test_free_energy_counts_the_terms_that_change_with_a_free_node(seed, middle):
    squash = Squash(0.35, 0.6, 0.4) if middle else REFERENCE
    problem = cylinder_problem(squash, WEIGHTS)
    rng, rest = np.random.default_rng(seed), np.asarray(problem.rest.heights)
    heights = rest + np.append(0, rng.uniform(-0.004, 0.004, 64))
    expected = oracles.energy_terms(
        heights, free=np.asarray(problem.free), **oracles.constants_of(problem)
    )
    with jax.enable_x64(True):
        parts = problem.free_terms(problem.point(heights))
    for name, value in expected.items():
        assert getattr(parts, name) == pytest.approx(value, rel=1e-9), name


def test_gradient_against_central_differences():
    problem = cylinder_problem(material=WEIGHTS)
    rng = np.random.default_rng(3)
    heights = np.concatenate([[0], np.cumsum(rng.uniform(0.7, 1.3, 64) / 64)])
    with jax.enable_x64(True):
        gradient = jax.jit(jax.grad(jaxclay.total_energy, argnums=1))(problem, heights)
    scale = np.abs(gradient).max()
    constants, step = oracles.constants_of(problem), 1e-7
    for i in (1, 2, 20, 62, 63, 64):
        nudge = step * (np.arange(65) == i)
        after = oracles.total_energy(heights + nudge, **constants)
        before = oracles.total_energy(heights - nudge, **constants)
        # Rounding of an energy of 1e6 over a step of 1e-7 leaves about 1e-6 of the largest.
        assert gradient[i] == pytest.approx((after - before) / (2 * step), abs=3e-6 * scale)


def test_compiled_energy_equals_the_host_call():
    problem = cylinder_problem(material=WEIGHTS)
    heights = np.linspace(0, 1, 65) ** 1.1
    with jax.enable_x64(True):
        compiled = jax.jit(jaxclay.total_energy)(problem, heights)
    assert compiled == pytest.approx(jaxclay.total_energy(problem, heights), rel=1e-14)


def test_snake_units_weigh_raw_differences():
    material = Material.from_snake_units(alpha=2.0, beta=3.0, slices=64)
    problem = cylinder_problem(material=material)
    t = np.random.default_rng(5).uniform(0.5, 1.5, 64) / 64
    heights = np.concatenate([[0], np.cumsum(t)])
    X = 0.5 * np.sqrt(1 / (64 * t))
    tension = 2.0 / 64 * (np.sum(np.diff(X) ** 2) + np.sum(t**2))
    bending = 3.0 / 64 * (np.sum(np.diff(X, 2) ** 2) + np.sum(np.diff(t) ** 2))
    assert jaxclay.tension_energy(problem, heights) == pytest.approx(tension, rel=1e-12)
    assert jaxclay.bending_energy(problem, heights) == pytest.approx(bending, rel=1e-9)


def test_snake_units_are_one_material_on_every_grid():
    coarse = Material.from_snake_units(alpha=2.0, beta=3.0, slices=16)
    assert coarse.alpha == pytest.approx(2.0 / 16**2, rel=1e-15)
    assert coarse.beta == pytest.approx(3.0 / 16**4, rel=1e-15)


def test_host_call_computes_in_float64_whatever_it_is_given():
    problem = cylinder_problem(material=WEIGHTS)
    heights = (np.linspace(0, 1, 65) ** 1.1).astype(np.float32)
    energy = jaxclay.total_energy(problem, heights)
    expected = oracles.total_energy(heights.astype(float), **oracles.constants_of(problem))
    assert energy.dtype == np.float64
    assert energy == pytest.approx(expected, rel=1e-9)


def test_compiled_energy_follows_the_dtype_of_its_arguments():
    problem = cylinder_problem()
    heights = (np.linspace(0, 1, 65) ** 1.1).astype(np.float32)
    single = jax.tree.map(lambda a: a.astype(np.float32) if a.dtype == float else a, problem)
    with jax.enable_x64(False):
        energy = jax.jit(jaxclay.total_energy)(single, heights)
    assert energy.dtype == np.float32
    assert energy == pytest.approx(float(jaxclay.total_energy(problem, heights)), rel=1e-2)
