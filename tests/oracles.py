"""Slow, plain NumPy and SciPy versions of the model, written from its equations.

All lengths are over the unit l.  Nothing here imports the code under test
except ``population``, which hands out its public value types.
"""

from __future__ import annotations

import clarabel
import numpy as np
from scipy import optimize, sparse

import jaxclay


def energy_pieces(Y, Y0, r0, k, mu, alpha, beta):
    """Every term of E_total, one by one: (name, nodes it depends on, value)."""
    n = len(Y) - 1
    h = 1 / n
    X = [r0 * (h / (Y[i + 1] - Y[i])) ** 0.5 for i in range(n)]
    for i in range(n):
        slope, rest = (Y[i + 1] - Y[i]) / h, (Y0[i + 1] - Y0[i]) / h
        yield "strain", (i, i + 1), h * k / 2 * (slope / rest - 1) ** 2
    for i in range(1, n + 1):
        yield "friction", (i,), h * mu * abs(Y[i] - Y0[i])
    for i in range(n - 1):
        yield "tension", (i, i + 1, i + 2), h * alpha * ((X[i + 1] - X[i]) / h) ** 2
    for i in range(n):
        yield "tension", (i, i + 1), h * alpha * ((Y[i + 1] - Y[i]) / h) ** 2
    for i in range(1, n - 1):
        second = (X[i + 1] - 2 * X[i] + X[i - 1]) / h**2
        yield "bending", (i - 1, i, i + 1, i + 2), h * beta * second**2
    for i in range(1, n):
        second = (Y[i + 1] - 2 * Y[i] + Y[i - 1]) / h**2
        yield "bending", (i - 1, i, i + 1), h * beta * second**2


def energy_terms(Y, Y0, r0, k=1.0, mu=1.0, alpha=0.0, beta=0.0, free=None):
    """The four terms as a dict; with ``free`` (n+1 bools) those that touch a free node."""
    totals = {"strain": 0.0, "friction": 0.0, "tension": 0.0, "bending": 0.0}
    for name, nodes, value in energy_pieces(Y, Y0, r0, k, mu, alpha, beta):
        if free is None or any(free[i] for i in nodes):
            totals[name] += value
    return totals


def total_energy(Y, Y0, r0, **constants):
    return sum(energy_terms(Y, Y0, r0, **constants).values())


def constants_of(problem):
    """The arguments of the oracles above, read off a posed problem."""
    m = problem.material
    numbers = {name: float(getattr(m, name)) for name in ("k", "mu", "alpha", "beta")}
    return {"Y0": np.asarray(problem.rest.heights), "r0": float(problem.rest.r0), **numbers}


def greedy(Y, Y0, r0, free, step, threshold, sweeps, floor, k, mu, alpha, beta):
    """The paper's second stage, move by move: steps per node, sweeps, moves of each sweep.

    Heights are held as a whole number of steps from the start, so that nothing drifts.
    """
    Y, n = np.array(Y, float), len(Y) - 1
    start, steps = Y.copy(), np.zeros(n + 1, int)
    constants = {"k": k, "mu": mu, "alpha": alpha, "beta": beta}
    history = []
    for _ in range(sweeps):
        moved = 0
        for i in np.flatnonzero(free):
            best, here = 0, _energy_around(Y, Y0, r0, i, **constants)
            for direction in (1, -1):
                trial = Y.copy()
                trial[i] = start[i] + (steps[i] + direction) * step
                if _breaks_floor(trial, Y0, i, floor):
                    continue
                there = _energy_around(trial, Y0, r0, i, **constants)
                if there < here:
                    best, here = direction, there
            if best:
                steps[i] += best
                Y[i] = start[i] + steps[i] * step
                moved += 1
        history.append(moved)
        if moved < threshold:
            break
    return steps, history


def _energy_around(Y, Y0, r0, i, **constants):
    """E_total of the clay within 4 nodes of node i: all terms that Y_i enters, and more.

    ``h`` is that of the whole clay, so the terms are those of the whole sum.
    """
    n = len(Y) - 1
    low, high = max(0, i - 4), min(n, i + 4)
    y, y0, h = Y[low : high + 1], Y0[low : high + 1], 1 / n
    t, t0 = np.diff(y), np.diff(y0)
    X = r0 * np.sqrt(h / t)
    strain = h * constants["k"] / 2 * np.sum((t / t0 - 1) ** 2)
    friction = h * constants["mu"] * np.sum(np.abs(y - y0))
    tension = h * constants["alpha"] * (np.sum((np.diff(X) / h) ** 2) + np.sum((t / h) ** 2))
    bending = np.sum((np.diff(X, 2) / h**2) ** 2) + np.sum((np.diff(y, 2) / h**2) ** 2)
    return strain + friction + tension + h * constants["beta"] * bending


def _breaks_floor(Y, Y0, i, floor):
    slices = [j for j in (i - 1, i) if 0 <= j < len(Y) - 1]
    return any(Y[j + 1] - Y[j] < floor * (Y0[j + 1] - Y0[j]) for j in slices)


