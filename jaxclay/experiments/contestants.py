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
_STEPS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)


class Contestant(NamedTuple):
    """Its looks, a colour of the palette first, and its ladder, a setting from loose to tight."""

    colour: int
    marker: str
    line: str = "-"
    ladder: tuple[float, ...] = _TOLERANCES
    setting: str = "tolerance"


# Those of the default comparison come first, and so never share a colour.
CONTESTANTS: dict[str, Contestant] = {
    "newton": Contestant(0, "o", ladder=(1.0, 1e-1, 1e-2, 1e-4, 1e-6, 1e-8, 1e-11, 1e-14)),
    "lbfgs": Contestant(1, "s"),
    "lbfgs-preconditioned": Contestant(2, "D"),
    "optax-lbfgs": Contestant(3, "^"),
    "greedy": Contestant(4, "v", ladder=_STEPS[:5], setting="step"),
    "greedy-refined": Contestant(5, "*", ladder=_STEPS[1:6], setting="smallest_step"),
    "lbfgsb": Contestant(6, "P", ladder=_FINER),
    "projected-gradient": Contestant(7, "X", ladder=_FINER),
    "augmented-lagrangian": Contestant(0, "p", "-."),
    "adam": Contestant(1, "h", "-.", ladder=_FINER),
    "lattice": Contestant(2, "<", "-.", ladder=_STEPS, setting="smallest_spacing"),
    "ipopt": Contestant(6, "*", "--"),
    "scipy-lbfgsb": Contestant(5, "X", "--"),
    "scipy-trust-constr": Contestant(4, "p", "--"),
    "optimistix-bfgs": Contestant(3, "h", "--"),
    "clarabel": Contestant(2, "<", "--"),
    "piqp": Contestant(1, ">", "--"),
}

DEFAULT = ("newton", "lbfgs", "lbfgs-preconditioned", "optax-lbfgs", "greedy", "greedy-refined")
"""What a comparison runs unless told otherwise."""


class Ready(NamedTuple):
    """A problem in a contestant's hands."""

    call: Callable[[], Any]  # what is timed; can be called again and again
    certified: Callable[[Any], Solution]  # what its answer is worth


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

    Raises ValueError: What the contestant cannot take.
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
    return CONTESTANTS.get(name, Contestant(7, ".", ladder=(), setting=""))
