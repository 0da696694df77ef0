"""Recipes: scenes as plain numbers, to be hashed, sent to a worker and cooked there."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import itertools
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.experiments.compare.scenes import Scene, packaged_scenes
from jaxclay.experiments.sweep.tables import Experiment, ScenesTable
from jaxclay.experiments.sweep.values import Values
from jaxclay.files.profiles import PROFILES, load_profile
from jaxclay.model.squash import Squash

_Piece = tuple[str | None, str, float, float]  # source and digest, or a cylinder's two lengths

_FINE = 512  # slices on which a profile's own radius is looked up


@dataclasses.dataclass(frozen=True)
class Band:
    """A squash over the lengths of its piece; see :mod:`jaxclay.experiments.sweep.tables`."""

    bottom: float
    height: float
    ratio: float
    top_fixed: bool


@dataclasses.dataclass(frozen=True)
class Recipe:
    """A scene by its numbers.

    Attributes
    ----------
    name : str
        A packaged scene's, "cylinder" or a profile's.
    number : int
        Among the scenes of its table, 0 for packaged scenes; not part of what is solved.
    source : str
        "scene" for a packaged one, "cylinder", or a packaged profile or the path of a CSV file.
    digest : str
        Of a CSV file's bytes: the same name with another content is another scene.
    radius, height : float
        Of a cylinder.
    bands : tuple of Band
        A succession; what is solved is the last.
    k, mu, alpha, beta : float
    units : str
        Of alpha and beta, "snake" or "printed".
    """

    name: str
    number: int
    source: str
    digest: str
    radius: float
    height: float
    bands: tuple[Band, ...]
    k: float
    mu: float
    alpha: float
    beta: float
    units: str

    @functools.cached_property
    def key(self) -> str:
        """A hash of the numbers; a file is its content, wherever it lies."""
        inputs = dataclasses.asdict(self) | {"number": 0} | ({"source": ""} if self.digest else {})
        return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()[:16]

    def scene(self) -> Scene:
        """The scene, its squashes in the piece's own length unit.

        Raises
        ------
        OSError
            A CSV file cannot be read, or is no longer what it was.
        """
        if self.source == "scene":
            return packaged_scenes()[self.name]
        if self.source == "cylinder":
            piece = functools.partial(Clay.cylinder, self.radius, self.height)
        else:
            if self.digest != _digest(self.source):
                raise OSError(f"{self.source} has changed: run the experiment again")
            piece = functools.partial(load_profile, self.source)
        squashes = _squashes(piece(_FINE), self.bands)
        return Scene(
            self.name, piece, squashes, self.k, self.mu, (self.units,),
            alpha=self.alpha, beta=self.beta,
        )  # fmt: skip


def recipes(experiment: Experiment) -> Iterator[Recipe]:
    """Every scene of the experiment; the same seed draws the same ones."""
    for j, table in enumerate(experiment.scenes):
        if table.names is not None:
            yield from _packaged(table)
        elif table.draws is None:
            yield from _products(table)
        else:
            yield from _drawn(table, np.random.default_rng([experiment.seed, j]))


def _packaged(table: ScenesTable) -> Iterator[Recipe]:
    known = packaged_scenes()
    for name in table.names or ():
        scene = known[name]
        for units in table.units:
            if units in scene.units:
                yield Recipe(
                    name, 0, "scene", "", 0.0, 0.0, (), scene.k, scene.mu, 1.0, 1.0, units
                )  # fmt: skip


def _products(table: ScenesTable) -> Iterator[Recipe]:
    """All combinations of the pieces, the squashes' numbers, the materials' and the units."""
    bands = [
        [
            Band(bottom, height, ratio, squash.top_fixed)
            for bottom, height, ratio in _combined(squash.bottom, squash.height, squash.ratio)
        ]
        for squash in table.squash or ()
    ]
    m = table.material
    materials = _combined(m.k, m.mu, m.alpha, m.beta)
    everything = itertools.product(_pieces(table), itertools.product(*bands), materials)
    for number, (piece, succession, constants) in enumerate(everything):
        for units in table.units:
            yield _recipe(number, piece, succession, constants, units)


def _combined(*values: Values) -> list[tuple[float, ...]]:
    return list(itertools.product(*(value.fixed() for value in values)))


def _drawn(table: ScenesTable, rng: np.random.Generator) -> Iterator[Recipe]:
    """Scenes with every number drawn, or picked from its list."""
    pieces = _of_profiles(table) + ([(None, "", 0.0, 0.0)] if table.cylinders else [])
    m = table.material
    for number in range(table.draws or 0):
        piece = pieces[int(rng.integers(len(pieces)))]
        if piece[0] is None and table.cylinders is not None:
            size = table.cylinders
            piece = None, "", size.radius.drawn(rng), size.height.drawn(rng)
        succession = tuple(
            Band(one.bottom.drawn(rng), one.height.drawn(rng), one.ratio.drawn(rng), one.top_fixed)
            for one in table.squash or ()
        )
        constants = m.k.drawn(rng), m.mu.drawn(rng), m.alpha.drawn(rng), m.beta.drawn(rng)
        units = table.units[int(rng.integers(len(table.units)))]
        yield _recipe(number, piece, succession, constants, units)


def _pieces(table: ScenesTable) -> list[_Piece]:
    pieces = _of_profiles(table)
    if table.cylinders is not None:
        sizes = _combined(table.cylinders.radius, table.cylinders.height)
        pieces += [(None, "", radius, height) for radius, height in sizes]
    return pieces


def _of_profiles(table: ScenesTable) -> list[_Piece]:
    return [(source, _digest(source), 0.0, 0.0) for source in table.profiles or ()]


def _recipe(number: int, piece: _Piece, succession, constants, units) -> Recipe:
    (source, digest, radius, height), (k, mu, alpha, beta) = piece, constants
    name = "cylinder" if source is None else Path(source).stem
    return Recipe(
        name, number, source or "cylinder", digest, radius, height, succession, k, mu, alpha, beta,
        units,
    )  # fmt: skip


def _digest(source: str) -> str:
    if source in PROFILES:
        return ""
    return hashlib.sha256(Path(source).read_bytes()).hexdigest()[:16]


def _squashes(fine: Clay, bands: tuple[Band, ...]) -> tuple[Squash, ...]:
    """The bands in the piece's own unit; a succession's over the piece before the first."""
    middle = (fine.heights[:-1] + fine.heights[1:]) / 2
    found = []
    for band in bands:
        bottom = band.bottom * float(fine.height)
        top = bottom + band.height * float(fine.height)
        radius = band.ratio * float(np.interp((bottom + top) / 2, middle, fine.radii))
        found.append(Squash(bottom, top, radius, band.top_fixed))
    return tuple(found)
