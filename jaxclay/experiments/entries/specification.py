"""Specifications: scenes as plain numbers, to be hashed, sent to a worker and built there."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import itertools
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.experiments.entries.scenes import ScenesTable, SquashTable, Table
from jaxclay.experiments.entries.values import combinations
from jaxclay.experiments.scenes import Scene, packaged_scenes, profile_scene
from jaxclay.files.profiles import PROFILES, loaded
from jaxclay.model.squash import Squash

_FINE = 512  # slices on which a piece's own radius is looked up
_CONSTANTS = ("k", "mu", "alpha", "beta")


@dataclasses.dataclass(frozen=True)
class Band:
    """A squash over the lengths of its piece; see :mod:`jaxclay.experiments.entries.scenes`."""

    bottom: float
    height: float
    ratio: float
    top_fixed: bool

    def squash(self, fine: Clay) -> Squash:
        """The same in the piece's own unit; in a succession, the piece's before the first."""
        middle = (fine.heights[:-1] + fine.heights[1:]) / 2
        bottom = self.bottom * float(fine.height)
        top = bottom + self.height * float(fine.height)
        radius = self.ratio * float(np.interp((bottom + top) / 2, middle, fine.radii))
        return Squash(bottom, top, radius, self.top_fixed)


@dataclasses.dataclass(frozen=True)
class Specification:
    """A scene by its numbers."""

    name: str  # a packaged scene's, "cylinder" or a profile's
    source: str  # "scene" for a packaged one, "cylinder", a packaged profile or a CSV file's path
    units: str  # of alpha and beta, "snake", "printed" or "move"
    k: float
    mu: float
    alpha: float
    beta: float
    number: int = 0  # among the scenes of its table, 0 for packaged ones; no part of what is solved
    digest: str = ""  # of a CSV file's bytes: the same name with another content is another scene
    radius: float = 0.0  # of a cylinder
    height: float = 0.0
    minimum_radius: float = 0.0  # of a profile; 0 where its radii are as they are
    place: str = ""  # of the squash of a profile, "middle" or "shoulder", "" where bands say it
    bands: tuple[Band, ...] = ()  # a succession; what is solved is the last

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
        if self.digest != _digest(self.source):
            raise OSError(f"{self.source} has changed: run the experiment again")
        constants = {name: getattr(self, name) for name in _CONSTANTS}
        if self.place:
            least = self.minimum_radius or None
            found = profile_scene(self.name, self.source, self.place, least)
            return dataclasses.replace(found, **constants)
        fine = self._piece(_FINE)
        squashes = tuple(band.squash(fine) for band in self.bands)
        return Scene(self.name, self._piece, squashes, **constants)

    def _piece(self, slices: int) -> Clay:
        if self.source == "cylinder":
            return Clay.cylinder(self.radius, self.height, slices=slices)
        return loaded(self.source, slices, self.minimum_radius or None).clay


def specifications(tables: list[ScenesTable], seed: int) -> Iterator[list[Specification]]:
    """Every scene of each table; the same seed draws the same ones, wherever the table stands."""
    for table in tables:
        if table.names is not None:
            yield list(_packaged(table, table.names))
        elif table.draws is None:
            yield list(_products(table))
        else:
            yield list(_drawn(table, seed, table.draws))


def hashed(inputs: Any) -> str:
    """A hash of plain numbers and names."""
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def _packaged(table: ScenesTable, names: list[str]) -> Iterator[Specification]:
    known = packaged_scenes()
    for name, units in itertools.product(names, table.units):
        if units in known[name].units:
            yield Specification(name, "scene", units, known[name].k, known[name].mu, 1.0, 1.0)


def _products(table: ScenesTable) -> Iterator[Specification]:
    """All combinations of the pieces, the squashes' numbers or places, the materials' and units."""
    pieces = _profiles(table)
    if table.cylinders is not None:
        pieces += [{"source": "cylinder", **size} for size in combinations(table.cylinders.choices)]
    bands = [
        [_band(squash, **each) for each in combinations(squash.choices)]
        for squash in table.squash or ()
    ]
    materials = combinations(table.material.choices)
    everything = itertools.product(
        pieces, table.places or ("",), itertools.product(*bands), materials
    )
    for number, (piece, place, succession, constants) in enumerate(everything):
        made = {"number": 0 if place else number, "place": place, "bands": succession}
        for units in table.units:
            yield _specification(table, piece, units=units, **made, **constants)


def _drawn(table: ScenesTable, seed: int, draws: int) -> Iterator[Specification]:
    """Scenes with every number drawn, or picked from its list.

    Each has a generator of its own, seeded by what the table says but for how many.
    """
    pieces: list[Any] = _profiles(table)
    named = [piece["digest"] or piece["source"] for piece in pieces]
    pieces += [table.cylinders] if table.cylinders is not None else []
    content = table.model_dump(exclude={"draws", "profiles"}, mode="python")
    digest = int(hashed([repr(content), named])[:16], 16)
    for number in range(draws):
        rng = np.random.default_rng([seed, digest, number])
        piece = pieces[int(rng.integers(len(pieces)))]
        if piece is table.cylinders:
            piece = {"source": "cylinder", **_picked(piece, rng)}
        succession = tuple(_band(one, **_picked(one, rng)) for one in table.squash or ())
        made = {"number": number, "bands": succession, **_picked(table.material, rng)}
        units = table.units[int(rng.integers(len(table.units)))]
        yield _specification(table, piece, units=units, **made)


def _picked(table: Table, rng: np.random.Generator) -> dict[str, float]:
    return {name: values.drawn(rng) for name, values in table.choices.items()}


def _band(squash: SquashTable, bottom: float, height: float, **reach: float) -> Band:
    """A displacement d leaves a band of its volume: ratio^2 height = height - d."""
    ratio = reach.get("ratio") or (1 - reach["displacement"] / height) ** 0.5
    return Band(bottom, height, ratio, squash.top_fixed)


def _profiles(table: ScenesTable) -> list[dict[str, Any]]:
    """Those of files in the order of their contents, whatever their names."""
    found = [{"source": source, "digest": _digest(source)} for source in table.profiles or ()]
    return sorted(found, key=lambda piece: piece["digest"] or piece["source"])


def _specification(table: ScenesTable, piece: dict[str, Any], **more: Any) -> Specification:
    name = "-".join(filter(None, (Path(piece["source"]).stem, more.get("place"))))
    return Specification(name, minimum_radius=table.minimum_radius or 0.0, **piece, **more)


def _digest(source: str) -> str:
    """Of a file; nothing of other pieces."""
    if source in ("cylinder", *PROFILES):
        return ""
    return hashlib.sha256(Path(source).read_bytes()).hexdigest()[:16]
