"""Certified answers while a tool is dragged: on slices whose programs have been compiled.

A squash that stays is solved cold and by itself, so that a stroke repeated gives the same clay
bit for bit.  What is shown between two of them starts from the last one shown.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import NamedTuple

from jaxclay.clay.clay import Clay
from jaxclay.files.stroke import Solver
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash
from jaxclay.schemes.posing import pose
from jaxclay.schemes.slices.posing import place
from jaxclay.solve.minimize import minimize, newton_answer
from jaxclay.solve.refining import beside, followed, to_tolerance
from jaxclay.solve.smoothing import Smoothed, smooth
from jaxclay.solve.solution import Solution, Status

MOVING, RESTING = 1e-3, 1e-4  # tolerance of the contour over l, while the tool moves and rests
SIZES = (32, 64, 128, 256, 512)  # slices, compiled in this order
_SMOOTHER = 10.0  # times alpha and beta, where clay is smoothed
SMOOTHED_ON = 128  # slices at least, where clay is smoothed
UNCERTIFIED = ("greedy", "greedy-refined")  # methods of which nobody expects a certificate
OFFERED = ("newton", "lbfgs-preconditioned", "greedy", "greedy-refined")
SCHEMES = ("slices", "paper")
FIXED = (0, 64, 128, 256)  # slices that can be asked for; 0: as many as the tolerance needs


def check_offered(solver: Solver) -> None:
    """Raise unless the modeller solves in that way while a tool is dragged."""
    allowed = {"method": OFFERED, "scheme": SCHEMES, "slices": FIXED, "most": SIZES}
    for name, values in allowed.items():
        if getattr(solver, name) not in values:
            text = ", ".join(map(str, values))
            raise ValueError(f"{name} must be one of {text}, got {getattr(solver, name)!r}")


def is_adaptive(solver: Solver) -> bool:
    """Whether answers are to a tolerance."""
    return solver.slices == 0 and (solver.method, solver.scheme) == ("newton", "slices")


def press(
    solver: Solver, clay: Clay, squash: Squash, material: Material, tolerance: float, first: int
) -> Solution:
    """The answer, on ``first`` slices or more where it is to a tolerance.

    Where there is none on as many as that needs, the nearest one that is certified.
    """
    if not is_adaptive(solver):
        posed = pose(clay, squash, material, solver.scheme, slices=_fixed(solver))
        return minimize(posed, solver.method)
    found = place(clay, squash, material)
    sizes = [n for n in SIZES if min(first, solver.most) <= n <= solver.most]
    answer = followed(to_tolerance(found, tolerance, sizes), newton_answer)
    while not is_certified(answer, solver) and sizes[0] < sizes[-1]:
        sizes.pop()
        answer = followed(to_tolerance(found, tolerance, sizes), newton_answer)
    return answer


class Near(NamedTuple):
    """An answer to a squash close by."""

    answer: Solution
    pressed: Clay  # what was squashed: the same clay, or as it was a step before


def follow(
    solver: Solver, clay: Clay, squash: Squash, material: Material, near: Near, first: int
) -> Solution:
    """The answer to be shown on the way, on as many slices as one close by has if that will do."""
    if is_adaptive(solver):
        found, slices = place(clay, squash, material), near.answer.clay.slices
        plan = beside(found, slices, near.answer, near.pressed is clay)
        answer = followed(plan, newton_answer)
        if is_certified(answer, solver):
            return answer
    return press(solver, clay, squash, material, MOVING, first)


def is_certified(solution: Solution, solver: Solver) -> bool:
    """Whether clay may become that: the certificate accepts it, if not within the tolerance."""
    if solver.method in UNCERTIFIED:
        return solution.status in (Status.CONVERGED, Status.STALLED)
    return bool(solution.certificate.accepted)


def _fixed(solver: Solver) -> int:
    return solver.slices or 64


class Compilations:
    """Programs made ready in a thread of their own, so that nobody waits for the later ones.

    Parameters
    ----------
    told : callable
        Called in that thread when ``sizes`` or ``solvers`` have grown.
    """

    def __init__(self, told: Callable[[], None] = lambda: None):
        self.told = told
        self._ready: list[int] = []
        self._solvers: set[tuple[str, str, int]] = set()
        self._lock = threading.Lock()

    @property
    def most(self) -> int:
        """The most slices that are ready, 0 before the first."""
        return max(self._ready, default=0)

    @property
    def whole(self) -> bool:
        """Whether all sizes are ready."""
        return len(self._ready) == len(SIZES)

    def has(self, solver: Solver) -> bool:
        """Whether a stroke by it compiles nothing."""
        if (solver.method, solver.scheme) == ("newton", "slices"):
            return self.most >= (SIZES[0] if is_adaptive(solver) else _fixed(solver))
        return (solver.method, solver.scheme, _fixed(solver)) in self._solvers

    def run(self) -> None:
        """Compile all sizes, in this thread."""
        for slices in SIZES:
            if slices not in self._ready:
                _solve_once(Solver(), slices)
                self._ready.append(slices)
                self.told()

    def prepare(self, solver: Solver) -> None:
        """Compile what another method needs, in this thread."""
        with self._lock:
            if not self.has(solver):
                _solve_once(solver, _fixed(solver))
                self._solvers.add((solver.method, solver.scheme, _fixed(solver)))
        self.told()

    def start(self, solver: Solver | None = None) -> threading.Thread:
        """:meth:`run`, or :meth:`prepare` of a solver, in a thread."""
        target = self.run if solver is None else lambda: self.prepare(solver)
        thread = threading.Thread(target=target, daemon=True, name="jaxclay compilations")
        thread.start()
        return thread


def _solve_once(solver: Solver, slices: int) -> None:
    clay, squash = Clay.cylinder(0.4), Squash(0.4, 0.6, 0.39)
    material = Material.from_snake_units(alpha=10.0, beta=10.0)
    minimize(pose(clay, squash, material, solver.scheme, slices=slices), solver.method)


def smoothed(clay: Clay, material: Material, low: float, high: float, most: int) -> Smoothed:
    """Clay smoothed between two heights, ten times as much as elsewhere."""
    return smooth(clay, material, low, high, _SMOOTHER, _enough(clay, most))


def settled(clay: Clay, material: Material, most: int) -> Smoothed:
    """Clay as it settles with no tool near."""
    return smooth(clay, material, 0.0, 0.0, 1.0, _enough(clay, most))


def _enough(clay: Clay, most: int) -> int:
    """Slices for all of the clay's nodes, and not too few, if they are ready."""
    wanted = [n for n in SIZES if n >= max(clay.slices, SMOOTHED_ON)]
    return min([*wanted, most])
