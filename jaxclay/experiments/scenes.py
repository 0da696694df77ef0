"""The named scenes that methods are compared on, and squashes of profiles.

The paper's figures give neither r0 nor the bands, nor the tool's radius: those
of the fig scenes are our choice.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.files.profiles import PROFILES, loaded
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash
from jaxclay.schemes.posing import pose
from jaxclay.schemes.problem import Problem
from jaxclay.solve.minimize import deform

UNITS = ("snake", "printed", "move")
SNAKE_SLICES = 64  # the grid whose raw differences the snake units weigh, on every grid
_LEAST_SHARE = 0.05  # of the clay under a profile's tool, so that coarse grids resolve it


@dataclasses.dataclass(frozen=True)
class Scene:
    """A succession of squashes; what is compared is the last."""

    name: str
    clay: Callable[[int], Clay]  # the piece before the first squash, on so many slices
    squashes: tuple[Squash, ...]  # all but the last are solved by ``newton``
    k: float = 1.0
    mu: float = 1.0
    units: tuple[str, ...] = UNITS  # which of them it is run in; "move" is E_move alone
    fewest_slices: int = 3  # below it a band holds too few nodes
    alpha: float = 1.0  # in the units asked for, as beta
    beta: float = 1.0

    def material(self, units: str) -> Material:
        """alpha and beta as printed (eq. 21) or in snake units of 64 slices, or 0."""
        if units == "move":
            return Material(self.k, self.mu, 0.0, 0.0)
        constants = self.k, self.mu, self.alpha, self.beta
        if units == "printed":
            return Material(*constants)
        return Material.from_snake_units(*constants, slices=SNAKE_SLICES)

    def stages(
        self, units: str, slices: int, **how: Any
    ) -> Iterator[tuple[Clay, Squash, Material]]:
        """Each squash with the clay that those before it left, solved ``how`` deform is told."""
        clay, material = self.clay(slices), self.material(units)
        yield clay, self.squashes[0], material
        for before, squash in itertools.pairwise(self.squashes):
            clay = deform(clay, before, material, **how).raise_for_status().clay
            yield clay, squash, material

    def problems(self, units: str, slices: int, scheme: str = "paper") -> list[Problem]:
        """Each squash posed on what the certified minima before it left.

        On the paper's scheme, or on "slices" that are equal on each side of the band, where
        greedy is not held up by the thinnest of them.
        """
        how: Any = {"scheme": scheme} | ({"spacing": "equal"} if scheme == "slices" else {})
        return [pose(*stage, **how) for stage in self.stages(units, slices, **how)]


_WIDE, _NARROW = (functools.partial(Clay.cylinder, radius, 1.0) for radius in (0.5, 0.25))
_FIG4 = Squash(0.0, 0.3, 0.4)
_FIG6 = tuple(Squash(0.78 - 0.09 * j, 0.90 - 0.09 * j, 0.38) for j in range(8))
_FIG7 = (
    Squash(0.75, 1.1, 0.12), Squash(0.7, 0.85, 0.14), Squash(0.3, 0.4, 0.2),
    Squash(0.0, 0.06, 0.22), Squash(0.85, 1.2, 0.1), Squash(1.1, 1.5, 0.08),
    Squash(0.4, 0.5, 0.24), Squash(0.9, 1.05, 0.09),
)  # fmt: skip

NAMED: dict[str, Scene] = {
    scene.name: scene
    for scene in (
        Scene("reference", _WIDE, (Squash(0.0, 0.29296875, 0.4),)),
        Scene("fig4a", _WIDE, (_FIG4,)),
        Scene("fig4b", _WIDE, (_FIG4,), mu=0.1),
        Scene("fig4c", _WIDE, (dataclasses.replace(_FIG4, top_fixed=True),), mu=0.1),
        # The second stage of fig4a, which every comparison is: the same solve by its other name.
        Scene("fig5", _WIDE, (_FIG4,)),
        Scene("fig6", _WIDE, _FIG6),
        # The printed constants make the vase slump below its last band.
        Scene("fig7", _NARROW, _FIG7, units=("snake", "move"), fewest_slices=128),
    )
}


def packaged_scenes() -> dict[str, Scene]:
    """The named scenes and one squash, at mid-height, of each packaged profile."""
    profiles = {name: profile_scene(name, name, "middle") for name in PROFILES}
    return NAMED | profiles


def profile_scene(name: str, source: str, place: str, minimum_radius: float | None = None) -> Scene:
    """A squash to 0.85 of the radius there, over 0.12 of the height or 0.05 of the clay.

    ``place`` is "middle" or "shoulder"; ``minimum_radius`` clips pointed tips.
    """
    fine = loaded(source, 512, minimum_radius).clay
    height, r0 = float(fine.height), float(fine.r0)
    middle = (fine.heights[:-1] + fine.heights[1:]) / 2
    centre = 0.5 * height if place == "middle" else _shoulder(middle, fine.radii, height)
    radius = 0.85 * float(np.interp(centre, middle, fine.radii))
    half = max(0.06 * height, _LEAST_SHARE * r0**2 / radius**2 / 2)
    squash = Squash(centre - half, centre + half, radius)
    return Scene(name, lambda n: loaded(source, n, minimum_radius).clay, (squash,))


def _shoulder(heights: np.ndarray, radii: np.ndarray, height: float) -> float:
    """Where the radius falls fastest between 0.58 and 0.85 of the height."""
    y = np.linspace(0.58, 0.85, 55) * height
    window = 0.03 * height
    fall = np.interp(y - window, heights, radii) - np.interp(y + window, heights, radii)
    return float(y[np.argmax(fall)])
