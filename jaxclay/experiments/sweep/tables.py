"""What an experiment file holds, key by key, and what each value may be.

Lengths in a squash are those of the piece it is applied to: ``bottom`` and ``height`` of the band
over the piece's height, ``ratio`` the tool's radius over the piece's own at mid-band.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from jaxclay.experiments.compare.scenes import packaged_scenes
from jaxclay.experiments.sweep.lines import MistakeAt, Place
from jaxclay.experiments.sweep.settings import checked_settings
from jaxclay.experiments.sweep.values import Values, numbers, whole_numbers
from jaxclay.methods import METHODS

Kind = Literal["throughput", "timing"]
Units = Literal["snake", "printed"]
Scheme = Literal["paper", "slices", "spline"]
_ONE = Values((1.0,))


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
    """Where the tool is: ``bottom``, ``height`` and ``ratio`` over the piece's own."""

    bottom: numbers(0.0, 3.0)  # type: ignore[valid-type]
    height: numbers(0.0, 3.0, above=True)  # type: ignore[valid-type]
    ratio: numbers(0.05, 20.0)  # type: ignore[valid-type]
    top_fixed: bool = False


class MaterialTable(Table):
    """Material constants of a piece of unit height, see :class:`jaxclay.Material`."""

    k: numbers(0.0, above=True) = _ONE  # type: ignore[valid-type]
    mu: numbers(0.0) = _ONE  # type: ignore[valid-type]
    alpha: numbers(0.0) = _ONE  # type: ignore[valid-type]
    beta: numbers(0.0) = _ONE  # type: ignore[valid-type]


class ScenesTable(Table):
    """Scenes: by ``names``, or pieces and squashes in all combinations, or ``draws`` of them.

    Attributes
    ----------
    names : list of str
        Of packaged scenes (:mod:`..compare.scenes`); only ``units`` goes beside them.
    profiles : list of str
        Packaged profiles, or CSV files by glob, from the experiment file's folder.
    cylinders : table
    squash : table, or list of tables
        One, or a succession, of which the last is solved.
    material : table
    units : list of str
        Of alpha and beta: "snake" (raw differences of 64 slices), "printed" (eq. 21), or both.
    draws : int
        How many scenes to draw at random; without it all combinations are taken.
    """

    names: Annotated[list[str], Field(min_length=1)] | None = None
    profiles: Annotated[list[str], Field(min_length=1)] | None = None
    cylinders: CylinderTable | None = None
    squash: Annotated[list[SquashTable], Field(min_length=1)] | None = None
    material: MaterialTable = MaterialTable()
    units: Annotated[list[Units], Field(min_length=1)] = ["snake"]
    draws: Annotated[int, Field(ge=1, le=1_000_000)] | None = None

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
        elif self.squash is None:
            raise ValueError("pieces without a squash: give squash = { bottom, height, ratio }")
        elif self.draws is None and (random := self._random_places()):
            keys = ", ".join(dict.fromkeys(str(place[-1]) for place in random))
            raise MistakeAt(random[0], f"{keys} must be drawn: say how many scenes with draws")
        elif (bottom := self.squash[0].bottom.highest) >= 1:
            message = f"{bottom:g} lies above the piece: the first band must begin below 1"
            raise MistakeAt(("squash", 0, "bottom"), message)
        return self

    def _check_names(self, names: list[str]) -> None:
        known = packaged_scenes()
        for i, name in enumerate(names):
            if name not in known:
                message = f"unknown scene {name!r}: choose from {', '.join(known)}"
                raise MistakeAt(("names", i), message)
        given = sorted(self.model_fields_set - {"names", "units"})
        if given:
            raise MistakeAt(
                (given[0],),
                f"{', '.join(given)} beside names, which are whole scenes: take a table of "
                "[[scenes]] for each",
            )
        able = {units for name in names for units in known[name].units}
        if able.isdisjoint(self.units):
            raise MistakeAt(
                ("units",), f"no scene: {', '.join(names)} can be run in {', '.join(sorted(able))}"
            )

    def _random_places(self) -> list[Place]:
        """Keys whose numbers have to be drawn, each by its place below this table."""
        squashes = [(("squash", i), table) for i, table in enumerate(self.squash or ())]
        tables = [(("cylinders",), self.cylinders), *squashes, (("material",), self.material)]
        return [
            (*place, key)
            for place, table in tables
            for key, value in table or ()
            if isinstance(value, Values) and value.random
        ]


