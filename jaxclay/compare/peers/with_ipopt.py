"""``ipopt``: IPOPT (Waechter and Biegler 2006) through CasADi, in the slack form.

The energy is written once more in CasADi's symbols, which give IPOPT exact sparse
derivatives.  The scene's numbers are parameters, so a solver built for a number
of slices and a set of free nodes serves every problem that shares them.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from jaxclay.compare.peers.base import NEAR, SECONDS, Limits, Peer, Task
from jaxclay.compare.peers.slack import slack_form
from jaxclay.problem import Problem
from jaxclay.schemes.paper import Point

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
    "max_wall_time": SECONDS,
    "print_level": 0,
    "sb": "yes",
}


def _setup(problem: Problem, start: Point, limits: Limits) -> Task:
    form, material = slack_form(problem, start), problem.material
    solver = _solver(problem.slices, form.free.tobytes(), form.loose.tobytes(), limits)
    constants = (problem.rest.r0, material.k, material.mu, material.alpha, material.beta)
    arguments = {
        "x0": form.start(NEAR),
        "p": np.concatenate([problem.rest.thickness, form.base.thickness, constants]),
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
    parameters = ca.SX.sym("p", 2 * n + 5)
    rest, base, constants = ca.vertsplit(parameters, [0, n, 2 * n, 2 * n + 5])
    r0, k, mu, alpha, beta = ca.vertsplit(constants)
    t, p, q = ca.vertsplit(
        x, [0, len(slices), len(slices) + len(nodes), len(slices) + 2 * len(nodes)]
    )
    thickness = ca.SX(base)
    thickness[slices] = t
    shift = ca.SX(n + 1, 1)
    shift[nodes] = p - q
    options = {f"ipopt.{name}": value for name, value in _OPTIONS.items()}
    options |= {"ipopt.max_iter": limits.max_iterations, "ipopt.tol": limits.tolerance}
    functions = {
        "x": x,
        "p": parameters,
        "f": _smooth(ca, n, thickness, rest, r0, k, alpha, beta) + mu * ca.sum1(p + q),
        "g": t - (shift[1:] - shift[:-1])[slices],
    }
    return ca.nlpsol("peer", "ipopt", functions, options | {"print_time": False})


def _smooth(ca, n: int, t, rest, r0, k, alpha, beta):
    """n times strain, tension and bending of eqs. 9, 20-22, from thicknesses."""
    X = r0 / ca.sqrt(n * t)
    X_u, X_uu = n * (X[1:] - X[:-1]), n**2 * (X[2:] - 2 * X[1:-1] + X[:-2])
    Y_u, Y_uu = n * t, n**2 * (t[1:] - t[:-1])
    return (
        k / 2 * ca.sumsqr(t / rest - 1)
        + alpha * (ca.sumsqr(X_u) + ca.sumsqr(Y_u))
        + beta * (ca.sumsqr(X_uu) + ca.sumsqr(Y_uu))
    )


PEER = Peer(
    ("casadi",),
    _setup,
    Limits(max_iterations=500, tolerance=1e-12),
    "IPOPT through CasADi: interior point, exact sparse derivatives, friction's slack pair",
)
