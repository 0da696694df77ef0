"""An answer on other nodes as a start."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxclay.numerics.interpolation import displacement
from jaxclay.schemes.base import lifted
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.sums import Displaced


def carried(problem: Problem, answer: Any) -> Displaced:
    """An answer to the same squash of the same clay as a displaced shape of the problem.

    Its displacement between nodes is cubic, broken at edges of tools, and nothing where it rests
    all around.
    """
    solved, point, nodes = answer.problem, answer.point, answer.problem.rest.material
    edges = np.append(solved.before.edges[:, 0], [solved.band.lower, solved.band.upper])
    change = point.thickness - solved.rest.thickness
    moved = displacement(nodes, point.shift, change, (nodes[:, None] == edges).any(axis=1))
    shift, change = moved.on(problem.rest.material)
    return lifted(problem, problem.imposed(Displaced(problem.rest.thickness + change, shift)))
