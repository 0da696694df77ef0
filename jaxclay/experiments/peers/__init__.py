"""Established solvers from outside, checked by jaxclay's certificate (extra ``peers``).

    ready = prepare("ipopt", problem)   # all that comes before solving
    answer = ready.solve()              # the solver's own work, to be timed
    solution = ready.certify(answer)      # a Solution, with its certificate

Nothing here helps a solver: its answer is read off as it stands, and only the
certificate can call it converged.  To time one, hold BLAS to one thread, as the
comparison does (``threadpoolctl.threadpool_limits(1)``): the matrices are small.
"""

from __future__ import annotations

import dataclasses
import importlib
from typing import Any

import jax
import numpy as np

from jaxclay.experiments.peers import with_ipopt, with_optimistix, with_qp, with_scipy
from jaxclay.experiments.peers.base import Limits, Peer, Task
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.checks import needing
from jaxclay.numerics.host import as_float64
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.rough import RoughShape, rough_shape
from jaxclay.solve.minimize import conclude
from jaxclay.solve.solution import Solution
from jaxclay.solve.start import start_from

PEERS: dict[str, Peer] = {
    "ipopt": with_ipopt.PEER,
    "scipy-lbfgsb": with_scipy.LBFGSB,
    "scipy-trust-constr": with_scipy.TRUST_CONSTR,
    "optimistix-bfgs": with_optimistix.PEER,
    "clarabel": with_qp.CLARABEL,
    "piqp": with_qp.PIQP,
}


@dataclasses.dataclass(frozen=True)
class Prepared:
    """A problem in the hands of the peer ``name``; see :func:`prepare`."""

    name: str
    problem: Problem
    rough: RoughShape
    task: Task

    def solve(self) -> Any:
        """The solver's own work and nothing else; can be called again and again."""
        return self.task.solve()

    def certify(self, answer: Any) -> Solution:
        """What ``solve`` returned as a :class:`jaxclay.Solution`, with its certificate."""
        return conclude(self.problem, self.rough, self.task.read(answer), self.name)


def prepare(
    name: str,
    problem: Problem,
    start: Array | None = None,
    max_iterations: int | None = None,
    tolerance: float | None = None,
    seconds: float | None = None,
) -> Prepared:
    """Hand a problem to a peer, up to the point where only solving is left.

    Parameters
    ----------
    name : str
        A key of :data:`PEERS`.
    problem : Problem
        From :func:`jaxclay.pose`.
    start : (n+1,) array, optional
        Heights to start from, in the clay's length unit; the rough shape if not given.
    max_iterations, tolerance : optional
        The peer's own defaults if not given.  What a tolerance bounds differs
        from peer to peer.
    seconds : float, optional
        Most that a solve takes, where the solver can be told; 2 if not given.

    Raises
    ------
    ValueError
        An unknown name, or a problem that the peer cannot take.
    ImportError
        The peer's library is missing.
    """
    peer = checked(name)
    reason = refusal(name, problem)
    if reason:
        raise ValueError(f"{name} {reason}")
    limits = Limits(
        peer.limits.max_iterations if max_iterations is None else int(max_iterations),
        peer.limits.tolerance if tolerance is None else float(tolerance),
        peer.limits.seconds if seconds is None else float(seconds),
    )
    rough = rough_shape(problem)
    point = rough.point if start is None else start_from(problem, start)
    with jax.enable_x64(True):
        task = peer.setup(*as_float64((problem, point)), limits)
    return Prepared(name, problem, rough, task)


def checked(name: str) -> Peer:
    """The peer of that name, its library imported.

    Raises
    ------
    ValueError
        There is none.
    ImportError
        Its library is missing.
    """
    if name not in PEERS:
        raise ValueError(f"unknown peer {name!r}: choose from {', '.join(PEERS)}")
    for package in PEERS[name].packages:
        with needing("peers", f"the peer {name}"):
            importlib.import_module(package)
    return PEERS[name]


def refusal(name: str, problem: Problem) -> str:
    """Why a peer cannot take a problem, or nothing."""
    material = problem.material
    if PEERS[name].move_only and (np.asarray(material.alpha) > 0 or np.asarray(material.beta) > 0):
        return "solves E_move alone: alpha and beta must be 0"
    return ""
