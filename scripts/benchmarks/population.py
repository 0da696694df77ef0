"""The random population: one squash each of a cylinder or of a piece squashed before."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.experiments.scenes import SNAKE_SLICES
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash
from jaxclay.solve.minimize import deform
from jaxclay.solve.solution import Status

_EARLIER = 3  # squashes before the one to solve, in one scene of four
_SLICES = 1024  # of the pieces, so that none of their own is seen in errors


class RandomScene(NamedTuple):
    """A squash to solve.

    Attributes
    ----------
    number : int
        Of the scene's draws since the seed.
    clay : Clay
        The rest shape on 1024 slices, of unit height when it was a cylinder.
    squash : Squash
    material : Material
    worked : bool
        Whether earlier squashes made the rest shape.
    snake : bool
        Whether alpha and beta are in snake units.
    """

    number: int
    clay: Clay
    squash: Squash
    material: Material
    worked: bool
    snake: bool


def population(count: int, seed: int = 0, worked: bool = True) -> Iterator[RandomScene]:
    """Yield ``count`` random scenes, the same for the same seed.

    r0 is uniform in [0.2, 1], mu = 10^U[-1.5, 0.3], alpha and beta 10^U[-2, 1] each, half of the
    materials in snake units of 64 slices.  One piece in four has gone through three squashes like
    the last, solved on placed slices, whichever scheme goes on from there; without ``worked``
    such pieces are left out.  What cannot be posed, as its band lies
    above what earlier squashes left, is drawn again.
    """
    rng = np.random.default_rng(seed)
    number, made = -1, 0
    while made < count:
        number += 1
        r0 = rng.uniform(0.2, 1.0)
        earlier = _EARLIER if rng.random() < 0.25 else 0
        squashes = [_squash(rng, r0) for _ in range(earlier + 1)]
        material, snake = _material(rng)
        if earlier and not worked:
            continue
        clay = _worked(r0, squashes[:-1], material)
        if clay is not None and float(squashes[-1].bottom) < float(clay.height):
            made += 1
            yield RandomScene(number, clay, squashes[-1], material, earlier > 0, snake)


def _squash(rng: np.random.Generator, r0: float) -> Squash:
    ratio = rng.uniform(1.03, 1.4) if rng.random() < 0.2 else rng.uniform(0.6, 0.97)
    if rng.random() < 0.4:
        bottom, height = rng.uniform(0.1, 0.4), rng.uniform(0.1, 0.5)
    else:
        bottom, height = 0.0, rng.uniform(0.1, 0.6)
    return Squash(bottom, bottom + height, ratio * r0)


def _material(rng: np.random.Generator) -> tuple[Material, bool]:
    """The material, and whether its constants are in snake units."""
    mu = 10 ** rng.uniform(-1.5, 0.3)
    alpha, beta = 10 ** rng.uniform(-2, 1, 2)
    if rng.random() < 0.5:
        return Material.from_snake_units(1.0, mu, alpha, beta, slices=SNAKE_SLICES), True
    return Material(1.0, mu, alpha, beta), False


def _worked(r0: float, squashes: list[Squash], material: Material) -> Clay | None:
    """The cylinder after these squashes; None if one could not be made."""
    shape = Clay.cylinder(radius=r0, slices=_SLICES)
    for squash in squashes:
        if float(squash.bottom) >= float(shape.height):
            return None
        answer = deform(shape, squash, material)
        if answer.status is not Status.CONVERGED:
            return None
        shape = answer.clay
    return shape
