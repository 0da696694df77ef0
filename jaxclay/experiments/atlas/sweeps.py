"""The scenes of the atlas: three sweeps over what makes a squash hard."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from jaxclay.clay.clay import Clay
from jaxclay.experiments.compare.scenes import SNAKE_SLICES
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash
from jaxclay.schemes.posing import pose
from jaxclay.schemes.problem import Problem

RADIUS = 0.5
DEPTH_TOP = 0.6  # the band of the sweep over depths ends there, over l
REFERENCE = Squash(0.0, 0.29296875, 0.4)
DOUBLE, SINGLE = "float64", "float32"
UNITS = {"snake units": Material.from_snake_units(slices=SNAKE_SLICES), "as printed": Material()}

_SNAKE_ALPHA, _SNAKE_BETA = 1 / SNAKE_SLICES**2, 1 / SNAKE_SLICES**4


@dataclasses.dataclass(frozen=True)
class Cell:
    """One scene of a sweep.

    Attributes
    ----------
    sweep : str
        "depth", "smoothing" or "slices".
    panel : str
        Which heat map of its sweep it belongs to, "" where each method has its own.
    x, y : float
        Its place in the sweep.
    squash, material, slices
        On the unit cylinder of radius 0.5.
    precision : str
        DOUBLE or SINGLE: what the method computes in.
    """

    sweep: str
    panel: str
    x: float
    y: float
    squash: Squash
    material: Material
    slices: int = 64
    precision: str = DOUBLE

    @property
    def name(self) -> str:
        """The cell in a few words."""
        return f"{self.sweep} {self.panel} {self.x:.3g} {self.y:.3g}".replace("  ", " ")

    def problem(self) -> Problem:
        """The scene, posed; raises what :func:`jaxclay.pose` raises."""
        clay = Clay.cylinder(RADIUS, slices=self.slices)
        return pose(clay, self.squash, self.material, "paper")


@dataclasses.dataclass(frozen=True)
class Grids:
    """The values that an atlas goes through.

    Attributes
    ----------
    depths : displacements of the clay above the band, over l; negative where it is drawn in
    frictions : mu/k
    alphas, betas : over k, by differences divided by h (eq. 21)
    slices, single_slices : n in float64 and in float32
    """

    depths: Sequence[float] = (-0.2, -0.05, 0.02, 0.1, 0.2, 0.3, 0.4, 0.5, 0.59)
    frictions: Sequence[float] = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0)
    alphas: Sequence[float] = (0.0, _SNAKE_ALPHA, 1e-2, 0.1, 1.0, 10.0, 100.0)
    betas: Sequence[float] = (0.0, _SNAKE_BETA, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0)
    slices: Sequence[int] = (16, 32, 64, 128, 256, 512, 1024, 2048, 4096)
    single_slices: Sequence[int] = (16, 64, 256, 1024)

    def cells(self) -> list[Cell]:
        """All cells, sweep by sweep; coarse grids first."""
        return [*self._depth(), *self._smoothing(), *self._slices()]

    def _depth(self) -> list[Cell]:
        return [
            Cell("depth", "", d, mu, squash_by(d), Material.from_snake_units(mu=mu))
            for mu in self.frictions
            for d in self.depths
        ]

    def _smoothing(self) -> list[Cell]:
        return [
            Cell("smoothing", "", beta, alpha, REFERENCE, Material(alpha=alpha, beta=beta))
            for alpha in self.alphas
            for beta in self.betas
        ]

    def _slices(self) -> list[Cell]:
        counts = {DOUBLE: self.slices, SINGLE: self.single_slices}
        return [
            Cell("slices", f"{units}, {name}", n, 0.0, REFERENCE, material, n, name)
            for name, grid in counts.items()
            for n in grid
            for units, material in UNITS.items()
        ]


QUICK = Grids(
    depths=(-0.05, 0.1, 0.4, 0.59),
    frictions=(0.1, 1.0, 10.0),
    alphas=(_SNAKE_ALPHA, 1e-2, 1.0),
    betas=(_SNAKE_BETA, 1e-4, 1e-2, 1.0),
    slices=(64, 256),
    single_slices=(64,),
)


def squash_by(displacement: float) -> Squash:
    """The squash from the ground to DEPTH_TOP that moves the clay above it by so much, over l."""
    return Squash(0.0, DEPTH_TOP, RADIUS * (1 - displacement / DEPTH_TOP) ** 0.5)
