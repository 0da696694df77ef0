"""``ipopt``: IPOPT (Waechter and Biegler 2006) through CasADi, in the slack form.

The energy is written once more in CasADi's symbols, which give IPOPT exact sparse
derivatives.  The scene's numbers are parameters, weights and spacings of the sums among
them, so a solver built for a number of slices and a set of free nodes serves every
problem that shares them.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import accumulate

import numpy as np

from jaxclay.experiments.peers.base import NEAR, Limits, Peer, Task
from jaxclay.experiments.peers.slack import slack_form
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.sums import Displaced, Sums

_LIMITS_REACHED = (
    "Maximum_Iterations_Exceeded",
    "Maximum_CpuTime_Exceeded",
    "Maximum_WallTime_Exceeded",
)
_OPTIONS = {
    "bound_relax_factor": 0.0,  # otherwise energies come out below the feasible minimum
    "mu_strategy": "adaptive",  # monotone takes half as many iterations again
    # By default a rough start, steep with the printed constants, scales friction out of sight.
    "nlp_scaling_max_gradient": 1e4,
    "bound_push": NEAR,
    "bound_frac": NEAR,
    "print_level": 0,
    "sb": "yes",
}


def _setup(problem: Problem, start: Displaced, limits: Limits) -> Task:
    form, material = slack_form(problem, start), problem.material
    solver = _solver(problem.slices, form.free.tobytes(), form.loose.tobytes(), limits)
    numbers = (
        *(problem.rest.thickness, form.base.thickness, *_spacings(problem.sums)),
        form.friction[form.thicknesses :],
        np.array([problem.rest.r0, material.k, material.alpha, material.beta]),
    )
    arguments = {
        "x0": form.start(NEAR),
        "p": np.concatenate(numbers),
        "lbx": form.lower,
        "lbg": form.target,
        "ubg": form.target,
    }

    def solve():
        return solver(**arguments), solver.stats()

    def read(answer):
        found, stats = answer
        finished = stats["return_status"] not in _LIMITS_REACHED
        return form.read(found["x"].full().ravel(), stats["iter_count"], finished)

    return Task(solve, read)


@lru_cache(maxsize=64)
def _solver(n: int, free: bytes, loose: bytes, limits: Limits):
    """IPOPT for n slices of which ``free`` nodes and ``loose`` slices, bool arrays, can move."""
    import casadi as ca

    nodes = np.flatnonzero(np.frombuffer(free, bool)).tolist()
    slices = np.flatnonzero(np.frombuffer(loose, bool)).tolist()
    x = ca.SX.sym("x", len(slices) + 2 * len(nodes))
    counts = [n, n, n, n, n - 1, n - 1, n - 2, 2 * len(nodes), 4]
    parameters = ca.SX.sym("p", sum(counts))
    rest, base, *spacings, friction, constants = _split(ca, parameters, counts)
    t, p, q = _split(ca, x, [len(slices), len(nodes), len(nodes)])
    thickness = ca.SX(base)
    thickness[slices] = t
    shift = ca.SX(n + 1, 1)
    shift[nodes] = p - q
    options = {f"ipopt.{name}": value for name, value in _OPTIONS.items()}
    options |= {"ipopt.max_iter": limits.max_iterations, "ipopt.tol": limits.tolerance}
    options["ipopt.max_wall_time"] = limits.seconds
    functions = {
        "x": x,
        "p": parameters,
        "f": _smooth(ca, thickness, rest, spacings, constants) + ca.dot(friction, x[len(slices) :]),
        "g": t - (shift[1:] - shift[:-1])[slices],
    }
    return ca.nlpsol("peer", "ipopt", functions, options | {"print_time": False})


def _split(ca, values, counts: list[int]):
    """Parts of a column, so many numbers each."""
    return ca.vertsplit(values, [0, *accumulate(counts)])


def _spacings(sums: Sums) -> tuple[np.ndarray, ...]:
    """What the energy needs of the sums beside friction's weights: widths first."""
    return sums.width, sums.slices, sums.apart, sums.between, sums.turn


def _smooth(ca, t, rest, spacings, constants):
    """n times strain, tension and bending of eqs. 9, 20-22, from thicknesses."""
    width, slices, apart, between, turn = spacings
    r0, k, alpha, beta = ca.vertsplit(constants)
    X, Y_u = r0 / ca.sqrt(t / width), t / width
    X_u, Y_uu = ca.diff(X) / apart, ca.diff(Y_u) / apart
    X_uu = ca.diff(X_u) / turn
    energy = (
        ca.dot(slices, k / 2 * (t / rest - 1) ** 2 + alpha * Y_u**2)
        + ca.dot(between, alpha * X_u**2 + beta * Y_uu**2)
        + ca.dot(turn, beta * X_uu**2)
    )
    return t.numel() * energy


PEER = Peer(
    ("casadi",),
    _setup,
    Limits(max_iterations=500, tolerance=1e-12),
    "IPOPT through CasADi: interior point, exact sparse derivatives, friction's slack pair",
)
