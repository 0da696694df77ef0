"""Which edges of tools an answer's contour has: the band's, and old ones that are still there."""

from __future__ import annotations

import numpy as np

from jaxclay.clay.clay import Clay, unchecked_clay
from jaxclay.numerics.arrays import Array, Float
from jaxclay.numerics.interpolation import are_nodes
from jaxclay.schemes.problem import Problem


def with_edges(clay: Clay, problem: Problem, shift: Float[Array, "{clay.slices}+1"]) -> Clay:
    """The answer with old edges at its nodes, beside those of the band.

    They are the same where nothing around them moved (n+1,) ``shift``.  Without smoothing a jump
    of the radius stays one where it moved; its radii are those of the slices beside it.
    """
    before = problem.before
    assert before is not None
    edges = clay.edges
    double = np.append(False, (np.diff(edges, axis=0) == 0).all(axis=1))
    edges = edges[~double]
    low, high = float(problem.band.lower), float(problem.band.upper)
    old = before.edges[(before.edges[:, 0] < low) | (before.edges[:, 0] > high)]
    old = old[are_nodes(clay.material, old[:, 0])]
    node = np.searchsorted(clay.material, old[:, 0])
    around = [shift[np.clip(node + i, 0, clay.slices)] == 0 for i in (-1, 0, 1)]
    rests = np.all(around, axis=0)
    kept = old[rests]
    if problem.material.alpha == 0 and problem.material.beta == 0:
        jumps = np.unique(node[~rests & _is_jump(old[:, 0])])
        rows = [(clay.material[i], _beside(clay, i, way)) for i in jumps for way in (-1, 1)]
        kept = np.concatenate([kept, np.reshape(rows, (-1, 2))])
    edges = np.concatenate([edges, kept])
    edges = edges[np.argsort(edges[:, 0], kind="stable")]
    return unchecked_clay(clay.heights, clay.thickness, clay.r0, clay.unit, clay.material, edges)


def with_jumps(clay: Clay, band: Float[Array, "2"]) -> Clay:
    """A rough shape with both radii at the edges of its band (2,), nodes, where it has clay."""
    rows = []
    for u in band[(band > 0) & (band < 1)]:
        node = int(np.searchsorted(clay.material, u))
        rows += [(clay.material[node], _beside(clay, node, way)) for way in (-1, 1)]
    edges = np.reshape(rows, (-1, 2))
    return unchecked_clay(clay.heights, clay.thickness, clay.r0, clay.unit, clay.material, edges)


def _is_jump(u: np.ndarray) -> np.ndarray:
    same = u[1:] == u[:-1]
    return np.append(False, same) | np.append(same, False)


def _beside(clay: Clay, node: int, way: int) -> float:
    """The radius beside a node, from the two slices below (way -1) or above it."""
    X, middle = clay.radii, (clay.material[1:] + clay.material[:-1]) / 2
    near = node if way > 0 else node - 1
    far = int(np.clip(near + way, 0, clay.slices - 1))
    if far == near:
        return float(X[near])
    share = (clay.material[node] - middle[near]) / (middle[near] - middle[far])
    return float(max(X[near] + share * (X[near] - X[far]), X[near] / 2))
