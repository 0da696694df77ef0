"""The sums of second-order slices against a plain version of them."""

import jax
import numpy as np
import pytest
import slices_oracle as oracle
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE, wavy

import jaxclay
from jaxclay import Clay, Material, Squash, deform, pose
from jaxclay.schemes.slices.posing import place, problem_of

N = 24
MATERIALS = {
    "printed": PRINTED,
    "snake": SNAKE,
    "soft": Material(2.0, 0.3, 0.05, 1e-3),
    "no bending": Material(1.0, 0.5, 0.1, 0.0),
    "no tension": Material(1.0, 0.5, 0.0, 1e-3),
    "bare": Material(1.0, 0.5, 0.0, 0.0),
}
SQUASHES = {
    "one-sided": (REFERENCE, (0, 6, 18)),
    "two-sided": (MIDDLE, (9, 5, 10)),
    "drawing in": (Squash(0.0, 0.3, 0.6), (0, 7, 17)),
    "drawing in, two-sided": (Squash(0.3, 0.5, 0.58), (8, 4, 12)),
    "held": (Squash(0.0, 0.3, 0.4, top_fixed=True), (0, 6, 18)),
    "held, two-sided": (Squash(0.3, 0.55, 0.42, top_fixed=True), (7, 6, 11)),
    "swallowed": (Squash(0.4, 1.5, 0.45), (14, 10, 0)),
}


def worked(slices=N):
    """Clay with edges of its own and slices of unequal volume."""
    return deform(Clay.cylinder(slices=slices), Squash(0.5, 0.8, 0.43), MATERIALS["soft"]).clay


def assert_same(found, expected, rel=1e-11):
    scale = sum(expected.values())
    for name, value in expected.items():
        assert float(getattr(found, name)) == pytest.approx(value, rel=rel, abs=1e-15 * scale), name


def check_problem(problem, rng, rel=1e-11, band=1e-9, friction=1e-12):
    """``friction``: error of the band's own, which takes displacements as straight in parts."""
    scene = oracle.scene_of(problem)
    heights = oracle.random_heights(scene, rng)
    # Wrong heights in the band change nothing.
    given_heights = heights + np.where(oracle.free_nodes(scene), 0.0, rng.uniform(-0.1, 0.1))
    unit = float(problem.clay.unit)
    free = oracle.free_terms(scene, heights)
    rest = problem.before.interpolant
    own = oracle.band_terms(
        scene,
        lambda u: rest.height(u) / unit,
        lambda u: rest.slope(u) / unit,
        problem.before.material,
        heights,
    )
    with jax.enable_x64(True):
        assert_same(problem.free_terms(problem.point(given_heights * unit)), free, rel)
    for name in oracle.NAMES:
        margin = friction if name == "friction" else 1e-15
        found = float(getattr(problem.band_terms, name))
        assert found == pytest.approx(own[name], rel=band, abs=margin), name
    both = oracle.free_terms(scene, heights, everything=True)
    total = {name: both[name] + float(getattr(problem.band_terms, name)) for name in both}
    assert_same(jaxclay.energy_terms(problem, given_heights * unit), total, rel)
    energy = jaxclay.total_energy(problem, given_heights * unit)
    assert float(energy) == pytest.approx(sum(total.values()), rel=1e-12)


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("name", SQUASHES)
def test_every_sum_equals_the_plain_one(name, material):
    squash, counts = SQUASHES[name]
    rng = np.random.default_rng(len(name) + 10 * len(material))
    for spacing in ("equal", "placed"):
        problem = pose(Clay.cylinder(), squash, MATERIALS[material], slices=counts, spacing=spacing)
        assert problem.slices == N
        check_problem(problem, rng)


