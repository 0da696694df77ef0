"""Shapes in signatures: checked in the tests, and nothing that the package needs."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxclay
from jaxclay.numerics import banded
from jaxclay.numerics.arrays import Scalar
from jaxclay.numerics.interpolation import displacement

N = 8
CYLINDER = jaxclay.Clay.cylinder(slices=N)
SQUASH = jaxclay.Squash(0.0, 0.3, 0.4)
EVEN = np.arange(N + 1) / N
KNOWN = np.zeros(N + 1, bool)


def posed(scheme="paper", **given):
    return jaxclay.pose(CYLINDER, SQUASH, jaxclay.Material(), scheme, **given)


WRONG = {
    "a vector beside a matrix": lambda: banded.product(np.ones((2, N)), np.ones(N + 1)),
    "differences as long as values": lambda: displacement(EVEN, EVEN, EVEN, KNOWN),
    "a mask of numbers": lambda: displacement(EVEN, EVEN, EVEN[1:], 1.0 * KNOWN),
    "heights without the bottom": lambda: posed().point(CYLINDER.heights[1:]),
    "a step of slices": lambda: posed().system.moved(
        jaxclay.rough_shape(posed()).point, np.zeros((N, 1))
    ),
    "a traced one": lambda: jax.eval_shape(posed().point, CYLINDER.heights[1:]),
    "coefficients in two rows": lambda: posed("spline", elements=2).point(np.zeros((2, 5))),
    "a field": lambda: jaxclay.RoughShape(
        EVEN, EVEN[1:], None, *[np.float64(0)] * 4, np.zeros(2), *[np.float64(0)] * 2,
        *[np.False_] * 2, *[np.int64(1)] * 2,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_shape_is_caught(name):
    pytest.importorskip("beartype")
    jaxtyping = pytest.importorskip("jaxtyping")
    with pytest.raises(jaxtyping.TypeCheckError):
        WRONG[name]()


def test_numbers_of_all_kinds_are_scalars():
    def check(number):
        assert isinstance(number, Scalar)
        return number

    for number in (1, 0.5, True, np.float32(1), np.zeros(()), jnp.zeros(())):
        check(number)
    jax.eval_shape(check, 1.0)
    for other in (np.zeros(1), [1.0], "1", None):
        assert not isinstance(other, Scalar)


WITHOUT = """
import sys, typing
sys.modules["jaxtyping"] = sys.modules["beartype"] = None
import jaxclay
from jaxclay.numerics.arrays import Array
clay = jaxclay.Clay.cylinder(slices=16)
print(jaxclay.deform(clay, jaxclay.Squash(0, 0.3, 0.4), jaxclay.Material(), slices=16).status)
assert typing.get_type_hints(jaxclay.Clay.radii.fget)["return"] is Array
"""


def run(code):
    command = [sys.executable, "-c", code]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=300)


def test_the_package_works_without_jaxtyping():
    assert run(WITHOUT).stdout == "converged\n"


def test_importing_the_package_does_not_wait_for_jaxtyping():
    run("import sys, jaxclay; assert not {'jaxtyping', 'beartype'} & set(sys.modules)")
