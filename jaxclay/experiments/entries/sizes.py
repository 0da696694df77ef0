"""Discretisations: a scheme, and how fine."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Literal

from pydantic import model_validator

from jaxclay.experiments.contestants import takes_splines
from jaxclay.experiments.entries.lines import MistakeAt
from jaxclay.experiments.entries.scenes import Table
from jaxclay.experiments.entries.values import Values, numbers, whole_numbers
from jaxclay.experiments.peers import PEERS

Scheme = Literal["paper", "slices", "spline"]
_TAKES = {
    "paper": ("slices",),
    "slices": ("slices", "spacing", "tolerance"),
    "spline": ("elements", "degree"),
}


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
    degree: whole_numbers(3, 5) | None = None  # type: ignore[valid-type]  # of splines
    # Spans of splines on each side of the band.
    elements: whole_numbers(1, 1024) | None = None  # type: ignore[valid-type]
    # Of the contour over l, on as many placed slices as that needs.
    tolerance: numbers(1e-9, 0.1) | None = None  # type: ignore[valid-type]

    @model_validator(mode="after")
    def _checked(self) -> DiscretisationTable:
        allowed = _TAKES[self.scheme]
        for name in sorted(self.model_fields_set - {"scheme"}):
            if name not in allowed:
                message = f'scheme "{self.scheme}" takes {", ".join(allowed)}, not {name}'
                raise MistakeAt((name,), message)
        sizes = [name for name in ("slices", "elements", "tolerance") if name in allowed]
        if sum(getattr(self, name) is not None for name in sizes) != 1:
            raise ValueError(f'scheme "{self.scheme}" needs {" or ".join(sizes)}, one of them')
        if self.tolerance is not None and self.spacing == "equal":
            raise MistakeAt(("spacing",), "a tolerance places its slices: leave spacing out")
        return self

    def taken_by(self, method: str) -> bool:
        """Whether the method or the peer knows the scheme; peers take a problem that is posed."""
        if self.scheme == "spline":
            return takes_splines(method)
        return method not in PEERS or self.slices is not None

    def sizes(self) -> Iterator[Discretisation]:
        """One discretisation for each number, coarse before fine."""
        spacing = self.spacing or ("placed" if self.scheme == "slices" else "")
        for degree in (self.degree or Values((5,))).fixed():
            degree = int(degree) if self.scheme == "spline" else 0
            for name in ("slices", "elements", "tolerance"):
                for size in getattr(self, name).fixed() if getattr(self, name) else ():
                    yield Discretisation(self.scheme, spacing, degree, **{name: size})
