"""Scenes that several test files share, built with the package's public functions."""

from __future__ import annotations

import jax
import numpy as np
from oracles import population

import jaxclay

REFERENCE = jaxclay.Squash(0.0, 0.29296875, 0.4)  # u0 = 3/16 lies on a node
MIDDLE = jaxclay.Squash(0.35, 0.6, 0.4)
SNAKE = jaxclay.Material.from_snake_units()
PRINTED = jaxclay.Material()


def squash_by(displacement):
    """From the ground to 0.6, such that the clay above moves up by so much, over l."""
    return jaxclay.Squash(0.0, 0.6, 0.5 * (1 - displacement / 0.6) ** 0.5)


def piece(slopes, r0=0.5):
    """Clay of unit height whose Y0_u on its slices is proportional to ``slopes``."""
    thickness = np.asarray(slopes, float) / np.sum(slopes)
    heights = np.concatenate([[0.0], np.cumsum(thickness)])
    return jaxclay.Clay(heights, thickness, r0, heights[-1])


def wavy(seed, slices=64, depth=0.6):
    """A random smooth rest shape and a jump, as a squash leaves it."""
    rng = np.random.default_rng(seed)
    u = (np.arange(slices) + 0.5) / slices
    a, b = rng.uniform(-depth, depth, 2)
    slopes = 1 + a * np.sin(2 * np.pi * u * rng.integers(1, 4)) * 0.9
    return piece(slopes * np.where(u < rng.uniform(0.2, 0.8), 1 + 0.5 * b, 1.0))


def cylinder_problem(squash=REFERENCE, material=SNAKE, **size):
    return jaxclay.pose(jaxclay.Clay.cylinder(**size), squash, material, "paper")


def population_problems(scenes, seed=0, smoothing=True):
    """The random population, posed; earlier squashes are carried out by ``deform``."""
    problems = []
    for r0, squashes, material in population(scenes, seed, smoothing=smoothing):
        clay = jaxclay.Clay.cylinder(radius=r0)
        for squash in list(squashes)[:-1]:
            if float(squash.bottom) < 0.8 * float(clay.height):
                clay = jaxclay.deform(clay, squash, material, scheme="paper").clay
        if float(squashes[-1].bottom) < 0.8 * float(clay.height):
            problems.append(jaxclay.pose(clay, squashes[-1], material, "paper"))
    assert len(problems) > 0.8 * scenes
    return problems


def solved(problem):
    """Newton's answer, certified."""
    solution = jaxclay.minimize(problem)
    assert solution.status is jaxclay.Status.CONVERGED, solution.message
    assert solution.certificate.accepted
    return solution


def gap(solution, best):
    """Energy above the certified minimum, over E_free."""
    return float(solution.energy - best.energy) / float(best.certificate.energy_free)


def compilations():
    """A list that grows with every compilation that jax does from here on."""
    log = []
    jax.monitoring.register_event_duration_secs_listener(
        lambda name, *_, **__: log.append(name) if "backend_compile" in name else None
    )
    return log
