"""What a comparison runs: scenes, methods, peers and grids."""

from __future__ import annotations

import dataclasses

from jaxclay.experiments.compare.scenes import Scene

# What a comparison runs unless told otherwise, within minutes; the others can be asked for.
DEFAULT_METHODS = (
    "newton",
    "lbfgs",
    "lbfgs-preconditioned",
    "optax-lbfgs",
    "greedy",
    "greedy-refined",
)


@dataclasses.dataclass(frozen=True)
class Plan:
    """What to run.

    Attributes
    ----------
    scenes : list of Scene
    methods : list of names from METHODS
    peers : list of names from PEERS
    slices : list of int, the table's grids
    grids : list of int
        Grids of the contour-error chart, for the scenes in ``on_grids``.
    finest : int
        The grid whose certified minimum contour errors are measured from.
    on_grids, on_ladders : sets of scene names
    repeats : int
        Timed runs of each answer, more of short ones, two of long ones; the median counts.
    """

    scenes: list[Scene]
    methods: list[str]
    peers: list[str]
    slices: list[int]
    grids: list[int]
    finest: int
    on_grids: frozenset[str]
    on_ladders: frozenset[str]
    repeats: int = 5

    @property
    def contestants(self) -> list[str]:
        """Methods, then peers."""
        return [*self.methods, *self.peers]

    def jobs(self) -> list[Job]:
        """Every scene, units and grid that is run, coarse grids first."""
        jobs = []
        for scene in self.scenes:
            slices = set(self.slices)
            if scene.name in self.on_grids:
                slices |= set(self.grids)
            usable = sorted(n for n in slices if n >= scene.fewest_slices) or [scene.fewest_slices]
            for units in scene.units:
                first = next((n for n in usable if n in self.slices), usable[0])
                for n in usable:
                    kind = "answer" if n in self.slices or n == first else "grid"
                    jobs.append(Job(scene, units, n, kind, n == first))
        return jobs


@dataclasses.dataclass(frozen=True)
class Job:
    """One scene in one of the units on one grid; ladders and overlays show the table's first."""

    scene: Scene
    units: str
    slices: int
    experiment: str
    shown: bool
