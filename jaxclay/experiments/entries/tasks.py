"""Tasks: one solve each, with a key that says whether it has been done."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Iterable, Iterator
from typing import Any

from jaxclay.experiments.contestants import contestant
from jaxclay.experiments.entries.specification import Specification, hashed, specifications
from jaxclay.experiments.entries.tables import (
    Discretisation,
    DiscretisationTable,
    Experiment,
    MethodTable,
    PartTable,
)
from jaxclay.experiments.entries.values import all_settings, combinations, static_settings
from jaxclay.experiments.machine import identity, versions
from jaxclay.experiments.peers import PEERS

_CONTINUUM = 1024  # placed slices of the answers that stand for the continuum
Settings = tuple[tuple[str, float], ...]


@dataclasses.dataclass(frozen=True)
class Task:
    """One solve."""

    specification: Specification
    kind: str  # "throughput", or "timing": solved alone, repeatedly
    discretisation: Discretisation
    method: str  # a method or a peer
    settings: Settings  # the method's, where they are not its defaults
    stops: tuple[int, ...] = ()  # iterations after which runs are ended, for the energy's trace
    repeats: int = 1  # timed runs
    call: str = "minimize"  # what is timed, or "deform"
    precision: str = "float64"
    budget: float = 0.0  # seconds; 0 for as many as it takes
    first: bool = False  # whether the first answer of a process is timed too
    continuum: int = 0  # placed slices of what contours are compared with as well; 0 for none
    threads: int = 1  # of XLA, in the process that solves
    after: str = ""  # key of the same on fewer slices: what was out of time there is not tried

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


def tasks(experiment: Experiment, threads: int = 1) -> list[Task]:
    """Every task of the experiment once, those of one shape together, coarse before fine."""
    found: dict[str, Task] = {}
    for part in experiment.parts or [PartTable()]:
        for task in _of_part(experiment, part.within(experiment), threads):
            found.setdefault(task.key, task)
    return sorted(found.values(), key=lambda task: (task.shape, not task.first))


def _of_part(experiment: Experiment, part: PartTable, threads: int) -> Iterator[Task]:
    tried = [(method, list(_sizes(experiment, part, method))) for method in part.methods or ()]
    every = specifications(part.scenes or [], experiment.seed)
    chosen = [specification for each in every for specification in each[: part.first]]
    continuum = part.continuum
    if continuum is None:
        bent = any(size.scheme == "spline" or size.placed for _, sizes in tried for size in sizes)
        continuum = _CONTINUUM if bent else 0
    common: dict[str, Any] = {
        "kind": experiment.kind,
        "repeats": experiment.repeats if experiment.kind == "timing" else 1,
        "call": experiment.call,
        "budget": part.budget or 0.0,
        "first": part.first_answers,
        "continuum": continuum,
        "threads": threads,
    }
    for specification, (method, sizes) in itertools.product(chosen, tried):
        stops = part.stops if method.stops is None else method.stops
        common["stops"] = tuple(int(stop) for stop in stops.fixed()) if stops else ()
        for precision in part.precisions:
            coarser: dict[tuple, str] = {}
            for size in sizes:
                for settings in _settings(method, size, part.ladder):
                    task = Task(specification, discretisation=size, method=method.name,
                                settings=settings, precision=precision, **common)  # fmt: skip
                    if part.coarse_to_fine and method.name != "newton":
                        line = (size.scheme, size.spacing, size.degree, settings)
                        task = dataclasses.replace(task, after=coarser.get(line, ""))
                        coarser[line] = task.key
                    yield task


def _sizes(
    experiment: Experiment, part: PartTable, method: MethodTable
) -> Iterator[Discretisation]:
    """The discretisations that a method takes, coarse before fine."""
    named: Iterable[DiscretisationTable] | None = part.discretisations
    schemes = method.schemes
    if named is None:
        named, schemes = experiment.shorter(method.name), schemes or ["paper"]
    for table in named:
        if table.taken_by(method.name) and (schemes is None or table.scheme in schemes):
            yield from table.sizes()


def _settings(method: MethodTable, size: Discretisation, ladder: bool) -> list[Settings]:
    """Every combination, without what is the default anyway."""
    defaults = all_settings(method.name, {}, size.scheme)
    every = combinations(method.settings)
    rungs = contestant(method.name)
    if ladder:
        every = [every[0] | {rungs.setting: rung} for rung in rungs.ladder]
    kept = ({name: v for name, v in one.items() if v != defaults[name]} for one in every)
    return list(dict.fromkeys(tuple(sorted(one.items())) for one in kept))
