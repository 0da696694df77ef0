"""What an experiment file holds, key by key, and what each value may be.

Lengths in a squash are those of the piece it is applied to: ``bottom`` and ``height`` of the band
over the piece's height, ``ratio`` the tool's radius over the piece's own at mid-band.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from jaxclay.experiments.contestants import check_contestant, takes_splines
from jaxclay.experiments.entries.lines import MistakeAt, Place
from jaxclay.experiments.entries.settings import checked_settings
from jaxclay.experiments.entries.values import Values, numbers, whole_numbers
from jaxclay.experiments.peers import PEERS
from jaxclay.experiments.scenes import packaged_scenes
from jaxclay.methods import METHODS

Kind = Literal["throughput", "timing"]
Units = Literal["snake", "printed", "move"]
Scheme = Literal["paper", "slices", "spline"]
Precision = Literal["float64", "float32"]
Call = Literal["minimize", "deform"]
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
        if self.ratio is None and self.displacement is None:
            raise MistakeAt(("ratio",), "is missing")
        if self.displacement is not None:
            if self.ratio is not None:
                raise MistakeAt(("displacement",), "stands for the ratio: give one of the two")
            lowest = min(self.height.fixed(), default=0.0)
            if self.displacement.highest >= lowest:
                message = f"{self.displacement.highest:g}: it must be below the band's height"
                raise MistakeAt(("displacement",), message)
        return self


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
        Of packaged scenes (:mod:`..scenes`); only ``units`` goes beside them.
    profiles : list of str
        Packaged profiles, or CSV files by glob, from the experiment file's folder.
    cylinders : table
    minimum_radius : float
        Radii of profiles below it are raised to it, in their length unit.
    squash : table, or list of tables
        One, or a succession, of which the last is solved.
    places : list of str
        Instead of a squash, one to 0.85 of a profile's radius at its "middle", its "shoulder".
    material : table
    units : list of str
        Of alpha and beta: "snake" (raw differences of 64 slices), "printed" (eq. 21), or "move",
        in which both are 0.
    draws : int
        How many scenes to draw at random; without it all combinations are taken.
    """

    names: Annotated[list[str], Field(min_length=1)] | None = None
    profiles: Annotated[list[str], Field(min_length=1)] | None = None
    cylinders: CylinderTable | None = None
    minimum_radius: Annotated[float, Field(gt=0)] | None = None
    squash: Annotated[list[SquashTable], Field(min_length=1)] | None = None
    places: Annotated[list[Literal["middle", "shoulder"]], Field(min_length=1)] | None = None
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
        elif self.places is not None:
            self._check_places()
        elif self.squash is None:
            raise ValueError("pieces without a squash: give squash = { bottom, height, ratio }")
        elif self.draws is None and (random := self._random_places()):
            keys = ", ".join(dict.fromkeys(str(place[-1]) for place in random))
            raise MistakeAt(random[0], f"{keys} must be drawn: say how many scenes with draws")
        elif (bottom := self.squash[0].bottom.highest) >= 1:
            message = f"{bottom:g} lies above the piece: the first band must begin below 1"
            raise MistakeAt(("squash", 0, "bottom"), message)
        return self

    def _check_places(self) -> None:
        """They are whole squashes of profiles."""
        for name in ("squash", "cylinders", "draws"):
            if getattr(self, name) is not None:
                raise MistakeAt((name,), f"{name} beside places, which are squashes of profiles")

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
    """A contestant, a method or a peer: its settings, each a number, a list or a range.

    ``schemes`` are those that it takes part on: all that it knows, if not given; "paper" where the
    experiment names no discretisations.  ``stops`` are iterations after which fresh runs are
    ended, for the chart of energy against time.
    """

    name: str
    schemes: Annotated[list[Scheme], Field(min_length=1)] | None = None
    settings: dict[str, numbers(0.0)] = {}  # type: ignore[valid-type]
    stops: whole_numbers(1, 1_000_000) | None = None  # type: ignore[valid-type]

    @field_validator("name")
    @classmethod
    def _known(cls, name: str) -> str:
        check_contestant(name)
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
        if "spline" in (self.schemes or ()) and not takes_splines(self.name):
            able = ", ".join(name for name in (*METHODS, *PEERS) if takes_splines(name))
            message = f'{self.name} moves nodes: scheme "spline" takes {able}'
            raise MistakeAt(("schemes",), message)
        return self


