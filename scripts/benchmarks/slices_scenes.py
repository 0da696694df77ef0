"""Scenes of the slices benchmark: the random population, sessions of squashes, a dragged tool."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import population as random

from jaxclay import Clay, Material, Squash, Status, deform

SQUASHES = 20  # of a session
FLARED = 2.0  # times the first radius: lips beyond that are listed apart


class Scene(NamedTuple):
    """A squash to solve."""

    clay: Clay
    squash: Squash
    material: Material
    worked: bool


def population(count: int, seed: int) -> Iterator[Scene]:
    """The random population of the comparisons, its cylinders on few slices."""
    for scene in random.population(count, seed):
        few = Clay.cylinder(radius=float(scene.clay.radii[0]))
        yield Scene(scene.clay if scene.worked else few, scene.squash, scene.material, scene.worked)


MATERIALS = {
    "snake": Material.from_snake_units(),
    "alpha .01, beta 1e-4": Material(alpha=0.01, beta=1e-4),
    "30 times snake, mu .5": Material.from_snake_units(mu=0.5, alpha=30.0, beta=30.0),
}


def next_squash(rng: np.random.Generator, clay: Clay) -> Squash:
    """A band anywhere, 0.05 to 0.3 high, pressed to 0.7 to 0.95 of the radius there."""
    height = float(clay.height)
    tall = rng.uniform(0.05, 0.3)
    bottom = rng.uniform(0.0, height - tall)
    radius = float(clay.radius_at(bottom + tall / 2)) * rng.uniform(0.7, 0.95)
    return Squash(bottom, bottom + tall, radius)


def session(seed: int, material: Material, sizes: tuple[int, ...], reference: int):
    """The clays after a session of squashes by size, the reference's last, and solves refused.

    Squashes are chosen by the reference's shape, so that all sizes get the same.
    """
    rng = np.random.default_rng(seed)
    clays = dict.fromkeys((*sizes, reference), Clay.cylinder(radius=0.4))
    refused = dict.fromkeys(clays, 0)
    for _ in range(SQUASHES):
        squash = next_squash(rng, clays[reference])
        for n, clay in clays.items():
            answer = deform(clay, squash, material, slices=n)
            refused[n] += answer.status is not Status.CONVERGED
            clays[n] = answer.clay
    return clays, refused