@pytest.mark.parametrize("name", ["one-sided", "two-sided", "held, two-sided"])
def test_every_sum_on_worked_and_wavy_clay(name):
    squash, counts = SQUASHES[name]
    rng = np.random.default_rng(1)
    for clay in (worked(), wavy(3)):
        for slices in (N, counts):
            problem = pose(clay, squash, MATERIALS["soft"], slices=slices)
            check_problem(problem, rng, band=1e-6, friction=1e-6)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6),
    bottom=st.sampled_from([0.0, 0.2, 0.45]),
    height=st.floats(0.1, 0.4),
    radius=st.floats(0.35, 0.62),
    held=st.booleans(),
    material=st.sampled_from(sorted(MATERIALS)),
)
def test_every_sum_on_random_nodes(seed, bottom, height, radius, held, material):
    """Nodes anywhere, as few as two slices on a side; units other than 1."""
    rng = np.random.default_rng(seed)
    clay = Clay.cylinder(0.5 * 7, 7.0, 8)
    squash = Squash(7 * bottom, 7 * (bottom + height), 7 * radius, top_fixed=held)
    share = radius**2 / 0.25 * height
    if bottom + share > 0.95 or (held and bottom + height > 0.9):
        return
    found = place(clay, squash, MATERIALS[material])
    if not found.band.feasible:
        return
    low, high = float(found.band.lower), float(found.band.upper)
    below = 0 if bottom == 0 else int(rng.integers(2, 8))
    under = int(rng.integers(2, 6))
    parts = [
        random_nodes(rng, a, b, n)
        for a, b, n in ((0, low, below), (low, high, under), (high, 1, N - below - under))
        if n
    ]
    nodes = np.unique(np.concatenate([[0.0], *parts]))
    assert len(nodes) == N + 1
    check_problem(problem_of(found, nodes), rng)


def random_nodes(rng, low, high, slices):
    """Ends of ``slices`` slices from low to high, the largest up to ten times the smallest."""
    width = np.cumsum(10 ** rng.uniform(-0.5, 0.5, slices))
    nodes = low + (high - low) * width / width[-1]
    nodes[-1] = high
    return nodes


@pytest.mark.parametrize("name", ["one-sided", "two-sided", "held, two-sided"])
@pytest.mark.parametrize("material", ["printed", "soft", "no bending"])
def test_the_gradient_of_total_energy(name, material):
    squash, counts = SQUASHES[name]
    problem = pose(Clay.cylinder(), squash, MATERIALS[material], slices=counts)
    scene = oracle.scene_of(problem)
    Y = oracle.random_heights(scene, np.random.default_rng(5), 0.2)
    with jax.enable_x64(True):
        found = np.array(jax.grad(lambda y: jaxclay.total_energy(problem, y))(Y))
    free = oracle.free_nodes(scene)
    expected = np.zeros(len(Y))
    for i in np.flatnonzero(free):
        step = 1e-5 * min(Y[i] - Y[i - 1], (Y[min(i + 1, N)] - Y[i]) or 1.0)
        up, down = Y.copy(), Y.copy()
        up[i] += step
        down[i] -= step
        rise = oracle.smooth_and_friction(scene, up) - oracle.smooth_and_friction(scene, down)
        expected[i] = rise / (2 * step)
    scale = abs(expected).max()
    np.testing.assert_allclose(found[free], expected[free], rtol=1e-5, atol=1e-7 * scale)
    assert (found[~free] == 0).all()


def test_neither_nodes_nor_unit_are_part_of_the_energy():
    """The same nodes in other units have the same energy."""
    small = pose(Clay.cylinder(slices=N), MIDDLE, SNAKE)
    big = pose(Clay.cylinder(150, 300, N), Squash(105, 180, 120), SNAKE)
    np.testing.assert_allclose(big.rest.material, small.rest.material, rtol=0, atol=1e-12)
    Y = oracle.random_heights(oracle.scene_of(small), np.random.default_rng(2))
    one, other = jaxclay.total_energy(small, Y), jaxclay.total_energy(big, 300 * Y)
    assert other == pytest.approx(one, rel=1e-9)