class DiscretisationTable(Table):
    """A scheme, and how fine: ``slices``, ``elements`` or a ``tolerance``.

    Attributes
    ----------
    scheme : str
    spacing : str
        Of the scheme "slices": "placed", or "equal" on each side of the band.
    slices : numbers
        Of the schemes "paper" and "slices", 8 to 4096.
    degree : numbers
        Of splines, 3 to 5.
    elements : numbers
        Spans on each side of the band, for the scheme "spline", 1 to 1024.
    tolerance : numbers
        Of the contour over l, on as many placed slices as that needs.
    """

    scheme: Scheme
    spacing: Literal["placed", "equal"] | None = None
    slices: whole_numbers(8, 4096) | None = None  # type: ignore[valid-type]
    degree: whole_numbers(3, 5) | None = None  # type: ignore[valid-type]
    elements: whole_numbers(1, 1024) | None = None  # type: ignore[valid-type]
    tolerance: numbers(1e-9, 0.1) | None = None  # type: ignore[valid-type]

    @model_validator(mode="after")
    def _checked(self) -> DiscretisationTable:
        allowed = {
            "paper": ("slices",),
            "slices": ("slices", "spacing", "tolerance"),
            "spline": ("elements", "degree"),
        }[self.scheme]
        sizes = ("slices", "elements", "tolerance")
        for name in sorted(self.model_fields_set - {"scheme"}):
            if name not in allowed:
                message = f'scheme "{self.scheme}" takes {", ".join(allowed)}, not {name}'
                raise MistakeAt((name,), message)
        given = [name for name in sizes if getattr(self, name) is not None]
        if len(given) != 1:
            wanted = " or ".join(name for name in sizes if name in allowed)
            raise ValueError(f'scheme "{self.scheme}" needs {wanted}, one of them')
        if self.tolerance is not None and self.spacing == "equal":
            raise MistakeAt(("spacing",), "a tolerance places its slices: leave spacing out")
        return self


class AgreeTable(Table):
    """How far a refined greedy answer may be from a certified one: see ``jaxclay agree``."""

    energy: Annotated[float, Field(gt=0, le=1)] = 1e-4
    contour: Annotated[float, Field(gt=0, le=1)] = 5e-4


class Choices(Table):
    """What the whole experiment and each of its parts may say.

    Attributes
    ----------
    scenes, methods, discretisations : lists of tables
    budget : float
        Seconds that each solve has, if given: its iterations are as many as that takes.
    precisions : list of str
        What methods compute in, "float64", "float32" or both; answers are certified in float64.
    continuum : int
        Placed slices of the answers that contours are compared with as well; 0 for none.
    first_answers : bool
        Whether to time, in a process of its own, what the first answer costs.
    """

    scenes: Annotated[list[ScenesTable], Field(min_length=1)] | None = None
    methods: Annotated[list[MethodTable], Field(min_length=1)] | None = None
    discretisations: Annotated[list[DiscretisationTable], Field(min_length=1)] | None = None
    budget: Annotated[float, Field(gt=0, le=3600)] | None = None
    precisions: Annotated[list[Precision], Field(min_length=1)] = ["float64"]
    continuum: Annotated[int, Field(ge=0, le=4096)] | None = None
    first_answers: bool = False


class PartTable(Choices):
    """A part of an experiment; what it does not say the experiment says for all.

    Attributes
    ----------
    first : int
        Only so many scenes of each table.
    ladder : bool
        Every contestant also over its ladder of steps or tolerances.
    stops : numbers
        Iterations after which fresh runs of every contestant are ended.
    coarse_to_fine : bool
        Whether what was out of time is not tried on more slices; newton always is.
    """

    first: Annotated[int, Field(ge=1)] | None = None
    ladder: bool = False
    stops: whole_numbers(1, 1_000_000) | None = None  # type: ignore[valid-type]
    coarse_to_fine: bool = False


