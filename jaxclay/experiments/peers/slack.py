"""The problem with friction's usual slack pair: smooth, all constraints linear and sparse.

Unknowns x = (t, p, q): the thicknesses of the loose slices, and p, q >= 0 at the
free nodes with Y - Y0 = p - q, so that |Y - Y0| = p + q at a minimum and the kink
is exact.  t_i = Y_{i+1} - Y_i is a linear equation, the floor a bound on t.  In t
the Hessian has half-bandwidth 2, diagonal for E_move, and none in p and q.

Energies are n times their share of E_total, those of a slice where all are equal: so
the numbers of every grid are alike.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jaxclay.experiments.peers.base import outcome
from jaxclay.methods.loop import Outcome
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.sums import Displaced

if TYPE_CHECKING:
    from scipy import sparse


class SlackForm(NamedTuple):
    """Minimise energy(t) + sum(friction x) over matrix x = target, x >= lower.

    Attributes
    ----------
    loose : (n,) bool array
    free : (n+1,) bool array
    matrix : sparse (number of t, number of x) array
    target : array
        One for each t.
    lower : array
        One for each x: the floor, then zeros.
    friction : array
        One for each x: zeros, then n times the limits of friction.
    base : Displaced
        The thicknesses and displacements that are not unknown, in their places.
    """

    loose: np.ndarray
    free: np.ndarray
    matrix: sparse.csc_array
    target: np.ndarray
    lower: np.ndarray
    friction: np.ndarray
    base: Displaced

    @property
    def thicknesses(self) -> int:
        """How many of the unknowns are thicknesses; they come first."""
        return int(self.loose.sum())

    def start(self, away: float) -> np.ndarray:
        """The unknowns of the base, p and q both ``away`` from their bounds."""
        shift = self.base.shift[self.free]
        pair = np.concatenate([np.maximum(shift, 0.0), np.maximum(-shift, 0.0)])
        return np.concatenate([self.base.thickness[self.loose], pair + away])

    def thickness(self, x: np.ndarray) -> np.ndarray:
        """(n,) thicknesses of all slices."""
        thickness = self.base.thickness.copy()
        thickness[self.loose] = x[: self.thicknesses]
        return thickness

    def read(self, x: np.ndarray, iterations: int, finished: bool) -> Outcome:
        """The outcome at x."""
        p, q = np.split(x[self.thicknesses :], 2)
        shift = self.base.shift.copy()
        shift[self.free] = p - q
        return outcome(self.thickness(x), shift, iterations, finished)


def slack_form(problem: Problem, start: Displaced) -> SlackForm:
    """The problem's constraints; ``start`` gives what is fixed, and where to begin."""
    from scipy import sparse

    n, rest = problem.slices, np.asarray(problem.rest.thickness)
    free, loose = np.asarray(problem.free), np.asarray(problem.loose)
    base = Displaced(np.array(start.thickness), np.array(start.shift))
    differences = sparse.csr_array(np.diff(np.eye(n + 1), axis=0))
    moves = sparse.csc_array(differences[loose][:, free])
    fixed = np.where(free, 0.0, base.shift)
    m, limits = int(loose.sum()), n * np.asarray(problem.friction_limit)[free]
    return SlackForm(
        loose=loose,
        free=free,
        matrix=sparse.csc_array(sparse.hstack([sparse.eye_array(m), -moves, moves])),
        target=(rest + np.diff(fixed))[loose],
        lower=np.concatenate([np.asarray(problem.floor)[loose], np.zeros(2 * len(limits))]),
        friction=np.concatenate([np.zeros(m), limits, limits]),
        base=base,
    )
