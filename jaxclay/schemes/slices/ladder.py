"""An answer on other nodes as a start."""

from __future__ import annotations

from typing import Any

import numpy as np

from jaxclay.interpolation import interpolant
from jaxclay.methods.base import lifted
from jaxclay.problem import Problem
from jaxclay.schemes.sums import Point


def carried(problem: Problem, answer: Any) -> Point:
    """An answer to the same squash of the same clay as a point of the problem, above the floor.

    Its displacement between nodes is cubic, and nothing where it rests all around.
    """
    after, posed, band = answer.clay, answer.problem, problem.band
    before = posed.clay
    kept = after.edges[~np.isin(after.edges[:, 0], [band.lower, band.upper])]
    rest = interpolant(before.material, before.heights, before.thickness, kept, before.r0)
    shape, u, unit = after.interpolant, problem.rest.material, float(before.unit)
    shift = (shape.height(u) - rest.height(u)) / unit
    change = (shape.rise(u[:-1], u[1:]) - rest.rise(u[:-1], u[1:])) / unit
    return lifted(problem, problem.imposed(Point(problem.rest.thickness + change, shift)))
