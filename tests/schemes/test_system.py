"""The closed-form local model of slices, and the program that solves with it."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE

import jaxclay
from jaxclay import Clay, Material, pose
from jaxclay.methods.loop import initial_guess
from jaxclay.methods.newton import NewtonSettings
from jaxclay.numerics import banded
from jaxclay.schemes.sums import Displaced
from jaxclay.schemes.system import Linear
from jaxclay.solve.certified_newton import packed, program

SCENES = {
    "paper, bottom, printed": (REFERENCE, PRINTED, "paper"),
    "paper, middle, snake": (MIDDLE, SNAKE, "paper"),
    "slices, bottom, snake": (REFERENCE, SNAKE, "slices"),
    "slices, middle, printed": (MIDDLE, PRINTED, "slices"),
    "slices, middle, tension alone": (MIDDLE, Material(alpha=0.3, beta=0.0), "slices"),
}


def system_at(name, slices=24):
    """A system, and a point of it that is no minimum."""
    squash, material, scheme = SCENES[name]
    problem = pose(Clay.cylinder(), squash, material, scheme, slices=slices)
    rough = jaxclay.rough_shape(problem).point
    bumps = 1e-3 * np.sin(np.arange(slices + 1)) * problem.free
    return problem, Displaced(rough.thickness + np.diff(bumps), rough.shift + bumps)


@pytest.mark.parametrize("name", SCENES)
def test_value_is_that_of_the_sums(name):
    problem, point = system_at(name)
    smooth = problem.free_terms(point).smooth
    assert problem.system.free_smooth(point) == pytest.approx(smooth, rel=1e-13)


@pytest.mark.parametrize("name", SCENES)
def test_gradient_and_hessian_are_those_of_seven_coloured_products(name):
    problem, point = system_at(name)
    with jax.enable_x64(True):
        free = jnp.asarray(problem.free)

        def energy(step):
            here = point.moved(jnp.where(free, step, 0.0))
            return problem.free_terms(Displaced(*map(jnp.asarray, here))).smooth

        none = jnp.zeros(free.shape[0])
        expected = banded.local_model(energy, none, 3)
        system = jax.tree.map(jnp.asarray, problem.system)
        model = system.smooth_model(Displaced(*map(jnp.asarray, point)))
        matrix = system.matrix(model.bands, Linear(0.0, none, none, system.free))
        wanted = banded.masked(expected.bands, free)
        scale = np.abs(wanted).max()
        np.testing.assert_allclose(matrix, wanted, rtol=0, atol=1e-12 * scale)
        largest = np.abs(expected.gradient).max()
        np.testing.assert_allclose(model.gradient, expected.gradient, rtol=0, atol=1e-12 * largest)


@pytest.mark.parametrize("name", SCENES)
def test_a_banded_system_is_solved_as_a_dense_one(name):
    problem, point = system_at(name)
    rng = np.random.default_rng(0)
    with jax.enable_x64(True):
        system = jax.tree.map(jnp.asarray, problem.system)
        bands = system.smooth_model(Displaced(*map(jnp.asarray, point))).bands
        n = problem.slices
        stiff = rng.uniform(0, 10, n) * np.abs(bands[0]).max()  # so that it is definite
        linear = Linear(
            jnp.asarray(stiff) - bands[3],
            jnp.asarray(rng.uniform(0, 10, n + 1)),
            system.free * rng.normal(size=n + 1),
            system.free,
        )
        answer, positive = system.solve(bands, linear)
        dense = np.asarray(banded.dense(system.matrix(bands, linear)))
        assert positive
        assert np.linalg.eigvalsh(dense).min() > 0
        expected = np.linalg.solve(dense, linear.force)
        np.testing.assert_allclose(answer, expected, rtol=1e-8, atol=1e-12)


def test_an_indefinite_matrix_is_told():
    problem, _ = system_at("paper, bottom, printed")
    rough = jaxclay.rough_shape(problem).point  # a jump of radius makes it so
    with jax.enable_x64(True):
        system = jax.tree.map(jnp.asarray, problem.system)
        bands = system.smooth_model(Displaced(*map(jnp.asarray, rough))).bands
        none = jnp.zeros(problem.slices + 1)
        linear = Linear(jnp.zeros(problem.slices), none, none, system.free)
        dense = np.asarray(banded.dense(system.matrix(bands, linear)))
        assert np.linalg.eigvalsh(dense).min() < 0
        assert not system.solve(bands, linear)[1]


def equations(jaxpr):
    """Of a program and of all programs in it."""
    values = jax.tree.leaves(
        [list(equation.params.values()) for equation in jaxpr.eqns],
        is_leaf=lambda value: hasattr(value, "jaxpr") or hasattr(value, "eqns"),
    )
    inner = [getattr(value, "jaxpr", value) for value in values]
    return len(jaxpr.eqns) + sum(equations(part) for part in inner if hasattr(part, "eqns"))


def test_the_program_of_a_solve_is_as_small_whatever_the_slices():
    counts = set()
    for scheme, slices in (("paper", 64), ("slices", 64), ("slices", 300)):
        problem = pose(Clay.cylinder(), REFERENCE, SNAKE, scheme, slices=slices)
        rough = jaxclay.rough_shape(problem)
        start = initial_guess(problem, rough.point)
        values = packed(problem.system, start, NewtonSettings(), rough.feasible)
        with jax.enable_x64(True):
            counts.add(equations(jax.make_jaxpr(program.traced)(values).jaxpr))
    assert len(counts) == 1
    assert counts.pop() <= 900
