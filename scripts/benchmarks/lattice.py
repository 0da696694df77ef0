"""Is a better basin near?  E_total is not convex, and a certificate only knows its own basin.

For each scene, newton's certified minimum is compared with what the lattice finds:

- lattices of several spacings around the minimum, the rough shape and the rest shape, each
  followed until nothing on it is better;
- the best contours through heights that the minimum does not take: a node here and there is put
  at the end of its labels, and dynamic programming lays the best contour through it.

Every contour that differs from the minimum is a fresh start for newton.  Prints a table; exits
with 1 and names the scene if any energy lies below the first minimum's.
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

import jaxclay
from jaxclay.experiments.scenes import Scene, packaged_scenes
from jaxclay.methods.lattice import best_on_lattice, label_steps
from jaxclay.numerics.checks import REFUSALS
from jaxclay.numerics.host import compiled, in_float64
from jaxclay.schemes.base import lifted
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.sums import Displaced

GRIDS = (32, 64)
LABELS = 15
SPACINGS = (0.1, 0.3, 1.0)  # of h l, the mean thickness of a slice
MOST_LATTICES = 100  # that a walk may take on one spacing
PUSHED = 8  # nodes that contours are laid through, at both ends of their labels
SAME = 1e-6  # of l: contours nearer than that are one
BACK = 1e-5  # of l: how near the minimum newton has to end from another contour
LOWER = 1e-9  # of E_free: what counts as a lower energy; certificates leave 1e-10 open
_LEGEND = """
searched: half-width of the widest lattice; E_total: of newton's certified minimum;
lattice, refined: least energy of the other contours, before and after newton, less E_total,
over E_free; back: how many of them newton brought back to the minimum"""


@dataclasses.dataclass
class Finding:
    """What was found around one minimum; energies are differences from its own, over E_free."""

    scene: str
    units: str
    slices: int
    minimum: jaxclay.Solution
    contours: int = 0
    back: int = 0
    lattice: float = np.inf
    refined: float = np.inf

    @property
    def better(self) -> bool:
        """Whether any energy lies below the minimum's."""
        return min(self.lattice, self.refined) < -LOWER

    @property
    def verdict(self) -> str:
        """In words."""
        if self.better:
            return "a better basin"
        elsewhere = self.contours - self.back
        return f"none better, {elsewhere} end elsewhere" if elsewhere else "no other found"


def search(name: str, units: str, minimum: jaxclay.Solution) -> Finding:
    """Search around a minimum, and refine by newton what differs from it."""
    problem = minimum.problem
    finding = Finding(name, units, problem.slices, minimum)
    unit, scale = float(problem.clay.unit), float(minimum.certificate.energy_free)

    def apart(heights: np.ndarray) -> float:
        return float(np.abs(heights - minimum.heights).max()) / unit

    for heights, energy in contours(minimum):
        if np.isinf(energy) or apart(heights) <= SAME:
            continue
        refined = jaxclay.minimize(problem, start=heights)
        finding.contours += 1
        finding.back += apart(refined.heights) <= BACK
        finding.lattice = min(finding.lattice, (energy - float(minimum.energy)) / scale)
        gap = float(refined.energy - minimum.energy) / scale
        finding.refined = min(finding.refined, gap)
    return finding


def contours(minimum: jaxclay.Solution) -> Iterator[tuple[np.ndarray, float]]:
    """Heights and energies of what the lattice finds; inf where the lower bound forbids it."""
    problem = minimum.problem
    rest = in_float64("lattice", _rest, problem)
    for spacing in SPACINGS:
        spacing /= problem.slices
        for start in (minimum.heights, minimum.rough.heights, rest):
            found = jaxclay.minimize(
                problem,
                "lattice",
                start,
                labels=LABELS,
                spacing=spacing,
                smallest_spacing=spacing,
                max_iterations=MOST_LATTICES,
            )
            yield found.heights, float(found.energy)
        free = np.flatnonzero(problem.free)
        nodes = free[np.linspace(0, len(free) - 1, PUSHED).astype(int)]
        yield from zip(
            *in_float64("lattice", _through, problem, minimum.heights, spacing, nodes), strict=True
        )


@compiled()
def _rest(problem: Problem) -> jax.Array:
    """Heights at rest but for the band, and what makes space for it."""
    rest = Displaced(problem.rest.thickness, jnp.zeros_like(problem.shift))
    return problem.shape(lifted(problem, problem.imposed(rest))).heights


@compiled()
def _through(problem: Problem, heights, spacing, nodes) -> tuple[jax.Array, jax.Array]:
    """The best contours on the lattice with each node at its lowest and its highest label."""
    point = problem.imposed(problem.point(heights))
    steps = label_steps(problem, point, spacing, LABELS)

    def through(node, label):
        move, energy = best_on_lattice(problem, point, steps.at[node].set(steps[node, label]))
        return problem.shape(point.moved(move)).heights, energy

    nodes = jnp.repeat(nodes.astype(int), 2)
    return jax.vmap(through)(nodes, jnp.tile(jnp.array([0, LABELS - 1]), PUSHED))


def cases() -> list[tuple[Scene, str, int]]:
    """Every scene, units and grid; scenes that need a finer grid on the coarsest that they allow.

    fig5 is fig4a's second stage, the same solve.
    """
    scenes = [scene for scene in packaged_scenes().values() if scene.name != "fig5"]
    return [
        (scene, units, n)
        for scene in scenes
        for units in scene.units
        for n in [n for n in GRIDS if n >= scene.fewest_slices] or [scene.fewest_slices]
    ]


def main() -> int:
    """Search every case and print what was found."""
    console = Console()
    findings: list[Finding] = []
    skipped: list[str] = []
    columns = TextColumn("{task.description:<20}"), BarColumn(), MofNCompleteColumn()
    with Progress(*columns, TimeElapsedColumn(), console=Console(stderr=True)) as progress:
        task = progress.add_task("", total=len(cases()))
        for scene, units, n in cases():
            name = f"{scene.name} {units} {n}"
            progress.update(task, description=name)
            try:
                minimum = jaxclay.minimize(scene.problems(units, n)[-1]).raise_for_status()
                findings.append(search(scene.name, units, minimum))
            except REFUSALS as error:
                skipped.append(f"skipped {name}: {error}")
            progress.advance(task)
    console.print(as_table(findings), _LEGEND)
    better = [f"a better basin: {f.scene} {f.units} {f.slices}" for f in findings if f.better]
    for line in skipped + better:
        console.print(line, highlight=False, soft_wrap=True)
    return 1 if better else 0


def as_table(findings: list[Finding]) -> Table:
    """A line a case."""
    table = Table(box=None)
    for name in ("scene", "units"):
        table.add_column(name)
    for name in ("slices", "searched", "E_total", "lattice", "refined", "back"):
        table.add_column(name, justify="right")
    table.add_column("verdict")
    for f in findings:
        widest = SPACINGS[-1] / f.slices * (LABELS // 2)
        numbers = f"{float(f.minimum.energy):.8g}", f"{f.lattice:+.1e}", f"{f.refined:+.1e}"
        back = f"{f.back}/{f.contours}"
        table.add_row(f.scene, f.units, str(f.slices), f"{widest:.2f} l", *numbers, back, f.verdict)
    return table


if __name__ == "__main__":
    sys.exit(main())
