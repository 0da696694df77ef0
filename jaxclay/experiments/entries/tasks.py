"""Tasks: one solve each, with a key that says whether it has been done."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import importlib.metadata
import itertools
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import jax

from jaxclay.experiments.contestants import contestant, takes_splines
from jaxclay.experiments.entries.settings import all_settings, static_settings
from jaxclay.experiments.entries.specification import Specification, hashed, specifications
from jaxclay.experiments.entries.tables import (
    Choices,
    DiscretisationTable,
    Experiment,
    MethodTable,
    PartTable,
    ScenesTable,
)
from jaxclay.experiments.peers import PEERS

_CONTINUUM = 1024  # placed slices of the answers that stand for the continuum
_PACKAGES = ("jax", "jaxlib", "jaxopt", "optax", "numpy")  # on which answers depend
_NOT_SOLVING = ("charts", "packaged", "command.py", "options.py", "report.py", "agree.py",
                "progress.py", "results.py", "summary.py", "store.py")  # fmt: skip
Settings = tuple[tuple[str, float], ...]


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


@dataclasses.dataclass(frozen=True)
class Task:
    """One solve.

    Attributes
    ----------
    specification : Specification
    kind : str
        "throughput", or "timing": solved alone, repeatedly.
    discretisation : Discretisation
    method : str
        A method or a peer.
    settings : tuple of (name, value)
        The method's, where they are not its defaults.
    stops : tuple of int
        Iterations after which runs are ended, for the trace of the energy.
    repeats : int
        Timed runs.
    call : str
        What is timed, "minimize" or "deform".
    precision : str
    budget : float
        Seconds; 0 for as many as it takes.
    first : bool
        Whether the first answer of a process is timed too.
    continuum : int
        Placed slices of the answer that contours are compared with as well; 0 for none.
    threads : int
        Of XLA, in the process that solves.
    after : str
        Key of the same task on fewer slices: what was out of time there is not tried.
    """

    specification: Specification
    kind: str
    discretisation: Discretisation
    method: str
    settings: Settings
    stops: tuple[int, ...] = ()
    repeats: int = 1
    call: str = "minimize"
    precision: str = "float64"
    budget: float = 0.0
    first: bool = False
    continuum: int = 0
    threads: int = 1
    after: str = ""

    @property
    def shape(self) -> tuple:
        """What one compiled call serves; sorted, coarse comes before fine."""
        d = self.discretisation
        size = d.slices or d.elements
        return (
            d.scheme, d.spacing, d.degree, self.precision, self.method, size, d.tolerance,
            self.budget > 0, static_settings(self.method, dict(self.settings)),
        )  # fmt: skip

    @functools.cached_property
    def key(self) -> str:
        """A hash of all that determines the result, and of nothing else."""
        inputs = dataclasses.asdict(self) | {"specification": self.specification.key, "after": ""}
        return hashed([inputs, identity(), self.packages])[:20]

    @property
    def packages(self) -> dict[str, str]:
        """Versions of what a peer is made of."""
        return versions(PEERS[self.method].packages if self.method in PEERS else ())

    @property
    def chosen(self) -> str:
        """The settings in words, all digits of them."""
        return ", ".join(f"{name}={_short(value)}" for name, value in self.settings)

    def described(self) -> str:
        """The task in a few words."""
        s, size = self.specification, self.discretisation.described()
        words = [self.method, self.chosen, self.precision if self.precision != "float64" else ""]
        return f"{s.name} {s.number} ({s.units}, {size}): {' '.join(filter(None, words))}"


def _short(value: float) -> str:
    return f"{value:g}" if float(f"{value:g}") == value else repr(value)


@functools.cache
def identity() -> dict[str, str]:
    """What solves, and on what: results of different ones are different results."""
    return {"code": _code(), "device": device(), **versions(_PACKAGES)}


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Of packages, "none" of one that is not installed."""
    installed = {}
    for name in packages:
        installed[name] = "none"
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            installed[name] = importlib.metadata.version(name)
    return installed


