"""Smoothing without a squash: the minimum of E_total where alpha and beta count more."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxclay.clay.clay import Clay, on_nodes, unchecked_clay
from jaxclay.methods.loop import initial_guess
from jaxclay.methods.newton import NewtonSettings
from jaxclay.model.band import Rest
from jaxclay.model.energy import Terms, integrate
from jaxclay.model.material import Material
from jaxclay.numerics.arrays import Array, Float
from jaxclay.numerics.host import as_compiled, as_float64
from jaxclay.schemes.folding import system_of
from jaxclay.schemes.slices.weights import sums_of
from jaxclay.schemes.sums import Displaced, Sums, sample
from jaxclay.schemes.system import System
from jaxclay.solve.certified_newton import solve_on_host


class Smoothed(NamedTuple):
    """Clay after smoothing, or as it was where the certificate refuses the answer.

    Attributes
    ----------
    clay : Clay
    certified : bool
    shift : (n+1,) array
        How far its nodes have moved, over the unit l.
    terms : Terms
        E_total (eq. 9), alpha and beta as the material has them.
    """

    clay: Clay
    certified: bool
    shift: Float[Array, "nodes"]
    terms: Terms


def smooth(
    clay: Clay, material: Material, bottom: float, top: float, times: float, slices: int
) -> Smoothed:
    """Minimise E_total (eq. 9) with alpha and beta ``times`` as large between two heights.

    Parameters
    ----------
    clay : Clay
        Its shape is where strain and friction are measured from.
    material : Material
        What it is made of.
    bottom, top : float, length
        The heights.
    times : float
        What alpha and beta are multiplied with on slices between them.
    slices : int
        How many to solve on: the clay's own nodes and, as many as are missing, middles of its
        widest slices.

    Returns
    -------
    Smoothed
        The certificate's word, and the clay.
    """
    nodes = _refined(clay, slices)
    on = on_nodes(clay, nodes)
    with as_compiled():
        rest, sums = _at_rest(on)
        middle = (on.heights[1:] + on.heights[:-1]) / 2
        emphasis = np.where((middle >= bottom) & (middle <= top), times, 1.0)
        system = _free(rest, sums, as_float64(material), emphasis)
        still = Displaced(rest.thickness, np.zeros(slices + 1))
        start = initial_guess(system, still)  # type: ignore[arg-type]
        outcome, certificate = solve_on_host(system, start, NewtonSettings(), np.asarray(True))
        accepted = bool(certificate.accepted & outcome.finite)
        point = outcome.point if accepted else still
        terms = integrate(sample(rest, sums, point), material)
    if not accepted or not point.shift.any():
        return Smoothed(clay, accepted, point.shift, terms)
    moves = point.shift != 0
    heights = np.where(moves, (rest.heights + point.shift) * clay.unit, on.heights)
    same = point.thickness == rest.thickness
    thickness = np.where(same, on.thickness, point.thickness * clay.unit)
    near = moves | np.append(moves[1:], False) | np.append(False, moves[:-1])
    edges = on.edges[~np.isin(on.edges[:, 0], nodes[near])]
    shape = unchecked_clay(heights, thickness, clay.r0, clay.unit, nodes, edges)
    return Smoothed(shape, True, point.shift, terms)


def _at_rest(clay: Clay) -> tuple[Rest, Sums]:
    rest = Rest(
        clay.thickness / clay.unit, clay.heights / clay.unit, clay.r0 / clay.unit**1.5,
        clay.material,
    )  # fmt: skip
    return rest, sums_of(clay.material, np.zeros(clay.slices + 1, bool))


def _free(rest: Rest, sums: Sums, material: Material, emphasis: np.ndarray) -> System:
    """The system of clay that nothing but its foot holds."""
    free = np.arange(rest.slices + 1) > 0
    upper = np.ones(rest.slices, bool)
    return system_of(rest, sums, material, free, np.zeros(rest.slices + 1), upper, emphasis)


def _refined(clay: Clay, slices: int) -> np.ndarray:
    """The clay's nodes (slices+1,), with middles of its widest slices; some only, if too many."""
    nodes = np.asarray(clay.material)
    if len(nodes) > slices + 1:
        return nodes[np.round(np.linspace(0, clay.slices, slices + 1)).astype(int)]
    while len(nodes) <= slices:
        widths = np.diff(nodes)
        widest = np.sort(np.argsort(-widths, kind="stable")[: slices + 1 - len(nodes)])
        nodes = np.sort(np.append(nodes, nodes[widest] + widths[widest] / 2))
    return nodes
