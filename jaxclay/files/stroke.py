"""A stroke of the tool, as the modeller draws it and a :mod:`.piece` keeps it."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from jaxclay.files.checked import Raw, as_number, as_object, as_pairs, short
from jaxclay.methods import METHODS
from jaxclay.model.material import Material
from jaxclay.numerics.checks import check_positive, check_whole

MOST_POINTS = 10**6  # of all strokes of a piece together
_SIDES, _KINDS = ("right", "left"), ("press", "smooth")
_CONSTANTS = tuple(field.name for field in dataclasses.fields(Material))
_STROKE = ("side", "size", "face", "material", "path", "kind", "solver")
_SOLVER = ("method", "scheme", "slices", "most")


@dataclasses.dataclass(frozen=True)
class Solver:
    """How a stroke's squashes are solved.

    Attributes
    ----------
    method : str
        A key of :data:`jaxclay.METHODS`.
    scheme : "slices" or "paper"
    slices : int
        How many, or 0 for as many as the modeller's tolerance needs.
    most : int
        Slices that an answer to a tolerance may have.

    Raises
    ------
    ValueError
        What is none of these, by name.
    """

    method: str = "newton"
    scheme: str = "slices"
    slices: int = 0
    most: int = 512

    def __post_init__(self):
        for name, allowed in (("method", tuple(METHODS)), ("scheme", ("slices", "paper"))):
            if (value := getattr(self, name)) not in allowed:
                raise ValueError(f"{name} must be one of {', '.join(allowed)}, got {short(value)}")
        check_whole("slices", self.slices, 0)
        check_whole("most", self.most, 3)


@dataclasses.dataclass(frozen=True)
class Stroke:
    """One way of the tool along the clay.

    Attributes
    ----------
    side : "right" or "left"
        Where the tool is seen.
    size, face : float, length
        Height of the tool, positive, and of its face, from 0 to ``size``.
    path : rows of (height, radius), length
        Where the middle of the face went, at least one point; radii are at least 0.
    kind : "press" or "smooth"
    material : Material, optional
        None is the piece's own.
    solver : Solver, optional
        None is the modeller's own.

    Raises
    ------
    ValueError
        What is none of these, by name.
    """

    side: str
    size: float
    face: float
    path: tuple[tuple[float, float], ...]
    kind: str = "press"
    material: Material | None = None
    solver: Solver | None = None

    def __post_init__(self):
        for name, allowed in (("side", _SIDES), ("kind", _KINDS)):
            if (value := getattr(self, name)) not in allowed:
                raise ValueError(f"{name} must be one of {', '.join(allowed)}, got {short(value)}")
        check_positive("size", self.size)
        if not 0 <= self.face <= self.size:
            raise ValueError(f"face must lie between 0 and size {self.size:g}, got {self.face:g}")
        for name in ("size", "face"):
            object.__setattr__(self, name, float(getattr(self, name)))
        object.__setattr__(self, "path", tuple((float(y), float(r)) for y, r in self.path))
        if not self.path:
            raise ValueError("path must have at least one point")
        for i, (height, radius) in enumerate(self.path):
            if not (math.isfinite(height) and math.isfinite(radius) and radius >= 0):
                raise ValueError(
                    f"path[{i}] must be a finite height and a radius of at least 0, got "
                    f"{height:g}, {radius:g}"
                )


def constants(material: Material) -> Raw:
    """The constants of a material, as a piece has them."""
    return {name: float(getattr(material, name)) for name in _CONSTANTS}


def material_of(value: Any, where: str) -> Material:
    """The material of an object of a piece; raises ValueError that begins with ``where``."""
    raw = as_object(value, where, _CONSTANTS)
    try:
        return Material(**{name: as_number(raw[name], name) for name in _CONSTANTS})
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def stroke_of(value: Any, where: str) -> Stroke:
    """The same for a stroke."""
    raw = as_object(value, where, _STROKE, ("solver",))
    path = tuple(as_pairs(raw["path"], f"{where}.path", MOST_POINTS))
    size, face = (as_number(raw[key], f"{where}.{key}") for key in ("size", "face"))
    own = raw["material"]
    material = None if own is None else material_of(own, f"{where}.material")
    try:
        how = raw.get("solver")
        known = None if how is None else as_object(how, f"{where}.solver", _SOLVER)
        solver = None if known is None else Solver(**known)
        return Stroke(raw["side"], size, face, path, raw["kind"], material, solver)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
