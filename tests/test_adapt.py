"""Solving to a tolerance: meshes, the estimate of the error, one squash after another."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import population

import jaxclay
from jaxclay.band import Band
from jaxclay.schemes.spline import first_mesh, host, mesh

SIZES = st.floats(1e-3, 2.0)


@pytest.fixture(autouse=True)
def float64():
    with jax.enable_x64(True):
        yield


def band(lower, upper):
    numbers = (jnp.asarray(float(x)) for x in (lower, upper, 0.0, 0.1))
    return Band(*numbers, feasible=jnp.asarray(True))


@settings(max_examples=40, deadline=None)
@given(
    lower=st.floats(0.05, 0.5),
    width=st.floats(0.05, 0.4),
    first=st.lists(SIZES, min_size=3, max_size=3),
    fade=st.lists(SIZES, min_size=3, max_size=3),
    share=st.floats(0.0, 1.0),
)
def test_graded_spans_are_as_short_as_a_feature_asks_for(lower, width, first, fade, share):
    where = band(lower, lower + width)
    above = 1 - width - lower
    distance = np.array([0.0, share * above, above])
    both = mesh.Features(*(jnp.asarray(np.stack([leaf] * 2)) for leaf in (distance, first, fade)))
    knots = np.asarray(mesh.graded(where, both, 600, 2))
    assert (np.diff(knots) >= 0).all()
    assert (knots > 0).all()
    inner = knots[(knots > lower) & (knots < lower + above)]
    spans = np.diff(np.concatenate([[lower], inner, [lower + above]]))
    if len(inner) < 599:
        middle = np.concatenate([[lower], inner])[:, None] + spans[:, None] / 2 - lower
        density = (np.exp(-np.abs(middle - distance) / fade) / first).sum(axis=1) + 3 / above
        assert (spans * density < 1.5).all()


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10**6), times=st.integers(3, 5))
def test_knots_keep_apart_and_strong_ones_keep_their_number(seed, times):
    rng = np.random.default_rng(seed)
    where, least = band(0.3, 0.5), 0.004
    strong = rng.choice(np.append(rng.uniform(0, 0.8, 5), 0.8), 6)
    inner = np.concatenate([rng.uniform(0, 0.8, 40), strong, strong + 1e-6, [0.8] * 5])
    knots = np.asarray(first_mesh._apart(*map(jnp.asarray, (inner, strong)), where, least, times))
    places, number = np.unique(knots[knots < 0.8], return_counts=True)
    assert set(number) <= {1, times}
    assert set(places[number == times]) <= set(strong)
    assert (np.diff(np.concatenate([[0.0], places, [0.8]])) >= least - 1e-15).all()
    assert (np.abs(places - 0.3) >= least - 1e-15).all()
    lost = np.abs(inner[:, None] - np.concatenate([places, [0.0, 0.3, 0.8]])).min(axis=1)
    assert lost.max() < 2 * least  # what goes leaves a neighbour behind


def test_estimate_and_tolerance_against_many_equal_spans():
    ratios = []
    thick = (one for one in population(24, seed=3) if one[2].beta > 1e-3)  # layers, for them
    for r0, squashes, material in thick:
        clay, squash = jaxclay.Clay.cylinder(radius=r0), squashes[0]
        answer = jaxclay.deform(clay, squash, material, tolerance=1e-4).raise_for_status()
        posed = jaxclay.pose(clay, squash, material, scheme="spline", elements=60)
        truth = jaxclay.minimize(posed).raise_for_status()
        error = jaxclay.contour_error(answer.clay, truth.clay)
        assert error <= 1e-4
        assert answer.error_estimate <= 1e-4
        assert answer.iterations == answer.levels.sum()
        if error > 1e-6:
            ratios.append(answer.error_estimate / error)
    assert len(ratios) >= 6
    assert min(ratios) > 0.5
    assert max(ratios) < 10


def test_a_mesh_that_is_full_says_unresolved(monkeypatch):
    monkeypatch.setattr(host, "_SPANS", ())
    clay, squash = jaxclay.Clay.cylinder(), jaxclay.Squash(0.0, 0.3, 0.4)
    snake = jaxclay.Material.from_snake_units(1.0, 0.5, 1.0, 1.0, slices=64)
    answer = jaxclay.deform(clay, squash, snake, tolerance=1e-8)
    assert answer.status is jaxclay.Status.UNRESOLVED
    assert answer.error_estimate > 1e-8


@pytest.mark.slow
def test_a_succession_neither_blurs_nor_grows(monkeypatch):
    for name, one in (("_PIECES", (64, 64)), ("_SPANS", (192,))):
        monkeypatch.setattr(host, name, one)  # one shape for all squashes, to compile once
    rng, tolerance = np.random.default_rng(5), 1e-3
    material = jaxclay.Material(mu=0.5, alpha=1e-3, beta=1e-5)
    rough = fine = jaxclay.Clay.cylinder()
    for _ in range(40):
        height = float(rough.height)
        bottom = 0.0 if rng.random() < 0.4 else rng.uniform(0.1, 0.6) * height
        top = bottom + rng.uniform(0.1, 0.3) * height
        radius = float(rough.radius_at((bottom + top) / 2)) * rng.uniform(0.9, 1.08)
        squash = jaxclay.Squash(bottom, top, radius)
        rough = jaxclay.deform(rough, squash, material, tolerance=tolerance).clay
        fine = jaxclay.deform(fine, squash, material, tolerance=tolerance / 30).clay
        assert rough.pieces <= 50
        assert rough.volume == pytest.approx(fine.volume, rel=1e-14)
    assert jaxclay.contour_error(rough, fine) < 10 * tolerance
