"""Second-order slices in plain NumPy, side by side, told from the band's edge outwards.

All lengths are over the unit l.  A side is nodes v_0 = 0 < v_1 < ... (material distance from the
edge) and e_i, how far node i has moved away from the band.  Nothing here imports the code under
test; of a problem it reads the nodes, the rest heights, the tool and the band.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from scipy import optimize

NAMES = ("strain", "friction", "tension", "bending")


class Scene(NamedTuple):
    u: np.ndarray
    Y0: np.ndarray
    r0: float
    x0: float
    lower: float  # material at the band's edges
    upper: float
    bottom: float  # heights of the band
    top: float
    top_fixed: bool
    k: float
    mu: float
    alpha: float
    beta: float


def scene_of(problem):
    """What a posed problem says of itself."""
    band, tool, m = problem.band, problem.tool, problem.material
    numbers = [band.lower, band.upper, band.bottom, band.top]
    constants = [float(getattr(m, name)) for name in ("k", "mu", "alpha", "beta")]
    return Scene(
        np.array(problem.rest.material), np.array(problem.rest.heights), float(problem.rest.r0),
        float(tool.radius), *map(float, numbers), bool(tool.top_fixed), *constants,
    )  # fmt: skip


def prescribed(scene, Y):
    """Heights with the banded nodes where the tool wants them, and the held ends."""
    Y = np.array(Y, float)
    for i, u in enumerate(scene.u):
        if scene.lower - 1e-12 <= u <= scene.upper + 1e-12:
            Y[i] = scene.bottom + (scene.r0 / scene.x0) ** 2 * (u - scene.lower)
    Y[0] = 0.0
    if scene.top_fixed:
        Y[-1] = scene.Y0[-1]
    return Y


def free_nodes(scene):
    """Nodes that may move."""
    held = (scene.u >= scene.lower - 1e-12) & (scene.u <= scene.upper + 1e-12)
    held[0] = True
    held[-1] |= scene.top_fixed
    return ~held


def _outwards(scene, Y, way):
    """(v, Y0, Y) of a side from the edge outwards, heights as rising from there, or None."""
    if way > 0:
        here = scene.u >= scene.upper - 1e-12
        v, a, b = scene.u[here] - scene.upper, scene.Y0[here], Y[here]
    else:
        here = scene.u <= scene.lower + 1e-12
        v = scene.lower - scene.u[here][::-1]
        a, b = -scene.Y0[here][::-1], -Y[here][::-1]
    return (v, a, b) if len(v) > 1 else None


def side_terms(scene, v, Y0, Y, held_end):
    """The four terms of one side; friction apart from the constant share of the edge, and that."""
    k, mu, alpha, beta, r0, x0 = *scene[-4:], scene.r0, scene.x0
    m = len(v) - 1
    strain = friction = tension = bending = 0.0
    p, X, slope = [0.0], [x0], [(r0 / x0) ** 2]
    for i in range(m):
        h = v[i + 1] - v[i]
        d, d0 = (Y[i + 1] - Y[i]) / h, (Y0[i + 1] - Y0[i]) / h
        strain += h * k / 2 * (d / d0 - 1) ** 2
        tension += alpha * h * d**2
        p.append((v[i] + v[i + 1]) / 2)
        X.append(r0 / np.sqrt(d))
        slope.append(d)
    for i in range(1, m + 1):
        w = (v[i] - v[i - 1]) / 2 + ((v[i + 1] - v[i]) / 2 if i < m else 0.0)
        if not (held_end and i == m):
            friction += mu * w * abs(Y[i] - Y0[i])
    before, q_before = 0.0, 0.0  # X_u = 0 at the edge
    for j in range(m):
        a = p[j + 1] - p[j]
        b = a + (v[m] - p[m] if j == m - 1 else 0.0)
        gX, gY, q = (X[j + 1] - X[j]) / a, (slope[j + 1] - slope[j]) / a, (p[j] + p[j + 1]) / 2
        tension += alpha * b * gX**2
        bending += beta * b * gY**2
        bending += beta * (q - q_before) * ((gX - before) / (q - q_before)) ** 2
        before, q_before = gX, q
    edge = mu * (v[1] - v[0]) / 2 * abs(Y[0] - Y0[0])
    return np.array([strain, friction, tension, bending]), edge


def free_terms(scene, heights, everything=False):
    """The four terms of E_free, or of both sides with all that touches no free node."""
    Y = prescribed(scene, heights)
    total = np.zeros(4)
    for way in (-1, 1):
        side, held_end = _outwards(scene, Y, way), way < 0 or scene.top_fixed
        # One slice between two prescribed nodes touches no free one.
        if side is not None and (everything or not (held_end and len(side[0]) == 2)):
            total += side_terms(scene, *side, held_end)[0]
    return dict(zip(NAMES, total, strict=True))


def band_terms(scene, rest_height, rest_slope, kinks, heights):
    """The band's own terms by dense quadrature on Y0(u); ``kinks``: where it is not smooth."""
    density = (scene.r0 / scene.x0) ** 2

    def moved(u):
        return scene.bottom + density * (u - scene.lower) - rest_height(u)

    inner = kinks[(kinks > scene.lower) & (kinks < scene.upper)]
    strain = friction = 0.0
    points, weights = np.polynomial.legendre.leggauss(8)
    cuts = [scene.lower, *inner, scene.upper]
    for a, b in itertools.pairwise(cuts):
        parts = np.linspace(a, b, 65)
        e = moved(parts)
        turns = [
            optimize.brentq(moved, parts[i], parts[i + 1], xtol=1e-15)
            for i in np.flatnonzero(e[1:] * e[:-1] < 0)
        ]
        parts = np.union1d(parts, turns)
        u = (parts[1:] + parts[:-1])[:, None] / 2 + np.diff(parts)[:, None] / 2 * points
        w = np.diff(parts)[:, None] / 2 * weights
        # At the ends of pieces the slope jumps, so points lie inside.
        strain += np.sum(w * scene.k / 2 * (density / rest_slope(u) - 1) ** 2)
        friction += np.sum(w * scene.mu * abs(moved(u)))
    Y = prescribed(scene, heights)
    for way in (-1, 1):
        side = _outwards(scene, Y, way)
        if side is not None:
            friction += side_terms(scene, *side, held_end=True)[1]
    tension = scene.alpha * density**2 * (scene.upper - scene.lower)
    return dict(zip(NAMES, (strain, friction, tension, 0.0), strict=True))