@functools.cache
def _code() -> str:
    """A hash of the package's modules that solve."""
    package = Path(__file__).parents[2]
    digest = hashlib.sha256()
    for room in ("numerics", "clay", "model", "schemes", "methods", "solve", "experiments"):
        for path in sorted((package / room).rglob("*.py")):
            within = path.relative_to(package / room)
            if room != "experiments" or within.parts[0] not in _NOT_SOLVING:
                digest.update(f"{room}/{within}".encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@functools.cache
def device() -> str:
    """Where solves run, such as "cpu" or "gpu NVIDIA H100"."""
    first = jax.devices()[0]
    kind = "" if first.device_kind == first.platform else f" {first.device_kind}"
    return f"{first.platform}{kind}"


def tasks(experiment: Experiment, threads: int = 1) -> list[Task]:
    """Every task of the experiment once, those of one shape together, coarse before fine."""
    found: dict[str, Task] = {}
    for part in experiment.parts or [PartTable()]:
        for task in _of_part(experiment, part, threads):
            found.setdefault(task.key, task)
    return sorted(found.values(), key=lambda task: (task.shape, not task.first))


def _of_part(experiment: Experiment, part: PartTable, threads: int) -> Iterator[Task]:
    timing = experiment.kind == "timing"
    scenes: list[ScenesTable] = _said(part, experiment, "scenes")
    methods: list[MethodTable] = _said(part, experiment, "methods")
    sizes = {j: list(_sizes(experiment, part, method)) for j, method in enumerate(methods)}
    among = [size for each in sizes.values() for size in each]
    chosen = [one for each in specifications(scenes, experiment.seed) for one in each[: part.first]]
    common = {
        "kind": experiment.kind,
        "repeats": experiment.repeats if timing else 1,
        "call": experiment.call,
        "budget": _said(part, experiment, "budget") or 0.0,
        "first": _said(part, experiment, "first_answers"),
        "continuum": _continuum(_said(part, experiment, "continuum"), among),
        "threads": threads,
    }
    for specification, (j, method) in itertools.product(chosen, enumerate(methods)):
        stops = _stops(part if method.stops is None else method)
        for precision in _said(part, experiment, "precisions"):
            coarser: dict[tuple, str] = {}
            for size in sizes[j]:
                for settings in _settings(method, size, part.ladder):
                    more = common | {"precision": precision}
                    task = Task(specification, discretisation=size, method=method.name,
                                settings=settings, stops=stops, **more)  # fmt: skip
                    if part.coarse_to_fine and method.name != "newton":
                        line = (size.scheme, size.spacing, size.degree, settings)
                        task = dataclasses.replace(task, after=coarser.get(line, ""))
                        coarser[line] = task.key
                    yield task


def _said(part: Choices, experiment: Choices, name: str) -> Any:
    """What a part says, else what the experiment says for all."""
    return getattr(part if name in part.model_fields_set else experiment, name)


def _stops(table: MethodTable | PartTable) -> tuple[int, ...]:
    return tuple(int(stop) for stop in table.stops.fixed()) if table.stops else ()


def _continuum(asked: int | None, sizes: list[Discretisation]) -> int:
    if asked is not None:
        return asked
    wanted = any(size.scheme == "spline" or size.placed for size in sizes)
    return _CONTINUUM if wanted else 0


def _sizes(
    experiment: Experiment, part: PartTable, method: MethodTable
) -> Iterator[Discretisation]:
    """The discretisations that a method takes, coarse before fine."""
    named: list[DiscretisationTable] | None = _said(part, experiment, "discretisations")
    if named is None and experiment.parts is None:
        yield from _shorter(experiment, method)
        return
    if named is None:
        named = [DiscretisationTable(scheme="paper", slices=experiment.slices)]
    for table in named:
        able = table.scheme != "spline" or takes_splines(method.name)
        able &= not (method.name in PEERS and table.slices is None)
        if able and (method.schemes is None or table.scheme in method.schemes):
            yield from _of_table(table)


def _of_table(table: DiscretisationTable) -> Iterator[Discretisation]:
    spacing = table.spacing or ("placed" if table.scheme == "slices" else "")
    if table.slices is not None:
        yield from (
            Discretisation(table.scheme, spacing, slices=int(n)) for n in table.slices.fixed()
        )
    if table.tolerance is not None:
        yield from (
            Discretisation(table.scheme, "placed", tolerance=float(t))
            for t in table.tolerance.fixed()
        )
    if table.elements is not None:
        for degree in table.degree.fixed() if table.degree else [5]:
            yield from (
                Discretisation("spline", "", int(degree), elements=int(count))
                for count in table.elements.fixed()
            )


def _shorter(experiment: Experiment, method: MethodTable) -> Iterator[Discretisation]:
    """From the experiment's slices, elements and tolerances, and the method's schemes."""
    for scheme in method.schemes or ["paper"]:
        if scheme == "spline":
            counts = experiment.elements.fixed()
            yield from (Discretisation("spline", "", 5, elements=int(n)) for n in counts)
            continue
        spacing = "equal" if scheme == "slices" else ""
        sizes = experiment.slices.fixed()
        yield from (Discretisation(scheme, spacing, slices=int(n)) for n in sizes)
        if scheme == "slices" and method.name == "newton":
            bounds = experiment.tolerances.fixed()
            yield from (Discretisation(scheme, "placed", tolerance=float(t)) for t in bounds)


def _settings(method: MethodTable, size: Discretisation, ladder: bool) -> list[Settings]:
    """Every combination, without what is the default anyway."""
    defaults = all_settings(method.name, {}, size.scheme)
    names = sorted(method.settings)
    values = [method.settings[name].fixed() for name in names]
    every = [dict(zip(names, each, strict=True)) for each in itertools.product(*values)]
    rungs = contestant(method.name)
    if ladder:
        every = [every[0] | {rungs.setting: rung} for rung in rungs.ladder]
    kept = ({n: v for n, v in one.items() if v != defaults[n]} for one in every)
    return list(dict.fromkeys(tuple(sorted(one.items())) for one in kept))


def batches(todo: list[Task], sizes: dict[Any, int]) -> Iterator[list[Task]]:
    """The tasks in lists of one shape, each no longer than ``sizes`` allows its shape."""
    for shape, group in itertools.groupby(todo, key=lambda task: task.shape):
        same = list(group)
        for begin in range(0, len(same), sizes[shape]):
            yield same[begin : begin + sizes[shape]]
