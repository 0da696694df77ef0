"""What programs do with a package: copies, threads, processes, JAX's ways to find mistakes."""

import copy
import logging
import multiprocessing
import os
import pickle
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

import jax
import numpy as np
import pytest

import jaxclay
from jaxclay import Clay, Material, Squash, deform, minimize, pose

CLAY, MATERIAL = Clay.cylinder(slices=16), Material.from_snake_units()
RADII = [0.38, 0.4, 0.42]


def energy(radius, slices=16):
    return float(deform(CLAY, Squash(0.0, 0.5, radius), MATERIAL, slices=slices).energy)


@pytest.fixture(scope="module")
def solution():
    return deform(CLAY, Squash(0.0, 0.5, 0.4), MATERIAL, slices=16)


def parts(solution):
    spline = pose(CLAY, Squash(0.0, 0.5, 0.4), MATERIAL, "spline", elements=4)
    return [CLAY, MATERIAL, Squash(0.0, 0.5, 0.4), spline, solution, solution.problem,
            solution.rough, solution.certificate]  # fmt: skip


@pytest.mark.parametrize(
    "copied", [lambda thing: pickle.loads(pickle.dumps(thing)), copy.deepcopy, copy.copy]
)
def test_everything_can_be_copied(solution, copied):
    for thing in parts(solution):
        other = copied(thing)
        assert type(other) is type(thing)
        leaves, others = jax.tree.leaves(thing), jax.tree.leaves(other)
        for leaf, same in zip(leaves, others, strict=True):
            np.testing.assert_array_equal(leaf, same)
    again = minimize(copied(solution.problem), start=copied(solution))
    assert again.energy == pytest.approx(float(solution.energy), rel=1e-12)


def test_threads_solve_what_one_does():
    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(energy, RADII)) == [energy(radius) for radius in RADII]


def test_spawned_processes_solve_what_one_does():
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        assert list(pool.map(energy, RADII)) == [energy(radius) for radius in RADII]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="nothing forks here")
def test_a_fork_after_jax_was_used_is_refused_and_hangs_nobody():
    """In a process with no threads but those of JAX: a fork waits for ever for a lock of others."""
    code = f"""
import multiprocessing, sys
from concurrent.futures import ProcessPoolExecutor
sys.path.insert(0, {str(Path(__file__).parent)!r})
from test_processes import energy
energy(0.4)
with ProcessPoolExecutor(1, multiprocessing.get_context("fork")) as pool:
    print(pool.submit(energy, 0.4).exception())
"""
    command = [sys.executable, "-W", "ignore", "-c", code]  # JAX and Python warn of the fork itself
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert "spawn" in done.stdout


@pytest.mark.parametrize(
    "watched", [jax.debug_nans, jax.debug_infs, jax.disable_jit, jax.log_compiles]
)
def test_answers_are_the_same_while_mistakes_are_looked_for(solution, watched, caplog):
    caplog.set_level(logging.CRITICAL)
    with watched(True):
        assert energy(0.4) == float(solution.energy)
        (other,) = jaxclay.deform_batch([(CLAY, Squash(0.0, 0.5, 0.4), MATERIAL)], slices=16)
    assert float(other.energy) == pytest.approx(float(solution.energy), rel=1e-12)


def test_what_is_not_finite_is_a_status_while_nans_are_looked_for():
    problem = pose(CLAY, Squash(0.0, 0.5, 0.4), Material(alpha=1e308), "paper")
    with jax.debug_nans(True):
        assert minimize(problem).status is jaxclay.Status.NON_FINITE
