"""How many slices float64 can resolve: bending against the clay's own softness.

Bending ties heights by beta times their third differences over h^3, squared; a
free end gives way with about k.  Between the two lies a factor that grows as
n^6, and rounding hides what lies more than 2^52 below.
"""

from __future__ import annotations

import numpy as np

from jaxclay.clay import Array
from jaxclay.problem import Problem

# beta/k (X / Y_u)^2 n^6 beyond which answers begin to be refused; measured, see the atlas.
_MOST = 2e20


def hidden_by_rounding(problem: Problem) -> Array:
    """Whether the piece has more slices than :func:`resolvable_slices`."""
    return _ratio(problem) * float(problem.slices) ** 6 > _MOST


def resolvable_slices(problem: Problem) -> int:
    """The largest number of slices of this clay and material that float64 resolves."""
    ratio = float(_ratio(problem))
    return int((_MOST / ratio) ** (1 / 6)) if ratio > 0 else np.iinfo(np.int64).max


def _ratio(problem: Problem) -> Array:
    """beta/k (X / Y_u)^2 of the slice where it is largest; X^2 = r0^2 / Y_u."""
    thinnest = (problem.rest.thickness * problem.slices).min()
    steepness = problem.rest.r0**2 / thinnest**3
    return problem.material.beta / problem.material.k * steepness
