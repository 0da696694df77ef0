"""Tables of scenes: pieces, where the tool is, and the clay's constants.

Lengths in a squash are those of the piece it is applied to: ``bottom`` and ``height`` of the band
over the piece's height, ``ratio`` the tool's radius over the piece's own at mid-band.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationInfo,
    model_validator,
)

from jaxclay.experiments.entries.values import MistakeAt, Place, Values, numbers
from jaxclay.experiments.scenes import packaged_scenes
from jaxclay.files.profiles import PROFILES
from jaxclay.files.several import only_profiles

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

    @property
    def choices(self) -> dict[str, Values]:
        """Those of its keys that may be lists, in their order."""
        return {name: value for name, value in self if isinstance(value, Values)}


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
                raise MistakeAt("is missing", "ratio")
        elif self.ratio is not None:
            raise MistakeAt("stands for the ratio: give one of the two", "displacement")
        elif (most := max(self.displacement.ends)) >= min(self.height.fixed(), default=0.0):
            raise MistakeAt(f"{most:g}: it must be below the band's height", "displacement")
        return self


class MaterialTable(Table):
    """Material constants of a piece of unit height, see :class:`jaxclay.Material`."""

    k: numbers(0.0, above=True) = _ONE  # type: ignore[valid-type]
    mu: numbers(0.0) = _ONE  # type: ignore[valid-type]
    alpha: numbers(0.0) = _ONE  # type: ignore[valid-type]
    beta: numbers(0.0) = _ONE  # type: ignore[valid-type]


def _known(name: str) -> str:
    if name not in (known := packaged_scenes()):
        raise ValueError(f"unknown scene {name!r}: choose from {', '.join(known)}")
    return name


def _listed(raw: Any) -> Any:
    """A single table is a list of one."""
    return [raw] if isinstance(raw, dict) else raw


class ScenesTable(Table):
    """Scenes: by ``names``, or pieces and squashes in all combinations, or ``draws`` of them."""

    # Of packaged scenes; only ``units`` goes beside them.
    names: Some[Annotated[str, AfterValidator(_known)]] | None = None
    # Packaged profiles, or CSV files by glob, from the experiment file's folder.
    profiles: Some[str] | None = None
    cylinders: CylinderTable | None = None
    # Radii of profiles below it are raised to it, in their length unit.
    minimum_radius: Annotated[float, Field(gt=0)] | None = None
    # One, or a succession, of which the last is solved.
    squash: Annotated[Some[SquashTable], BeforeValidator(_listed)] | None = None
    # Instead of a squash, one to 0.85 of a profile's radius there.
    places: Some[Literal["middle", "shoulder"]] | None = None
    material: MaterialTable = MaterialTable()
    units: Some[Units] = Field(default=["snake"])
    draws: Annotated[int, Field(ge=1, le=_MOST)] | None = None

    @model_validator(mode="after")
    def _checked(self) -> ScenesTable:
        if self.names is not None:
            self._check_names(self.names)
        elif self.profiles is None and self.cylinders is None:
            raise ValueError("no scene: give names, or profiles or cylinders with a squash")
        elif self.places is not None:
            for name in ("squash", "cylinders", "draws"):
                if getattr(self, name) is not None:
                    raise MistakeAt(f"{name} beside places, which are squashes of profiles", name)
        elif self.squash is None:
            raise ValueError("pieces without a squash: give squash = { bottom, height, ratio }")
        elif self.draws is None and (random := [at for at, n in self._numbers() if n.random]):
            keys = ", ".join(dict.fromkeys(str(place[-1]) for place in random))
            raise MistakeAt(f"{keys} must be drawn: say how many scenes with draws", *random[0])
        elif (bottom := max(self.squash[0].bottom.ends)) >= 1:
            message = f"{bottom:g} lies above the piece: the first band must begin below 1"
            raise MistakeAt(message, "squash", 0, "bottom")
        return self

    @model_validator(mode="after")
    def _with_files(self, info: ValidationInfo) -> ScenesTable:
        """Every profile a packaged name or the path of one file, those of a folder added."""
        context: Any = info.context
        if self.profiles is not None:
            names = []
            for i, entry in enumerate(self.profiles):
                try:
                    names += _matches(entry, context["folder"], self.minimum_radius)
                except ValueError as error:
                    raise MistakeAt(str(error), "profiles", i) from None
            self.profiles[:] = dict.fromkeys([*names, *context["added"]])
        if self.draws is None and (count := self._combinations()) > _MOST:
            raise ValueError(f"{count} combinations: at most {_MOST}, or give draws")
        return self

    def _check_names(self, names: list[str]) -> None:
        if given := sorted(self.model_fields_set - {"names", "units"}):
            message = f"{', '.join(given)} beside names, which are whole scenes: take a table of "
            raise MistakeAt(f"{message}[[scenes]] for each", given[0])
        known = packaged_scenes()
        able = {units for name in names for units in known[name].units}
        if able.isdisjoint(self.units):
            message = f"no scene: {', '.join(names)} can be run in {', '.join(sorted(able))}"
            raise MistakeAt(message, "units")

    def _numbers(self) -> Iterator[tuple[Place, Values]]:
        """Everything that may be a list, and its place below this table."""
        squashes = [(("squash", i), table) for i, table in enumerate(self.squash or ())]
        tables = [(("cylinders",), self.cylinders), *squashes, (("material",), self.material)]
        for place, table in tables:
            if table is not None:
                yield from (((*place, key), n) for key, n in table.choices.items())

    def _combinations(self) -> int:
        """How many scenes the lists make, counted without making them."""
        if self.names is not None:
            return len(self.names) * len(self.units)
        cylinders, others = int(self.cylinders is not None), len(self.places or (1,))
        for (table, *_), values in self._numbers():
            if table == "cylinders":
                cylinders *= len(values.entries)
            else:
                others *= len(values.entries)
        return (len(self.profiles or ()) + cylinders) * others * len(self.units)


def files_of(folder: Path, minimum_radius: float | None = None) -> list[str]:
    """The profiles in a folder: CSV files, however their ending is written; hidden ones are none.

    Raises ValueError: There is none, or one that is no profile.
    """
    if not folder.is_dir():
        wrong = "is a file" if folder.exists() else "does not exist"
        raise ValueError(f"{folder} {wrong}: name a folder of profiles, CSV files")
    files = _visible(file for file in folder.iterdir() if file.suffix.lower() == ".csv")
    if not files:
        raise ValueError(f"no CSV file in {folder}: each profile is a file with height,radius")
    return only_profiles(files, minimum_radius)


def _matches(entry: str, folder: Path, minimum_radius: float | None) -> list[str]:
    """The profiles that an entry of a file in ``folder`` names; ValueError if none."""
    if entry in PROFILES:
        return [entry]
    pattern = Path(entry)
    try:
        wanted = re.sub(r"(?<=\*)\.csv$", ".[cC][sS][vV]", str(pattern.relative_to(pattern.anchor)))
        files = _visible((folder / pattern.anchor).glob(wanted))
    except (IndexError, OSError, ValueError):  # raised for "", "**a" and what is no path
        files = []
    if not files:
        known = ", ".join(PROFILES)
        raise ValueError(
            f"no profile {entry!r}: choose from {known}, or name CSV files, as in pots/*.csv"
        )
    return only_profiles(files, minimum_radius)


def _visible(paths: Iterable[Path]) -> list[str]:
    files = (path for path in paths if path.is_file() and not path.name.startswith("."))
    return sorted(str(path.resolve()) for path in files)