class MethodTable(Table):
    """A method: its schemes, and its settings, each a number, a list or a range.

    ``stops`` are iterations after which fresh runs are ended, for the chart of energy against
    time.
    """

    name: str
    schemes: Annotated[list[Scheme], Field(min_length=1)] = ["paper"]
    settings: dict[str, numbers(0.0)] = {}  # type: ignore[valid-type]
    stops: whole_numbers(1, 1_000_000) | None = None  # type: ignore[valid-type]

    @field_validator("name")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in METHODS:
            raise ValueError(f"unknown method {name!r}: choose from {', '.join(METHODS)}")
        return name

    @field_validator("settings")
    @classmethod
    def _possible(cls, settings: dict[str, Values], info: ValidationInfo) -> dict[str, Values]:
        name = info.data.get("name")  # none if it was refused
        return checked_settings(name, settings) if name else settings

    @model_validator(mode="after")
    def _checked(self) -> MethodTable:
        if self.stops and any(len(values.entries) > 1 for values in self.settings.values()):
            message = "beside several settings: take a table of [[methods]] for each"
            raise MistakeAt(("stops",), message)
        if "spline" in self.schemes and not METHODS[self.name].splines:
            able = ", ".join(name for name, method in METHODS.items() if method.splines)
            message = f'{self.name} moves nodes: scheme "spline" takes {able}'
            raise MistakeAt(("schemes",), message)
        if "spline" in self.schemes and (self.settings or self.stops):
            message = 'scheme "spline" takes elements, no settings and no stops'
            raise MistakeAt(("settings" if self.settings else "stops",), message)
        return self


class AgreeTable(Table):
    """How far a refined greedy answer may be from a certified one: see ``jaxclay agree``."""

    energy: Annotated[float, Field(gt=0, le=1)] = 1e-4
    contour: Annotated[float, Field(gt=0, le=1)] = 5e-4


class Experiment(Table):
    """What to run.

    Attributes
    ----------
    kind : str
        "timing", alone on one core and repeated, or "throughput", many at once.
    seed : int
        Of everything that is drawn.
    slices : numbers
        Of the schemes "paper" and "slices" (equal on each side of the band), 8 to 4096.
    elements : numbers
        Spans on each side of the band, for the scheme "spline", 1 to 1024.
    tolerances : numbers
        Of the contour over l, for newton on the scheme "slices" in "throughput": as many placed
        slices as each needs, beside the runs on ``slices``.
    repeats : int
        Timed runs of each task, for "timing"; more of short ones.
    scenes, methods : lists of tables
    agree : table
        For ``jaxclay agree``.
    """

    kind: Kind
    seed: Annotated[int, Field(ge=0)] = 0
    slices: whole_numbers(8, 4096) = Values((64,))  # type: ignore[valid-type]
    elements: whole_numbers(1, 1024) = Values(())  # type: ignore[valid-type]
    tolerances: numbers(1e-9, 0.1) = Values(())  # type: ignore[valid-type]
    repeats: Annotated[int, Field(ge=1, le=1000)] = 5
    scenes: Annotated[list[ScenesTable], Field(min_length=1)]
    methods: Annotated[list[MethodTable], Field(min_length=1)]
    agree: AgreeTable = AgreeTable()

    @model_validator(mode="after")
    def _checked(self) -> Experiment:
        splines = [j for j, method in enumerate(self.methods) if "spline" in method.schemes]
        stopped = [j for j, method in enumerate(self.methods) if method.stops]
        if splines and not self.elements.entries:
            message = 'scheme "spline" without elements: give elements = [8]'
            raise MistakeAt(("methods", splines[0], "schemes"), message)
        if self.elements.entries and not splines:
            message = 'without a method of scheme "spline": nothing takes them'
            raise MistakeAt(("elements",), message)
        if self.tolerances.entries:
            able = any(m.name == "newton" and "slices" in m.schemes for m in self.methods)
            if self.kind == "timing" or not able:
                message = (
                    'belong to kind = "throughput" and newton with schemes = ["slices"]: nothing '
                    "else takes them"
                )
                raise MistakeAt(("tolerances",), message)
        if self.kind == "throughput" and "repeats" in self.model_fields_set:
            message = 'repeats belong to kind = "timing": throughput runs once'
            raise MistakeAt(("repeats",), message)
        if self.kind == "throughput" and stopped:
            message = 'stops belong to kind = "timing", whose runs have a time each'
            raise MistakeAt(("methods", stopped[0], "stops"), message)
        return self


TABLES: dict[str, type[Table]] = {
    "scenes": ScenesTable,
    "methods": MethodTable,
    "agree": AgreeTable,
    "cylinders": CylinderTable,
    "squash": SquashTable,
    "material": MaterialTable,
}
