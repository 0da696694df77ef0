"""The clay that an answer describes, piece by piece, and the displacement as a function."""

from __future__ import annotations

from functools import cache
from math import comb, factorial

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay import bernstein
from jaxclay.bernstein import DEGREE
from jaxclay.clay import Array
from jaxclay.schemes.spline import bspline
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.space import Space

_SECANTS = 8


def shape(problem: SplineProblem, coefficients: Array) -> tuple[Array, Array]:
    """Breaks (m+1,) and control (m, 6) over l of Y = Y0 + w; m is the same for all answers.

    Pieces of the rest shape that do not move keep their control heights bit for bit.
    """
    band, rest, share = problem.band, problem.rest, problem.band.upper - problem.band.lower
    v, displacement = displaced(problem.space, coefficients)
    breaks = _breaks(problem, v, displacement)
    left, width = breaks[:-1], jnp.diff(breaks)
    middle = left + width / 2
    in_band = (middle > band.lower) & (middle < band.upper)
    at = jnp.where(in_band, 0.0, middle - jnp.where(middle > band.upper, share, 0.0))
    change = _derivatives(v, displacement, at)
    control = _from_taylor(_derivatives(rest.breaks, rest.control, middle) + change, width)

    index = jnp.searchsorted(rest.breaks, middle, side="right") - 1
    index = jnp.clip(index, 0, rest.control.shape[0] - 1)
    whole = (rest.breaks[index] == left) & (rest.breaks[index + 1] == breaks[1:])
    still = whole & jnp.all(change == 0, axis=1)
    control = jnp.where(still[:, None], rest.control[index], control)
    places = left[:, None] + width[:, None] * np.arange(DEGREE + 1) / DEGREE
    squashed = band.bottom + (rest.r0 / problem.tool.radius) ** 2 * (places - band.lower)
    control = jnp.where(in_band[:, None], squashed, control)
    top = jnp.max(jnp.where(width > 0, control[:, -1], 0.0))
    control = jnp.where((width > 0)[:, None], control, top)
    return breaks, control.at[0, 0].set(0.0)


def _breaks(problem: SplineProblem, v: Array, displacement: Array) -> Array:
    """Where pieces meet: the rest's breaks, the band's edges, knots between spans that move."""
    band = problem.band
    above = jnp.append(v[:-1] >= band.lower, True)
    u = v + jnp.where(above, band.upper - band.lower, 0.0)
    moves = jnp.any(displacement != 0, axis=1) & (jnp.diff(v) > 0)
    meets = jnp.append(moves, False) | jnp.append(False, moves)
    edges = jnp.stack([band.lower, band.upper])
    breaks = jnp.concatenate([problem.rest.breaks, jnp.where(meets, u, 1.0), edges])
    breaks = jnp.sort(jnp.clip(breaks, 0.0, 1.0))
    again = jnp.append(False, breaks[1:] == breaks[:-1])
    return jnp.sort(jnp.where(again, 1.0, breaks))


def displaced(space: Space, coefficients: Array) -> tuple[Array, Array]:
    """The displacement w as breaks (S+1,) in v and Bernstein coefficients (S, 6) of degree 5."""
    return displaced_on(space.knots, space.extraction, coefficients)


def displaced_on(knots: Array, extracted: Array, coefficients: Array) -> tuple[Array, Array]:
    """The same for knots, and their extraction, of which no space has been made."""
    degree = extracted.shape[-1] - 1
    control = jnp.einsum("sja,sa->sj", extracted, bspline.local(coefficients, degree))
    left, length = bspline.spans(knots, degree)
    control = jnp.where((length > 0)[:, None], control, 0.0)
    return jnp.append(left, left[-1] + length[-1]), control @ _elevation(degree).T


def crossings(control: Array) -> Array:
    """(S,) where in each span, from 0 to 1, the displacement with this control changes sign.

    One half where it does not; ``control`` (S, 6) is that of :func:`displaced`.
    """
    turns = control[:, 0] * control[:, -1] < 0
    one = jnp.ones_like(control[:, 0])

    def secant(_, ends):
        low, high, at_low, at_high = ends
        s = low + at_low / jnp.where(turns, at_low - at_high, 1.0) * (high - low)
        s = jnp.where(turns, s, 0.5)
        (there,) = bernstein.in_piece(control, one, s, 1)
        same = there * at_low > 0
        # Illinois: the end that stays counts half.
        return (
            jnp.where(same, s, low),
            jnp.where(same, high, s),
            jnp.where(same, there, at_low / 2),
            jnp.where(same, at_high / 2, there),
        )

    ends = jax.lax.fori_loop(0, _SECANTS, secant, (0 * one, one, control[:, 0], control[:, -1]))
    s = jnp.where(jnp.abs(ends[2]) < jnp.abs(ends[3]), ends[0], ends[1])
    return jnp.where(turns, jnp.clip(s, 0.02, 0.98), 0.5)


def projected(knots: Array, degree: int, v: Array, displacement: Array) -> Array:
    """(S + p,) coefficients of a function like :func:`displaced` on other knots.

    Exact where these hold the old ones, else a quasi-interpolant.
    """
    total = knots.shape[0] - degree - 1
    starts = jnp.stack([knots[r : r + total] for r in range(degree + 1)])
    gaps = jnp.stack([knots[r + 1 : r + 1 + total] for r in range(degree + 1)]) - starts
    longest = jnp.argmax(gaps, axis=0)[None]
    at = jnp.take_along_axis(starts + gaps / 2, longest, axis=0)[0]
    values = jnp.stack(bernstein.evaluate(v, displacement, at, degree + 1))
    return bspline.fitted(knots, degree, at, values)


@cache
def _elevation(degree: int) -> np.ndarray:
    """(6, p+1) Bernstein coefficients of degree 5 from those of degree p."""
    rows = np.zeros((DEGREE + 1, degree + 1))
    for i in range(DEGREE + 1):
        for j in range(max(0, i - DEGREE + degree), min(degree, i) + 1):
            rows[i, j] = comb(degree, j) * comb(DEGREE - degree, i - j) / comb(DEGREE, i)
    return rows


def _derivatives(breaks: Array, control: Array, at: Array) -> Array:
    """(m, 6) derivatives of order 0 to 5 at (m,)."""
    return jnp.stack(bernstein.evaluate(breaks, control, at, DEGREE + 1), axis=1)


def _from_taylor(derivatives: Array, width: Array) -> Array:
    """(m, 6) Bernstein coefficients on pieces of a width from derivatives at their middle."""
    orders = np.arange(DEGREE + 1)
    scale = (width[:, None] / 2) ** orders / np.array([factorial(k) for k in orders])
    return (derivatives * scale) @ _TO_BERNSTEIN


def _powers_to_bernstein() -> np.ndarray:
    """(6, 6): row k is (2 s - 1)^k in Bernstein form."""
    s, orders = np.arange(DEGREE + 1)[:, None] / DEGREE, np.arange(DEGREE + 1)
    binomials = np.array([comb(DEGREE, j) for j in orders])
    basis = binomials * s**orders * (1 - s) ** (DEGREE - orders)
    return np.linalg.solve(basis, (2 * s - 1) ** orders).T


_TO_BERNSTEIN = _powers_to_bernstein()
