"""Scenes of the slices benchmark: the random population, sessions of squashes, a dragged tool."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jaxclay import Clay, Material, Squash, Status, deform

SQUASHES = 20  # of a session
FLARED = 2.0  # times the first radius: lips beyond that are listed apart
_EARLIER = 3  # squashes before the one to solve, in one scene of four
_WORKED = 512  # slices of worked clay


class Scene(NamedTuple):
    """A squash to solve."""

    clay: Clay
    squash: Squash
    material: Material
    worked: bool


def population(count: int, seed: int) -> Iterator[Scene]:
    """``count`` random scenes: r0, bands, materials in both units, one in four on worked clay."""
    rng = np.random.default_rng(seed)
    made = 0
    while made < count:
        r0 = rng.uniform(0.2, 1.0)
        worked = rng.random() < 0.25
        squashes = [_squash(rng, r0) for _ in range(1 + _EARLIER * worked)]
        mu = 10 ** rng.uniform(-1.5, 0.3)
        alpha, beta = 10 ** rng.uniform(-2, 1, 2)
        make = Material.from_snake_units if rng.random() < 0.5 else Material
        material, clay = make(1.0, mu, alpha, beta), Clay.cylinder(radius=r0)
        for squash in squashes[:-1]:
            if squash.bottom < clay.height:
                answer = deform(clay, squash, material, slices=_WORKED)
                clay = answer.clay if answer.status is Status.CONVERGED else clay
        if squashes[-1].bottom < 0.9 * clay.height:
            made += 1
            yield Scene(clay, squashes[-1], material, worked)


def _squash(rng: np.random.Generator, r0: float) -> Squash:
    ratio = rng.uniform(1.03, 1.4) if rng.random() < 0.2 else rng.uniform(0.6, 0.97)
    if rng.random() < 0.4:
        bottom, height = rng.uniform(0.1, 0.4), rng.uniform(0.1, 0.5)
    else:
        bottom, height = 0.0, rng.uniform(0.1, 0.6)
    return Squash(bottom, bottom + height, ratio * r0)


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
