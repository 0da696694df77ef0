"""Tables of scenes: pieces, where the tool is, and the clay's constants.

Lengths in a squash are those of the piece it is applied to: ``bottom`` and ``height`` of the band
over the piece's height, ``ratio`` the tool's radius over the piece's own at mid-band.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, model_validator

from jaxclay.experiments.entries.lines import MistakeAt, Place
from jaxclay.experiments.entries.profiles import matches
from jaxclay.experiments.entries.values import Values, numbers
from jaxclay.experiments.scenes import packaged_scenes

T = TypeVar("T")
Some = Annotated[list[T], Field(min_length=1)]
# Of alpha and beta: raw differences of 64 slices, as in eq. 21, or both 0.
Units = Literal["snake", "printed", "move"]
_ONE = Values((1.0,))
_MOST = 1_000_000  # scenes of a table


class Table(BaseModel):
    """A table of the file: no unknown keys, nothing changes once it is read.

    Types are strict, so that neither "1" nor true is a number; only an int may be a float.
    """

    model_config = ConfigDict(
        extra="forbid", frozen=True, strict=True, arbitrary_types_allowed=True
    )


class CylinderTable(Table):
    """Pieces that begin as cylinders: ``radius`` and ``height`` in one length unit."""

    radius: numbers(0.0, above=True)  # type: ignore[valid-type]
    height: numbers(0.0, above=True) = _ONE  # type: ignore[valid-type]


class SquashTable(Table):
    """Where the tool is: ``bottom``, ``height`` and ``ratio`` over the piece's own.

    ``displacement`` may stand for the ratio: how far the squash moves the clay above a cylinder's
    band up, over the piece's height; less than the band's height.
    """

    bottom: numbers(0.0, 3.0)  # type: ignore[valid-type]
    height: numbers(0.0, 3.0, above=True)  # type: ignore[valid-type]
    ratio: numbers(0.05, 20.0) | None = None  # type: ignore[valid-type]
    displacement: numbers(-10.0, 3.0) | None = None  # type: ignore[valid-type]
    top_fixed: bool = False

    @model_validator(mode="after")
    def _one_of_them(self) -> SquashTable:
        if self.displacement is None:
            if self.ratio is None:
                raise MistakeAt(("ratio",), "is missing")
        elif self.ratio is not None:
            raise MistakeAt(("displacement",), "stands for the ratio: give one of the two")
        elif (most := max(self.displacement.ends)) >= min(self.height.fixed(), default=0.0):
            message = f"{most:g}: it must be below the band's height"
            raise MistakeAt(("displacement",), message)
        return self


class MaterialTable(Table):
    """Material constants of a piece of unit height, see :class:`jaxclay.Material`."""

    k: numbers(0.0, above=True) = _ONE  # type: ignore[valid-type]
    mu: numbers(0.0) = _ONE  # type: ignore[valid-type]
    alpha: numbers(0.0) = _ONE  # type: ignore[valid-type]
    beta: numbers(0.0) = _ONE  # type: ignore[valid-type]


class ScenesTable(Table):
    """Scenes: by ``names``, or pieces and squashes in all combinations, or ``draws`` of them."""

    names: Some[str] | None = None  # of packaged scenes; only ``units`` goes beside them
    # Packaged profiles, or CSV files by glob, from the experiment file's folder.
    profiles: Some[str] | None = None
    cylinders: CylinderTable | None = None
    # Radii of profiles below it are raised to it, in their length unit.
    minimum_radius: Annotated[float, Field(gt=0)] | None = None
    squash: Some[SquashTable] | None = None  # one, or a succession, of which the last is solved
    # Instead of a squash, one to 0.85 of a profile's radius there.
    places: Some[Literal["middle", "shoulder"]] | None = None
    material: MaterialTable = MaterialTable()
    units: Some[Units] = Field(default=["snake"])
    draws: Annotated[int, Field(ge=1, le=_MOST)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _one_squash(cls, raw: Any) -> Any:
        """A single table of a squash is a succession of one."""
        if isinstance(raw, dict) and isinstance(raw.get("squash"), dict):
            return raw | {"squash": [raw["squash"]]}
        return raw

    @model_validator(mode="after")
    def _checked(self) -> ScenesTable:
        if self.names is not None:
            self._check_names(self.names)
        elif self.profiles is None and self.cylinders is None:
            raise ValueError("no scene: give names, or profiles or cylinders with a squash")
        elif self.places is not None:
            for name in ("squash", "cylinders", "draws"):
                if getattr(self, name) is not None:
                    message = f"{name} beside places, which are squashes of profiles"
                    raise MistakeAt((name,), message)
        elif self.squash is None:
            raise ValueError("pieces without a squash: give squash = { bottom, height, ratio }")
        elif self.draws is None and (random := self._random()):
            keys = ", ".join(dict.fromkeys(str(place[-1]) for place in random))
            raise MistakeAt(random[0], f"{keys} must be drawn: say how many scenes with draws")
        elif (bottom := max(self.squash[0].bottom.ends)) >= 1:
            message = f"{bottom:g} lies above the piece: the first band must begin below 1"
            raise MistakeAt(("squash", 0, "bottom"), message)
        return self

    @model_validator(mode="after")
    def _with_files(self, info: ValidationInfo) -> ScenesTable:
        """Every profile a packaged name or the path of one file, those of a folder added."""
        context: dict[str, Any] = info.context or {"folder": Path(), "added": []}
        names = []
        for i, entry in enumerate(self.profiles or ()):
            try:
                names += matches(entry, context["folder"], self.minimum_radius)
            except ValueError as error:
                raise MistakeAt(("profiles", i), str(error)) from None
        if self.profiles is not None:
            self.profiles[:] = dict.fromkeys([*names, *context["added"]])
        if self.draws is None and (count := self._combinations()) > _MOST:
            raise ValueError(f"{count} combinations: at most {_MOST}, or give draws")
        return self

    def _check_names(self, names: list[str]) -> None:
        known = packaged_scenes()
        for i, name in enumerate(names):
            if name not in known:
                message = f"unknown scene {name!r}: choose from {', '.join(known)}"
                raise MistakeAt(("names", i), message)
        if given := sorted(self.model_fields_set - {"names", "units"}):
            message = f"{', '.join(given)} beside names, which are whole scenes: take a table of "
            raise MistakeAt((given[0],), f"{message}[[scenes]] for each")
        able = {units for name in names for units in known[name].units}
        if able.isdisjoint(self.units):
            message = f"no scene: {', '.join(names)} can be run in {', '.join(sorted(able))}"
            raise MistakeAt(("units",), message)

    def _numbers(self) -> dict[Place, Values]:
        """Everything that may be a list, by its place below this table."""
        squashes = [(("squash", i), table) for i, table in enumerate(self.squash or ())]
        tables = [(("cylinders",), self.cylinders), *squashes, (("material",), self.material)]
        return {
            (*place, key): value
            for place, table in tables
            for key, value in table or ()
            if isinstance(value, Values)
        }

    def _random(self) -> list[Place]:
        return [place for place, value in self._numbers().items() if value.random]

    def _combinations(self) -> int:
        """How many scenes the lists make, counted without making them."""
        if self.names is not None:
            return len(self.names) * len(self.units)
        counts = {place: len(value.entries) for place, value in self._numbers().items()}
        cylinders = math.prod(n for place, n in counts.items() if place[0] == "cylinders")
        pieces = len(self.profiles or ()) + (cylinders if self.cylinders else 0)
        others = math.prod(n for place, n in counts.items() if place[0] != "cylinders")
        return pieces * others * len(self.places or (1,)) * len(self.units)