def smooth_and_friction(scene, heights):
    """E_free as one number."""
    return sum(free_terms(scene, heights).values())


def random_heights(scene, rng, size=0.4):
    """Rising heights near the rest shape, with the band where the tool wants it."""
    Y = np.array(scene.Y0)
    start = prescribed(scene, Y)
    free = free_nodes(scene)
    for way in (-1, 1):
        side = _outwards(scene, start, way)
        if side is None:
            continue
        v, Y0, edge = side[0], side[1], side[2][0]
        t = np.diff(Y0) * np.exp(rng.uniform(-size, size, len(v) - 1))
        if way < 0 or scene.top_fixed:
            t *= (side[2][-1] - edge) / t.sum()
        new = edge + np.concatenate([[0.0], np.cumsum(t)])
        if way > 0:
            Y[-len(v) :] = new
        else:
            Y[: len(v)] = -new[::-1]
    return np.where(free, Y, start)


def smooth_polyline(u, Y, r0, edges):
    """The contour (radius, height): ends, middles and edges, from bottom to top.

    ``edges`` are (u, radius) at nodes.
    """
    middle = [(r0 * np.sqrt((u[i + 1] - u[i]) / (Y[i + 1] - Y[i])), (Y[i] + Y[i + 1]) / 2)
              for i in range(len(u) - 1)]  # fmt: skip
    points = []
    for i in range(len(u)):
        points += [(x, Y[i]) for at, x in edges if at == u[i]]
        if i < len(middle):
            points.append(middle[i])

    def end(y, near, far):
        x = near[0] + (near[0] - far[0]) * (y - near[1]) / (near[1] - far[1])
        return (x, y)

    first = [] if points[0][1] == Y[0] else [end(Y[0], middle[0], middle[1])]
    last = [] if points[-1][1] == Y[-1] else [end(Y[-1], middle[-1], middle[-2])]
    return np.array(first + points + last)
