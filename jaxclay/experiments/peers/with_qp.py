"""``clarabel`` and ``piqp``: convex interior-point solvers, for E_move alone.

Without tension and bending E_total is E_move (eq. 6), in the slack form a convex
quadratic programme: diagonal in the thicknesses, linear in friction's pair.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from jaxclay.experiments.peers.base import Limits, Peer, Task
from jaxclay.experiments.peers.slack import SlackForm, slack_form
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.sums import Displaced


def _quadratic(problem: Problem, form: SlackForm) -> tuple[Any, np.ndarray]:
    """P and c of n E_move = 1/2 x^T P x + c^T x + const.

    n E_move = sum k_i/2 (t_i / t0_i - 1)^2 + friction, k_i = k n times the slice's weight.
    """
    from scipy import sparse

    rest = np.asarray(problem.rest.thickness)[form.loose]
    k = float(problem.material.k) * problem.slices * np.asarray(problem.sums.slices)[form.loose]
    c = form.friction.copy()
    c[: form.thicknesses] = -k / rest
    diagonal = np.zeros_like(c)
    diagonal[: form.thicknesses] = k / rest**2
    return sparse.csc_array(sparse.diags_array(diagonal)), c


def _setup_clarabel(problem: Problem, start: Displaced, limits: Limits) -> Task:
    from scipy import sparse

    clarabel: Any = importlib.import_module("clarabel")  # compiled, without types

    form = slack_form(problem, start)
    P, c = _quadratic(problem, form)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.time_limit = limits.seconds
    settings.max_iter = limits.max_iterations
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = limits.tolerance
    rows = sparse.csc_array(sparse.vstack([form.matrix, -sparse.eye_array(len(c))]))
    right = np.concatenate([form.target, -form.lower])
    cones = [clarabel.ZeroConeT(len(form.target)), clarabel.NonnegativeConeT(len(c))]
    solver = clarabel.DefaultSolver(P, c, rows, right, cones, settings)
    reached = (clarabel.SolverStatus.MaxIterations, clarabel.SolverStatus.MaxTime)

    def read(answer):
        finished = answer.status not in reached
        return form.read(np.array(answer.x), answer.iterations, finished)

    return Task(solver.solve, read)


def _setup_piqp(problem: Problem, start: Displaced, limits: Limits) -> Task:
    import piqp

    form = slack_form(problem, start)
    P, c = _quadratic(problem, form)
    solver: Any = piqp.SparseSolver()
    settings = solver.settings
    settings.verbose = False
    settings.max_iter = limits.max_iterations
    settings.eps_abs = settings.eps_rel = limits.tolerance
    settings.eps_duality_gap_abs = settings.eps_duality_gap_rel = limits.tolerance
    above = np.full(len(c), np.inf)
    solver.setup(P, c, form.matrix, form.target, None, None, None, form.lower, above)

    def read(status):
        found = solver.result
        finished = status != piqp.PIQP_MAX_ITER_REACHED
        return form.read(np.array(found.x), found.info.iter, finished)

    return Task(solver.solve, read)


_LIMITS = Limits(max_iterations=200, tolerance=1e-12)
CLARABEL = Peer(
    ("clarabel",), _setup_clarabel, _LIMITS, "Clarabel: interior point for cones", move_only=True
)
PIQP = Peer(("piqp",), _setup_piqp, _LIMITS, "PIQP: proximal interior point", move_only=True)
