"""Specifications: scenes as plain numbers, to be hashed, sent to a worker and built there."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import itertools
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.experiments.entries.scenes import CylinderTable, ScenesTable, SquashTable, Table
from jaxclay.experiments.entries.values import Values
from jaxclay.experiments.scenes import Scene, packaged_scenes, profile_scene
from jaxclay.files.profiles import PROFILES, loaded
from jaxclay.model.squash import Squash

_FINE = 512  # slices on which a profile's own radius is looked up


class _Piece(NamedTuple):
    """A profile by its source and a digest of its file, or a cylinder's two lengths."""

    source: str
    digest: str = ""
    radius: float = 0.0
    height: float = 0.0


@dataclasses.dataclass(frozen=True)
class Band:
    """A squash over the lengths of its piece; see :mod:`jaxclay.experiments.entries.scenes`."""

    bottom: float
    height: float
    ratio: float
    top_fixed: bool


@dataclasses.dataclass(frozen=True)
class Specification:
    """A scene by its numbers."""

    name: str  # a packaged scene's, "cylinder" or a profile's
    number: int  # among the scenes of its table, 0 for packaged ones; not part of what is solved
    source: str  # "scene" for a packaged one, "cylinder", a packaged profile or a CSV file's path
    digest: str  # of a CSV file's bytes: the same name with another content is another scene
    radius: float  # of a cylinder
    height: float
    minimum_radius: float  # of a profile; 0 where its radii are as they are
    place: str  # of the squash of a profile, "middle" or "shoulder", "" where bands say it
    bands: tuple[Band, ...]  # a succession; what is solved is the last
    k: float
    mu: float
    alpha: float
    beta: float
    units: str  # of alpha and beta, "snake", "printed" or "move"

    @functools.cached_property
    def key(self) -> str:
        """A hash of the numbers; a file is its content, wherever it lies and whatever its name."""
        inputs = dataclasses.asdict(self) | {"number": 0}
        if self.source != "scene":
            inputs |= {"name": ""} | ({"source": ""} if self.digest else {})
        return hashed(inputs)[:16]

    def scene(self) -> Scene:
        """The scene, its squashes in the piece's own length unit.

        Raises OSError: A CSV file cannot be read, or is no longer what it was.
        """
        if self.source == "scene":
            return packaged_scenes()[self.name]
        constants = {name: getattr(self, name) for name in ("k", "mu", "alpha", "beta")}
        if self.source == "cylinder":
            piece = functools.partial(Clay.cylinder, self.radius, self.height)
        else:
            if self.digest != _digest(self.source):
                raise OSError(f"{self.source} has changed: run the experiment again")
            least = self.minimum_radius or None
            if self.place:
                found = profile_scene(self.name, self.source, self.place, least)
                return dataclasses.replace(found, **constants)

            def piece(slices: int) -> Clay:
                return loaded(self.source, slices, least).clay

        squashes = _squashes(piece(slices=_FINE), self.bands)
        return Scene(self.name, lambda n: piece(slices=n), squashes, **constants)


def specifications(tables: list[ScenesTable], seed: int) -> Iterator[list[Specification]]:
    """Every scene of each table; the same seed draws the same ones, wherever the table stands."""
    for table in tables:
        if table.names is not None:
            yield list(_packaged(table, table.names))
        elif table.draws is None:
            yield list(_products(table))
        else:
            yield list(_drawn(table, seed))


def hashed(inputs: Any) -> str:
    """A hash of plain numbers and names."""
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def _packaged(table: ScenesTable, names: list[str]) -> Iterator[Specification]:
    known = packaged_scenes()
    for name, units in itertools.product(names, table.units):
        if units in known[name].units:
            constants = known[name].k, known[name].mu, 1.0, 1.0
            yield Specification(name, 0, "scene", "", 0.0, 0.0, 0.0, "", (), *constants, units)


def _products(table: ScenesTable) -> Iterator[Specification]:
    """All combinations of the pieces, the squashes' numbers or places, the materials' and units."""
    pieces = _profiles(table)
    if table.cylinders is not None:
        pieces += [_Piece("cylinder", "", *size) for size in _combined(table.cylinders)]
    bands = [[_band(squash, *each) for each in _combined(squash)] for squash in table.squash or ()]
    everything = itertools.product(
        pieces, table.places or ("",), itertools.product(*bands), _combined(table.material)
    )
    for number, (piece, place, succession, constants) in enumerate(everything):
        for units in table.units:
            made = _specification(
                table, 0 if place else number, piece, succession, constants, units
            )
            name = f"{made.name}-{place}" if place else made.name
            yield dataclasses.replace(made, name=name, place=place)


def _drawn(table: ScenesTable, seed: int) -> Iterator[Specification]:
    """Scenes with every number drawn, or picked from its list.

    Each has a generator of its own, seeded by what the table says but for how many.
    """
    pieces: list[_Piece | CylinderTable] = [*_profiles(table)]
    named = [piece.digest or piece.source for piece in _profiles(table)]
    pieces += [table.cylinders] if table.cylinders else []
    content = table.model_dump(exclude={"draws", "profiles"}, mode="python")
    digest = int(hashed([repr(content), named])[:16], 16)
    for number in range(table.draws or 0):
        rng = np.random.default_rng([seed, digest, number])
        piece = pieces[int(rng.integers(len(pieces)))]
        if isinstance(piece, CylinderTable):
            piece = _Piece("cylinder", "", *(value.drawn(rng) for value in _values(piece)))
        succession = tuple(
            _band(one, *(value.drawn(rng) for value in _values(one))) for one in table.squash or ()
        )
        constants = tuple(value.drawn(rng) for value in _values(table.material))
        units = table.units[int(rng.integers(len(table.units)))]
        yield _specification(table, number, piece, succession, constants, units)


def _values(table: Table) -> list[Values]:
    """The numbers of a table in their order: of a squash those of a ratio or a displacement."""
    return [value for _, value in table if isinstance(value, Values)]


def _combined(table: Table) -> list[tuple[float, ...]]:
    return list(itertools.product(*(value.fixed() for value in _values(table))))


def _band(squash: SquashTable, bottom: float, height: float, reach: float) -> Band:
    """A displacement d leaves a band of its volume: ratio^2 height = height - d."""
    ratio = reach if squash.displacement is None else (1 - reach / height) ** 0.5
    return Band(bottom, height, ratio, squash.top_fixed)


def _profiles(table: ScenesTable) -> list[_Piece]:
    """Those of files in the order of their contents, whatever their names."""
    found = [_Piece(source, _digest(source)) for source in table.profiles or ()]
    return sorted(found, key=lambda piece: piece.digest or piece.source)


def _specification(table, number, piece: _Piece, succession, constants, units) -> Specification:
    name = piece.source if piece.source == "cylinder" else Path(piece.source).stem
    least, (k, mu, alpha, beta) = table.minimum_radius or 0.0, constants
    return Specification(
        name, number, *piece, least, "", succession, k, mu, alpha, beta, units
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
