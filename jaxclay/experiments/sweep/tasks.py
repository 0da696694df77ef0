"""Tasks: one solve each, with a key that says whether it has been done."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import itertools
import json
from collections.abc import Iterable, Iterator
from typing import Any

import jax

from jaxclay.experiments.sweep.recipe import Recipe, recipes
from jaxclay.experiments.sweep.tables import Experiment, MethodTable
from jaxclay.version import __version__

DTYPE = "float64"
_REFERENCE = 1024  # placed slices of the answers that stand for the continuum


@dataclasses.dataclass(frozen=True)
class Task:
    """One solve.

    Attributes
    ----------
    recipe : Recipe
    kind : str
        "throughput", or "timing": solved alone, repeatedly.
    scheme, method : str
    slices : int
        0 for splines, and to a tolerance.
    elements : int
        Spans on each side of the band, for splines; 0 for slices.
    tolerance : float
        Of the contour over l; 0 on so many slices or spans.
    settings : tuple of (name, value)
        The method's; what is not here has its default.
    stops : tuple of int
        Iterations after which runs are ended, for the trace of the energy.
    repeats : int
        Timed runs.
    reference : int
        Placed slices of the answer that contours are compared with as well; 0 for none.
    """

    recipe: Recipe
    kind: str
    scheme: str
    method: str
    slices: int
    elements: int
    tolerance: float
    settings: tuple[tuple[str, float], ...]
    stops: tuple[int, ...]
    repeats: int
    reference: int

    @property
    def shape(self) -> tuple[str, str, int, float]:
        """What one compiled call serves."""
        return self.scheme, self.method, self.slices or self.elements, self.tolerance

    @functools.cached_property
    def key(self) -> str:
        """A hash of the inputs, the package's version, the dtype and the device."""
        inputs = dataclasses.asdict(self) | {"recipe": self.recipe.key}
        text = json.dumps({"task": inputs} | identity(), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:20]

    @property
    def chosen(self) -> str:
        """The settings in words, all digits of them."""
        return ", ".join(f"{name}={_short(value)}" for name, value in self.settings)

    def described(self) -> str:
        """The task in a few words."""
        kind = "second-order slices" if self.scheme == "slices" else "slices"
        size = f"{self.slices} {kind}" if self.slices else f"{self.elements} spans"
        size = f"{kind} to {self.tolerance:g}" if self.tolerance else size
        r = self.recipe
        with_settings = f" {self.chosen}" if self.chosen else ""
        return f"{r.name} {r.number} ({r.units}, {size}): {self.method}{with_settings}"


def _short(value: float) -> str:
    return f"{value:g}" if float(f"{value:g}") == value else repr(value)


def identity() -> dict[str, str]:
    """What solves, and on what: results of different ones are different results."""
    return {"jaxclay": __version__, "dtype": DTYPE, "device": device()}


@functools.cache
def device() -> str:
    """Where solves run, such as "cpu" or "gpu NVIDIA H100"."""
    first = jax.devices()[0]
    kind = "" if first.device_kind == first.platform else f" {first.device_kind}"
    return f"{first.platform}{kind}"


def tasks(experiment: Experiment) -> list[Task]:
    """Every task of the experiment once, those of one shape together."""
    continuum = experiment.elements.entries or experiment.tolerances.entries
    reference = _REFERENCE if continuum else 0
    timing = experiment.kind == "timing"
    found = [
        Task(
            recipe, experiment.kind, scheme, method.name, slices, elements, tolerance, settings,
            tuple(int(stop) for stop in method.stops.fixed()) if method.stops else (),
            experiment.repeats if timing else 1, reference,
        )
        for recipe in recipes(experiment)
        for method in experiment.methods
        for scheme, slices, elements, tolerance in _sizes(experiment, method)
        for settings in (_settings(method) if not tolerance else [()])
    ]  # fmt: skip
    once = {task.key: task for task in found}
    return sorted(once.values(), key=lambda task: task.shape)


def _sizes(experiment: Experiment, method: MethodTable) -> Iterator[tuple[str, int, int, float]]:
    """Scheme, slices, elements and tolerance."""
    for scheme in method.schemes:
        if scheme == "spline":
            yield from (("spline", 0, int(count), 0.0) for count in experiment.elements.fixed())
            continue
        yield from ((scheme, int(n), 0, 0.0) for n in experiment.slices.fixed())
        if scheme == "slices" and method.name == "newton":
            yield from ((scheme, 0, 0, float(tol)) for tol in experiment.tolerances.fixed())


def _settings(method: MethodTable) -> Iterable[tuple[tuple[str, float], ...]]:
    names = sorted(method.settings)
    values = [method.settings[name].fixed() for name in names]
    return [tuple(zip(names, each, strict=True)) for each in itertools.product(*values)]


def batches(todo: list[Task], sizes: dict[Any, int]) -> Iterator[list[Task]]:
    """The tasks in lists of one shape, each no longer than ``sizes`` allows its shape."""
    for shape, group in itertools.groupby(todo, key=lambda task: task.shape):
        same = list(group)
        for begin in range(0, len(same), sizes[shape]):
            yield same[begin : begin + sizes[shape]]
