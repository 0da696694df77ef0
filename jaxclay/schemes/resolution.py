"""How many slices float64 can resolve: bending against the clay's own softness.

Bending ties heights by beta times their third differences over h^3, squared; a
free end gives way with about k, or with bending's own softness where beta is
larger.  Between the two lies a factor that grows as n^6, and rounding hides
what lies too far below, though thicknesses beside heights put that off.
"""

from __future__ import annotations

import numpy as np

from jaxclay.numerics.arrays import Array
from jaxclay.schemes.problem import Problem

# The factor beyond which answers begin to be refused: measured for n = 2048, 2700 and 4096,
# r0 from 0.25 to 1 and beta from 1e-6 to 10; all below it were certified.
_MOST = 4e18
_OWN = 10.0  # softness of bending over beta


def hidden_by_rounding(problem: Problem) -> Array:
    """Whether the piece has more slices than :func:`resolvable_slices`."""
    return _ratio(problem) * float(problem.slices) ** 6 > _MOST


def resolvable_slices(problem: Problem) -> int:
    """The largest number of slices of this clay and material that float64 resolves."""
    ratio = float(_ratio(problem))
    return int((_MOST / ratio) ** (1 / 6)) if ratio > 0 else np.iinfo(np.int64).max


def _ratio(problem: Problem) -> Array:
    """The factor over n^6, of the slice where it is largest; X^2 = r0^2 / Y_u."""
    thinnest = problem.rest.slopes().min()
    steepness = problem.rest.r0**2 / thinnest**3
    k, beta = problem.material.k, problem.material.beta
    return beta / (k + _OWN * beta) * steepness