class Experiment(Choices):
    """What to run.

    Attributes
    ----------
    kind : str
        "timing", alone on one core and repeated, or "throughput", many at once.
    seed : int
        Of everything that is drawn.
    repeats : int
        Timed runs of each task, for "timing"; more of short ones.
    call : str
        What is timed: "minimize", of a problem that is posed, or the whole "deform".
    parts : list of tables
        Several experiments in one; without it there is one part, the experiment itself.
    slices, elements, tolerances : numbers
        A shorter way to name discretisations, for the schemes of each method: slices of "paper"
        and of "slices" (equal on each side of the band), spans of "spline", and tolerances for
        newton on "slices".
    agree : table
        For ``jaxclay agree``.
    """

    kind: Kind
    seed: Annotated[int, Field(ge=0)] = 0
    repeats: Annotated[int, Field(ge=1, le=1000)] = 5
    call: Call = "minimize"
    parts: Annotated[list[PartTable], Field(min_length=1)] | None = None
    slices: whole_numbers(8, 4096) = Values((64,))  # type: ignore[valid-type]
    elements: whole_numbers(1, 1024) = Values(())  # type: ignore[valid-type]
    tolerances: numbers(1e-9, 0.1) = Values(())  # type: ignore[valid-type]
    agree: AgreeTable = AgreeTable()

    @model_validator(mode="after")
    def _checked(self) -> Experiment:
        parts = self.parts or [PartTable()]
        for name in ("scenes", "methods"):
            if getattr(self, name) is None and any(getattr(part, name) is None for part in parts):
                raise MistakeAt((name,), "is missing")
        self._check_sizes()
        if self.kind == "throughput":
            self._check_throughput(parts)
        return self

    def _check_sizes(self) -> None:
        """The shorter way: each of its keys needs a method that takes it."""
        named = self.discretisations is not None or self.parts is not None
        for name in ("slices", "elements", "tolerances"):
            if named and name in self.model_fields_set:
                message = "beside discretisations or parts: name them there"
                raise MistakeAt((name,), message)
        splines = [j for j, m in enumerate(self.methods or ()) if "spline" in (m.schemes or ())]
        if named:
            return
        if splines and not self.elements.entries:
            message = 'scheme "spline" without elements: give elements = [8]'
            raise MistakeAt(("methods", splines[0], "schemes"), message)
        if self.elements.entries and not splines:
            message = 'without a method of scheme "spline": nothing takes them'
            raise MistakeAt(("elements",), message)
        able = any(m.name == "newton" and "slices" in (m.schemes or ()) for m in self.methods or ())
        if self.tolerances.entries and not able:
            message = 'belong to newton with schemes = ["slices"]: nothing else takes them'
            raise MistakeAt(("tolerances",), message)

    def _check_throughput(self, parts: list[PartTable]) -> None:
        """What only a timing run can do."""
        message = 'belongs to kind = "timing": throughput runs each task once, beside others'
        for name in ("repeats", "call", "budget", "first_answers", "precisions"):
            if name in self.model_fields_set:
                raise MistakeAt((name,), message)
        for i, part in enumerate(parts):
            for name in ("budget", "first_answers", "precisions", "stops"):
                if name in part.model_fields_set:
                    raise MistakeAt(("parts", i, name), message)
        for j, method in enumerate(self.methods or ()):
            if method.stops:
                raise MistakeAt(("methods", j, "stops"), message)
            if method.name in PEERS:
                raise MistakeAt(("methods", j, "name"), f"{method.name} is a peer: it {message}")


TABLES: dict[str, type[Table]] = {
    "scenes": ScenesTable,
    "methods": MethodTable,
    "discretisations": DiscretisationTable,
    "parts": PartTable,
    "agree": AgreeTable,
    "cylinders": CylinderTable,
    "squash": SquashTable,
    "material": MaterialTable,
}
