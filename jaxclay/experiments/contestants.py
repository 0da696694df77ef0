"""Contestants: the methods, and the peers from outside, behind one call.

:func:`prepare` hands a posed problem to one; what it returns can be called again and again, to be
timed, and says what an answer is worth.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from jaxclay.experiments import peers
from jaxclay.experiments.peers import PEERS
from jaxclay.experiments.precision import SINGLE, solve_in_single
from jaxclay.methods import METHODS
from jaxclay.solve.minimize import minimize
from jaxclay.solve.solution import Solution

_TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
_FINER = (*_TOLERANCES[:-1], 1e-13)


class Contestant(NamedTuple):
    """Its ladder, a setting from loose to tight, and its looks, a colour of the palette first."""

    setting: str
    ladder: tuple[float, ...]
    colour: int
    marker: str
    line: str = "-"


# Those of the default comparison come first, and so never share a colour.
CONTESTANTS: dict[str, Contestant] = {
    "newton": Contestant("tolerance", (1.0, 1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-11, 1e-14), 0, "o"),
    "lbfgs": Contestant("tolerance", _TOLERANCES, 1, "s"),
    "lbfgs-preconditioned": Contestant("tolerance", _TOLERANCES, 2, "D"),
    "optax-lbfgs": Contestant("tolerance", _TOLERANCES, 3, "^"),
    "greedy": Contestant("step", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6), 4, "v"),
    "greedy-refined": Contestant("smallest_step", (1e-3, 1e-4, 1e-5, 1e-6, 1e-7), 5, "*"),
    "lbfgsb": Contestant("tolerance", _FINER, 6, "P"),
    "projected-gradient": Contestant("tolerance", _FINER, 7, "X"),
    "augmented-lagrangian": Contestant("tolerance", _TOLERANCES, 0, "p", "-."),
    "adam": Contestant("tolerance", _FINER, 1, "h", "-."),
    "lattice": Contestant(
        "smallest_spacing", (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8), 2, "<", "-."
    ),
    "ipopt": Contestant("tolerance", _TOLERANCES, 6, "*", "--"),
    "scipy-lbfgsb": Contestant("tolerance", _TOLERANCES, 5, "X", "--"),
    "scipy-trust-constr": Contestant("tolerance", _TOLERANCES, 4, "p", "--"),
    "optimistix-bfgs": Contestant("tolerance", _TOLERANCES, 3, "h", "--"),
    "clarabel": Contestant("tolerance", _TOLERANCES, 2, "<", "--"),
    "piqp": Contestant("tolerance", _TOLERANCES, 1, ">", "--"),
}

DEFAULT = ("newton", "lbfgs", "lbfgs-preconditioned", "optax-lbfgs", "greedy", "greedy-refined")
"""What a comparison runs unless told otherwise."""


class Ready(NamedTuple):
    """A problem in a contestant's hands.

    Attributes
    ----------
    call : () -> answer
        What is timed; can be called again and again.
    certified : answer -> Solution
    """

    call: Callable[[], Any]
    certified: Callable[[Any], Solution]


def prepare(
    problem: Any,
    name: str,
    settings: dict[str, Any],
    precision: str = "float64",
    seconds: float | None = None,
) -> Ready:
    """Hand a posed problem to a contestant, up to the point where only solving is left.

    A method's call is :func:`jaxclay.minimize`, or its loop alone in float32.  ``seconds`` limits
    a peer's solve where it can be told.

    Raises
    ------
    ValueError
        What the contestant cannot take.
    """
    if name in PEERS:
        if precision == SINGLE:
            raise ValueError(f"{name} computes in float64 alone")
        ready = peers.prepare(name, problem, seconds=seconds, **settings)
        return Ready(ready.solve, ready.certify)
    if precision == SINGLE:
        return Ready(*solve_in_single(problem, name, settings))
    return Ready(lambda: minimize(problem, name, **settings), lambda answer: answer)


def check_contestant(name: str) -> None:
    """Raise ValueError of an unknown name, ImportError where a peer's library is missing."""
    if name in PEERS:
        peers.checked(name)  # imports it, before threads are limited
    elif name not in METHODS:
        known = ", ".join((*METHODS, *PEERS))
        raise ValueError(f"unknown method {name!r}: choose from {known}")


def takes_splines(name: str) -> bool:
    """Whether it knows the scheme "spline"."""
    return name in METHODS and METHODS[name].splines


def contestant(name: str) -> Contestant:
    """Its looks and its ladder; a method that was added elsewhere has none of its own."""
    return CONTESTANTS.get(name, Contestant("", (), 7, "."))
