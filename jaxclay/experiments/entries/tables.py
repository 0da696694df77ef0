"""What an experiment file holds, key by key, and what each value may be; scenes apart."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from jaxclay.experiments.contestants import checked_contestant, takes_splines
from jaxclay.experiments.entries import scenes as pieces
from jaxclay.experiments.entries.scenes import ScenesTable, Some, Table
from jaxclay.experiments.entries.values import (
    MistakeAt,
    Place,
    Values,
    checked_settings,
    numbers,
    whole_numbers,
)
from jaxclay.experiments.peers import PEERS
from jaxclay.methods import METHODS

Scheme = Literal["paper", "slices", "spline"]
_TAKES = {
    "paper": ("slices",),
    "slices": ("slices", "spacing", "tolerance"),
    "spline": ("elements", "degree"),
}
_SIZES = ("slices", "elements", "tolerance")
_NONE = Values(())
_SHORT = ("slices", "elements", "tolerances")
_OF_TIMING = {"repeats", "call", "budget", "first_answers", "precisions", "stops"}


@dataclasses.dataclass(frozen=True)
class Discretisation:
    """A scheme and how fine; the numbers that do not belong to it are 0, the words empty."""

    scheme: str
    spacing: str = ""
    degree: int = 0
    slices: int = 0
    elements: int = 0
    tolerance: float = 0.0

    @property
    def placed(self) -> bool:
        """Whether solves before it decide where its slices are, so that it is no single problem."""
        return self.spacing == "placed"

    def described(self) -> str:
        """In a few words."""
        if self.scheme == "spline":
            return f"{self.elements} spans of degree {self.degree}"
        kind = f"{self.spacing} slices" if self.spacing else "slices"
        return f"{kind} to {self.tolerance:g}" if self.tolerance else f"{self.slices} {kind}"


class DiscretisationTable(Table):
    """A scheme, and how fine: ``slices``, ``elements`` or a ``tolerance``."""

    scheme: Scheme
    spacing: Literal["placed", "equal"] | None = None  # "slices": "equal" on each side of the band
    slices: whole_numbers(8, 4096) | None = None  # type: ignore[valid-type]
    degree: whole_numbers(3, 5) = Values((5,))  # type: ignore[valid-type]  # of splines
    # Spans of splines on each side of the band.
    elements: whole_numbers(1, 1024) | None = None  # type: ignore[valid-type]
    # Of the contour over l, on as many placed slices as that needs.
    tolerance: numbers(1e-9, 0.1) | None = None  # type: ignore[valid-type]

    @model_validator(mode="after")
    def _checked(self) -> DiscretisationTable:
        allowed = _TAKES[self.scheme]
        for name in sorted(self.model_fields_set - {"scheme", *allowed}):
            takes = f'scheme "{self.scheme}" takes {", ".join(allowed)}'
            raise MistakeAt(f"{takes}, not {name}", name)
        sizes = [name for name in _SIZES if name in allowed]
        if sum(getattr(self, name) is not None for name in sizes) != 1:
            raise ValueError(f'scheme "{self.scheme}" needs {" or ".join(sizes)}, one of them')
        if self.tolerance is not None and self.spacing == "equal":
            raise MistakeAt("a tolerance places its slices: leave spacing out", "spacing")
        return self

    def taken_by(self, method: str) -> bool:
        """Whether the method or the peer knows the scheme; peers take a problem that is posed."""
        if self.scheme == "spline":
            return takes_splines(method)
        return method not in PEERS or self.slices is not None

    def sizes(self) -> Iterator[Discretisation]:
        """One discretisation for each number, coarse before fine."""
        spacing = self.spacing or ("placed" if self.scheme == "slices" else "")
        for degree in map(int, self.degree.fixed() if self.scheme == "spline" else [0]):
            for name in _SIZES:
                for size in (getattr(self, name) or _NONE).fixed():
                    fine: Any = {name: size}
                    yield Discretisation(self.scheme, spacing, degree, **fine)


class MethodTable(Table):
    """A contestant, a method or a peer: its settings, each a number, a list or a range.

    ``schemes`` are those that it takes part on: all that it knows, if not given; "paper" where the
    experiment names no discretisations.  ``stops`` are iterations after which fresh runs are
    ended, for the chart of energy against time.
    """

    name: Annotated[str, AfterValidator(checked_contestant)]
    schemes: Some[Scheme] | None = None
    settings: dict[str, numbers(0.0)] = Field(default={})  # type: ignore[valid-type]
    stops: whole_numbers(1, 1_000_000) | None = None  # type: ignore[valid-type]

    @field_validator("settings")
    @classmethod
    def _possible(cls, settings: dict[str, Values], info: ValidationInfo) -> dict[str, Values]:
        name = info.data.get("name")  # none if it was refused
        return checked_settings(name, settings) if name else settings

    @model_validator(mode="after")
    def _checked(self) -> MethodTable:
        if self.stops and any(len(values.entries) > 1 for values in self.settings.values()):
            apart = "beside several settings: take a table of [[methods]] for each"
            raise MistakeAt(apart, "stops")
        if "spline" in (self.schemes or ()) and not takes_splines(self.name):
            able = ", ".join(name for name in (*METHODS, *PEERS) if takes_splines(name))
            raise MistakeAt(f'{self.name} moves nodes: scheme "spline" takes {able}', "schemes")
        return self


class AgreeTable(Table):
    """How far a refined greedy answer may be from a certified one: see ``jaxclay agree``."""

    energy: Annotated[float, Field(gt=0, le=1)] = 1e-4
    contour: Annotated[float, Field(gt=0, le=1)] = 5e-4


class Choices(Table):
    """What the whole experiment and each of its parts may say."""

    scenes: Some[ScenesTable] | None = None
    methods: Some[MethodTable] | None = None
    discretisations: Some[DiscretisationTable] | None = None
    # Seconds that each solve has: its iterations are as many as that takes.
    budget: Annotated[float, Field(gt=0, le=3600)] | None = None
    # What methods compute in; answers are certified in float64.
    precisions: Some[Literal["float64", "float32"]] = Field(default=["float64"])
    # Placed slices of the answers that contours are compared with as well; 0 for none.
    continuum: Annotated[int, Field(ge=0, le=4096)] | None = None
    first_answers: bool = False  # whether to time what the first answer of a process costs


class PartTable(Choices):
    """A part of an experiment; what it does not say the experiment says for all."""

    first: Annotated[int, Field(ge=1)] | None = None  # only so many scenes of each table
    ladder: bool = False  # every contestant also over its ladder of steps or tolerances
    # Iterations after which fresh runs of every contestant are ended.
    stops: whole_numbers(1, 1_000_000) | None = None  # type: ignore[valid-type]
    # Whether what was out of time is not tried on more slices; newton always is.
    coarse_to_fine: bool = False

    def within(self, whole: Choices) -> PartTable:
        """The part, with what it does not say as the experiment says it for all."""
        shared = {name: getattr(whole, name) for name in Choices.model_fields}
        said = {name: getattr(self, name) for name in self.model_fields_set}
        return self.model_copy(update=shared | said)


class Experiment(Choices):
    """What to run."""

    kind: Literal["throughput", "timing"]  # many at once, or alone on one core and repeated
    seed: Annotated[int, Field(ge=0)] = 0  # of everything that is drawn
    repeats: Annotated[int, Field(ge=1, le=1000)] = 5  # of "timing"; more of short ones
    call: Literal["minimize", "deform"] = "minimize"  # timed: of a posed problem, or the whole
    parts: Some[PartTable] | None = None  # without it there is one, the experiment itself
    # A shorter way to name discretisations, for the schemes of each method: slices of "paper" and
    # of "slices" (equal ones), spans of "spline", and tolerances for newton on "slices".
    slices: whole_numbers(8, 4096) = Values((64,))  # type: ignore[valid-type]
    elements: whole_numbers(1, 1024) = _NONE  # type: ignore[valid-type]
    tolerances: numbers(1e-9, 0.1) = _NONE  # type: ignore[valid-type]
    agree: AgreeTable = AgreeTable()

    @property
    def scene_tables(self) -> list[ScenesTable]:
        """Those of the whole and of its parts."""
        return [table for one in (self, *(self.parts or ())) for table in one.scenes or ()]

    @model_validator(mode="after")
    def _checked(self) -> Experiment:
        for name in ("scenes", "methods"):
            parts = self.parts or [PartTable()]
            if getattr(self, name) is None and any(getattr(part, name) is None for part in parts):
                raise MistakeAt("is missing", name)
        if self.discretisations is None and self.parts is None:
            self._check_short()
        for name in _SHORT if self.discretisations or self.parts else ():
            if name in self.model_fields_set:
                raise MistakeAt("beside discretisations or parts: name them there", name)
        if self.kind == "throughput":
            self._check_throughput((), self)
            for i, part in enumerate(self.parts or ()):
                self._check_throughput(("parts", i), part)
        return self

    def _check_short(self) -> None:
        """Each key of the shorter way needs a method that takes it."""
        methods = [(method.name, method.schemes or ()) for method in self.methods or ()]
        splines = [j for j, (_, schemes) in enumerate(methods) if "spline" in schemes]
        if splines and not self.elements.entries:
            without = 'scheme "spline" without elements: give elements = [8]'
            raise MistakeAt(without, "methods", splines[0], "schemes")
        if self.elements.entries and not splines:
            raise MistakeAt('without a method of scheme "spline": nothing takes them', "elements")
        able = any(name == "newton" and "slices" in schemes for name, schemes in methods)
        if self.tolerances.entries and not able:
            only = 'belong to newton with schemes = ["slices"]: nothing else takes them'
            raise MistakeAt(only, "tolerances")

    @staticmethod
    def _check_throughput(place: Place, whole: Choices) -> None:
        """What only a timing run can do."""
        message = 'belongs to kind = "timing": throughput runs each task once, beside others'
        methods = [((*place, "methods", j), method) for j, method in enumerate(whole.methods or ())]
        for at, table in [(place, whole), *methods]:
            for name in sorted(table.model_fields_set & _OF_TIMING):
                raise MistakeAt(message, *at, name)
        for at, method in methods:
            if method.name in PEERS:
                raise MistakeAt(f"{method.name} is a peer: it {message}", *at, "name")

    def shorter(self, method: str) -> Iterator[DiscretisationTable]:
        """The discretisations that slices, elements and tolerances stand for."""
        yield DiscretisationTable(scheme="paper", slices=self.slices)
        yield DiscretisationTable(scheme="slices", spacing="equal", slices=self.slices)
        if self.tolerances.entries and method == "newton":
            yield DiscretisationTable(scheme="slices", tolerance=self.tolerances)
        if self.elements.entries:
            yield DiscretisationTable(scheme="spline", elements=self.elements)


TABLES: dict[str, type[Table]] = {
    "scenes": ScenesTable,
    "methods": MethodTable,
    "discretisations": DiscretisationTable,
    "parts": PartTable,
    "agree": AgreeTable,
    "cylinders": pieces.CylinderTable,
    "squash": pieces.SquashTable,
    "material": pieces.MaterialTable,
}