def discrete_minimum(problem):
    """Heights of least discrete E_move above the lower bound, as a convex QP, by Clarabel.

    Unknowns: Y, then e_i >= |Y_i - Y0_i|.
    """
    Y0, n = np.asarray(problem.rest.heights), problem.slices
    fixed = np.asarray(problem.fixed)
    k, mu, f = (float(getattr(problem.material, name)) for name in ("k", "mu", "floor"))
    t0, m = np.diff(Y0), n + 1
    D = sparse.diags_array([-np.ones(n), np.ones(n)], offsets=[0, 1], shape=(n, m))
    W = sparse.diags_array(k / n / t0**2)
    P = sparse.block_diag([D.T @ W @ D, sparse.csc_array((m, m))], format="csc")
    q = np.concatenate([-(D.T @ (k / n / t0)), np.full(m, mu / n)])
    eye, none = sparse.eye_array(m, format="csc"), sparse.csc_array((n, m))
    pinned = sparse.hstack([eye[fixed], sparse.csc_array((fixed.sum(), m))])
    loose = ~(fixed[1:] & fixed[:-1])
    above_floor = sparse.hstack([-D.tocsc()[loose], none[loose]])
    over, under = sparse.hstack([eye, -eye]), sparse.hstack([-eye, -eye])
    A = sparse.vstack([pinned, above_floor, over, under], format="csc")
    target = Y0 + np.asarray(problem.shift)
    b = np.concatenate([target[fixed], -f * t0[loose], Y0, -Y0])
    cones = [clarabel.ZeroConeT(int(fixed.sum())), clarabel.NonnegativeConeT(len(b) - fixed.sum())]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    solution = clarabel.DefaultSolver(
        sparse.triu(P, format="csc"), q, A, b, cones, settings
    ).solve()
    assert "Solved" in str(solution.status), solution.status
    return np.array(solution.x[:m])


class SlopeField:
    """Y0_u, constant on each of n equal slices, with integrals by Gauss points per slice."""

    def __init__(self, slopes):
        self.slopes = np.asarray(slopes, float)

    def __call__(self, u):
        n = len(self.slopes)
        return self.slopes[np.clip((np.asarray(u) * n).astype(int), 0, n - 1)]

    def integral(self, function, a, b):
        """Integral of function(u, Y0_u(u)) from a to b; exact for polynomials in u."""
        n = len(self.slopes)
        inner = np.arange(n + 1) / n
        cuts = np.concatenate([[a], inner[(inner > a) & (inner < b)], [b]])
        points, weights = np.polynomial.legendre.leggauss(4)
        middle, half = (cuts[1:] + cuts[:-1]) / 2, np.diff(cuts) / 2
        u = middle[:, None] + half[:, None] * points
        return np.sum(function(u, self(middle)[:, None]) * weights * half[:, None])

    def height(self, u):
        return self.integral(lambda u, s: s + 0 * u, 0.0, u)


def rough_case_one(field, u0, displacement, ratio):
    """u1 of eq. 14 by root finding, None if it does not lie below 1.  ratio = mu/k."""
    wanted = abs(displacement) / ratio

    def excess(u1):
        return field.integral(lambda u, s: (u1 - u) * s**2, u0, u1) - wanted

    return optimize.brentq(excess, u0, 1.0, xtol=1e-14) if excess(1.0) > 0 else None


def rough_height(field, u, u0, y0, ratio, pivot):
    """Eqs. 15, 18, 19: pivot is u1, 1 or c.  Drawing in turns the sign of friction."""
    d = y0 - field.height(u0)
    bent = field.integral(lambda v, s: (v - pivot) * s**2, u0, u)
    return np.sign(d) * ratio * bent + field.height(u) - field.height(u0) + y0


def pivot_held(field, u0, displacement, ratio):
    """c of eq. 19."""
    first = field.integral(lambda u, s: u * s**2, u0, 1.0)
    return (abs(displacement) / ratio + first) / field.integral(lambda u, s: s**2, u0, 1.0)


def hausdorff(a, b, points=4000):
    """Largest distance between two polylines (m, 2), by dense points on both."""
    a, b = _dense(a, points), _dense(b, points)
    return max(_farthest(a, b), _farthest(b, a))


def _farthest(a, b):
    return max(np.min(np.hypot(*(b - p).T)) for p in a)


def _dense(line, points):
    line = np.asarray(line, float)
    along = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    places = np.union1d(np.linspace(0, along[-1], points), along)
    return np.stack([np.interp(places, along, line[:, j]) for j in range(2)], axis=1)


def population(scenes, seed=0, slices=64, smoothing=True):
    """The random population: yields (r0, squashes, material), the last squash the one to solve."""
    rng = np.random.default_rng(seed)
    for _ in range(scenes):
        r0 = rng.uniform(0.2, 1.0)
        earlier = 3 if rng.random() < 0.25 else 0
        squashes = [_random_squash(rng, r0) for _ in range(earlier + 1)]
        mu = 10 ** rng.uniform(-1.5, 0.3)
        alpha, beta = 10 ** rng.uniform(-2, 1, 2)
        snake = rng.random() < 0.5
        if not smoothing:
            alpha = beta = 0.0
        if snake:
            material = jaxclay.Material.from_snake_units(1.0, mu, alpha, beta, slices=slices)
        else:
            material = jaxclay.Material(1.0, mu, alpha, beta)
        yield r0, squashes, material


def _random_squash(rng, r0):
    ratio = rng.uniform(1.03, 1.4) if rng.random() < 0.2 else rng.uniform(0.6, 0.97)
    if rng.random() < 0.4:
        bottom, height = rng.uniform(0.1, 0.4), rng.uniform(0.1, 0.5)
    else:
        bottom, height = 0.0, rng.uniform(0.1, 0.6)
    return jaxclay.Squash(bottom, bottom + height, ratio * r0)
