"""The words of ``repr``: a few lines of figures, never the arrays.

Whatever JAX puts into a tree may come: tracers and other stand-ins are named by dtype and shape,
a batch by the range of its values.
"""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.core
import numpy as np

_WIDTH = 100


def known(value: Any) -> np.ndarray | None:
    """The numbers as NumPy; None for tracers, for None and for what else stands in for an array."""
    numbers = (np.ndarray, np.generic, jax.Array, int, float)
    if isinstance(value, jax.core.Tracer) or not isinstance(value, numbers):
        return None
    array = np.asarray(value)
    return array if array.dtype.kind in "biuf" else None


def figure(value: Any, spec: str = ".6g") -> str:
    """A number; "low to high" for several; dtype and shape for what has no values."""
    array = known(value)
    if array is None or array.size == 0:
        shape, dtype = getattr(value, "shape", None), getattr(value, "dtype", None)
        return type(value).__name__ if dtype is None else f"{dtype}{list(shape or ())}"
    low, high = (f"{bound.reduce(array, axis=None):{spec}}" for bound in (np.fmin, np.fmax))
    return low if low == high else f"{low} to {high}"


def named(code: Any, names: Mapping[int, str] | tuple[str, ...]) -> str:
    """The name that belongs to a whole number; of a batch how many there are of each."""
    array = known(code)
    if array is None:
        return figure(code)
    if array.ndim == 0:
        return names[int(array)]
    values, counts = np.unique(array, return_counts=True)
    return ", ".join(f"{n} {names[int(i)]}" for i, n in zip(values, counts, strict=True)) or "none"


def flag(value: Any, yes: str = "yes", no: str = "no") -> str:
    """One of two words; of a batch how many of each."""
    return named(value, (no, yes))


def size(values: Any, of: str = "slices") -> str:
    """How many there are along the last axis, and of how many pieces in a batch."""
    shape = np.shape(values)
    if not shape:
        return f"{figure(values)} as {of}"
    batch = "" if len(shape) == 1 else f"batch of {' x '.join(map(str, shape[:-1]))}, "
    return f"{batch}{shape[-1]} {of}"


def derived(compute: Callable[..., Any], *values: Any) -> Any:
    """What follows from arrays, or the last of them where their values are not known."""
    arrays = [known(value) for value in values]
    if any(array is None for array in arrays):
        return values[-1]
    with np.errstate(all="ignore"):
        return compute(*arrays)


def lines(head: str, *rest: str) -> str:
    """The lines one below the other, indented but for the first, and none too long."""
    parts = [textwrap.fill(head, _WIDTH, subsequent_indent="    ")]
    parts += [
        textwrap.fill(line, _WIDTH, initial_indent="  ", subsequent_indent="    ") for line in rest
    ]
    return "\n".join(parts)


def dimensions(clay: Any) -> str:
    """Height, radii (of slices) and volume of a piece, in its own length unit, and the unit."""
    height = derived(lambda y: y[..., -1], clay.heights)
    volume = derived(lambda r0: np.pi * r0**2, clay.r0)
    radii = ""
    if hasattr(clay, "thickness"):
        found = derived(_radii, clay.material, clay.r0, clay.thickness)
        radii = f"radius {figure(found, '.4g')}, "
    unit = figure(clay.unit)
    return f"height {figure(height)}, {radii}volume {figure(volume)}, unit l {unit}"


def free(fixed: Any) -> str:
    """How many unknowns of each problem are not fixed."""
    return figure(derived(lambda fixed: (~fixed).sum(axis=-1), fixed))


def asked(tool: Any, material: Any) -> tuple[str, str]:
    """The squash, lengths over l, and the constants of the energy."""
    names = ("k", "mu", "alpha", "beta", "floor")
    constants = ", ".join(f"{name} {figure(getattr(material, name), '.4g')}" for name in names)
    places = ("bottom", "top", "radius")
    lengths = ", ".join(f"{name} {figure(getattr(tool, name))}" for name in places)
    end = flag(tool.top_fixed, "held", "free")
    return f"squash over l: {lengths}, upper end {end}", f"material: {constants}"


def _radii(nodes: np.ndarray, r0: np.ndarray, thickness: np.ndarray) -> np.ndarray:
    return r0[..., None] / (thickness / np.diff(nodes)) ** 0.5
