"""What a peer is: an established solver from outside, set up apart from solving."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from jaxclay.methods.loop import Outcome
from jaxclay.schemes.base import Forces
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.sums import Displaced

SECONDS = 2.0  # most that a solve may take where the solver can be told
NEAR = 1e-3  # over the unit l: how far from its bounds an interior-point solve starts


class Limits(NamedTuple):
    """When a solver stops: after so many iterations or seconds, or within its kind of tolerance."""

    max_iterations: int
    tolerance: float
    seconds: float = SECONDS


class Task(NamedTuple):
    """A problem in a solver's hands.

    Attributes
    ----------
    solve : () -> answer
        The solver's own work and nothing else; can be called again and again.
    read : answer -> Outcome
        What :func:`jaxclay.minimize.conclude` certifies.
    """

    solve: Callable[[], Any]
    read: Callable[[Any], Outcome]


class Peer(NamedTuple):
    """A solver from outside as data.

    Attributes
    ----------
    packages : tuple of str
        What it imports, by the names that pip knows.
    setup : (problem, start, limits) -> Task
        Everything that comes before solving; called in float64, the problem's
        leaves are NumPy arrays.
    limits : Limits
        Its defaults.
    summary : str
        What it is and in which form it gets the problem.
    move_only : bool
        Whether it takes E_move alone, which is a convex quadratic and a 1-norm.
    """

    packages: tuple[str, ...]
    setup: Callable[[Problem, Displaced, Limits], Task]
    limits: Limits
    summary: str
    move_only: bool = False


def outcome(thickness, shift, iterations: int, finished: bool) -> Outcome:
    """The point that a solver ended at; the certificate reads the forces off it."""
    point = Displaced(np.array(thickness, float), np.array(shift, float))
    forces = Forces(np.zeros_like(point.shift), np.zeros_like(point.thickness))
    finite = np.isfinite(point.thickness).all() and np.isfinite(point.shift).all()
    return Outcome(point, forces, *map(np.asarray, (iterations, finished, finite)))
