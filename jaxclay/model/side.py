"""E_move's minimiser on one side of a band, in closed form (eqs. 12-19).

Everything is told in x, the material distance from the band's edge, so both
sides look alike.  The slope changes from Y0_u by s q(x), s = -1 where the clay
is compressed and +1 where it is stretched, with

    q(x) = min(max(sigma - (mu/k) x, 0) Y0_u^2, (1 - f) Y0_u)

(the cap, which is the lower bound of thickness, only in compression).  The push sigma at
the edge follows from D(sigma) = integral of q = |d|, the displacement
prescribed there; a free far end gives way beyond sigma = (mu/k) span instead
(Case II).  One scalar equation serves all three cases and mu = 0.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.model.material import Material
from jaxclay.numerics.arrays import Array, Bool, Float, Scalar, fixed, iterate, namespace, repeat

_MOST_STEPS = 60
_CLOSE = 1e-13
_LAST_STEPS = 2


class Side(NamedTuple):
    """One side of the band, slice by slice; empty slices have start == stop.

    Or many sides, with leading axes before those that are told here; so it is with all that is
    found of them.

    Attributes
    ----------
    start, stop : (n,) arrays, material distance
        Where each slice begins and ends, measured from the band's edge.
    slope : (n,) array
        Y0_u, constant on each slice.
    displacement : scalar
        d, prescribed at the edge; positive compresses the side.
    held : bool scalar
        Whether the far end stays where it is.
    graded : scalar
        1 for the continuum, where the push falls along each slice; 0 for the
        discrete sums, where a slice takes the push at its end nearest the band.
    """

    start: Float[Array, "*sides n"]
    stop: Float[Array, "*sides n"]
    slope: Float[Array, "*sides n"]
    displacement: Float[Array, "*sides"] | Scalar
    held: Bool[Array, "*sides"] | Scalar
    graded: Scalar

    @property
    def width(self) -> Float[Array, "*sides n"]:
        """(n,) each slice's share of the material."""
        return self.stop - self.start

    @property
    def span(self) -> Float[Array, "*sides"]:
        """The side's share of the material."""
        return self.width.sum(axis=-1)


class Push(NamedTuple):
    """What the closed form says of a side.

    Attributes
    ----------
    sigma : scalar
        The push at the band's edge.
    case : int scalar
        1, 2 or 3 as in the paper; 0 for a side without clay.
    reach : scalar, material distance
        How far from the band's edge clay moves: u1 - u0 in Case I, else the span.
    floored : bool scalar
        Whether the lower bound of thickness is active somewhere.
    feasible : bool scalar
        False where even all slices at the lower bound leave less room than needed.
    """

    sigma: Array
    case: Array
    reach: Array
    floored: Array
    feasible: Array


def solve_side(side: Side, material: Material) -> Push:
    """The push that displaces the edge by d: Newton within bounds, exact to rounding."""
    xp = namespace(side, material)
    rate = material.mu / material.k
    size, span = xp.abs(side.displacement), side.span
    free_push = rate * span
    moves = (size > 0) & (span > 0)
    sigma = None
    if xp is np and side.start.ndim == 1:
        sigma = _looked_up(side, material) if moves else np.zeros(())
    above = sigma is not None  # the lower bound
    if not above:
        still = fixed((side, material))
        sigma = fixed(_root(*still, *_bounds(*still)))

        def newton(sigma):
            excess, growth = _excess(side, material, sigma)
            return xp.maximum(sigma - _divide(excess, growth), 0.0)

        # Two more steps finish, and carry the derivatives of sigma up to the third.
        sigma = repeat(_LAST_STEPS, newton, sigma)
    sigma = xp.where(moves, sigma, 0.0)
    beyond = sigma > free_push
    free_push = xp.where(moves, free_push, 0.0)
    sigma = xp.where(side.held, sigma, xp.minimum(sigma, free_push))
    case = xp.where(beyond, xp.where(side.held, 3, 2), 1)
    most = (1 - material.floor) * xp.sum(side.slope * side.width, axis=-1)
    return Push(
        sigma=sigma,
        case=xp.where(span > 0, case, 0),
        reach=xp.where(moves, xp.minimum(_divide(sigma, rate, xp.inf), span), 0.0),
        floored=xp.asarray(False)
        if above
        else moves
        & (side.displacement > 0)
        & xp.any(_pieces(side, material, sigma).saturated > 0, axis=-1),
        feasible=xp.logical_not(side.held) | (side.displacement <= most) | (span == 0),
    )


def _looked_up(side: Side, material: Material) -> np.ndarray | None:
    """The push where no slice is as thin as the lower bound, else None.

    With clay moving up to the end of a slice D is known from sums over the slices; in the slice
    where it passes |d| it is quadratic.
    """
    rate, size = material.mu / material.k, abs(side.displacement)
    if side.graded != 1 or not rate > 0:
        return None
    # The band's edge is at slice 0 of one side and at the last of the other.
    order = slice(None) if side.start[0] <= side.start[-1] else slice(None, None, -1)
    start, squares = side.start[order], side.slope[order] ** 2
    part = squares * side.width[order]
    upto = np.cumsum(part)
    gained = rate * np.cumsum(
        np.append(0.0, upto[:-1]) * side.width[order] + part * side.width[order] / 2
    )
    i = int(np.searchsorted(gained, size))
    if i == len(part):
        sigma = rate * side.span + (size - gained[-1]) / upto[-1]
    else:
        below, known = (upto[i - 1], gained[i - 1]) if i else (0.0, 0.0)
        left = (size - known) / rate
        sigma = rate * (start[i] + 2 * left / (below + np.sqrt(below**2 + 2 * squares[i] * left)))
    binds = side.displacement > 0 and sigma * side.slope[side.width > 0].max() > 1 - material.floor
    return None if binds else sigma


def _bounds(side: Side, material: Material) -> tuple[Array, Array]:
    """A guess of the push, exact for a cylinder above the lower bound, and an upper bound."""
    xp = namespace(side, material)
    rate, size, span = material.mu / material.k, xp.abs(side.displacement), side.span
    stretchable = xp.sum(side.slope**2 * side.width, axis=-1)
    even = _divide(size, stretchable)
    cap = xp.max(xp.where(side.width > 0, (1 - material.floor) / side.slope, 0.0), axis=-1)
    # q >= |d| / stretchable Y0_u^2 throughout
    high = even + rate * span
    high = xp.where(side.displacement > 0, xp.maximum(high, cap + rate * span), high)
    falls = xp.sqrt(2 * rate * even * span)  # to 0 within the side
    guess = xp.where(falls < rate * span, falls, even + rate * span / 2)
    return xp.minimum(guess, high), high


def _root(side: Side, material: Material, guess: Array, high: Array) -> Array:
    """Where D(sigma) = |d|: Newton, or a bisection where that leaves the bounds."""
    xp = namespace(side, material, guess)
    size = xp.abs(side.displacement)

    def go_on(state):
        _, low, high, settled, steps = state
        return xp.any(xp.logical_not(settled) & (high - low > _CLOSE * high)) & (
            steps < _MOST_STEPS
        )

    def cut(state):
        sigma, low, high, _, steps = state
        excess, growth = _excess(side, material, sigma)
        settled = xp.abs(excess) <= _CLOSE * xp.maximum(size, 1e-3)
        low, high = xp.where(excess < 0, sigma, low), xp.where(excess < 0, high, sigma)
        step = sigma - _divide(excess, growth, xp.inf)
        inside = (step > low) & (step < high)
        step = xp.where(inside, step, (low + high) / 2)
        return xp.where(settled, sigma, step), low, high, settled, steps + 1

    first = guess, 0 * high, high, high < 0, 0
    return iterate(go_on, cut, first)[0]


def _excess(side: Side, material: Material, sigma: Array) -> tuple[Array, Array]:
    """D(sigma) - |d| and D'(sigma)."""
    xp = namespace(side, material, sigma)
    p, squares = _pieces(side, material, sigma), side.slope**2
    moved = (p.cap * p.saturated + p.linear * (p.high + p.low) / 2) * squares
    displaced = xp.sum(moved, axis=-1)
    return displaced - xp.abs(side.displacement), xp.sum(squares * p.linear, axis=-1)


def solve_sides(pair: tuple[Side, Side], material: Material) -> tuple[Push, Push]:
    """Both sides of a band, solved at once where that is compiled."""
    if namespace(pair, material) is not jnp:
        return solve_side(pair[0], material), solve_side(pair[1], material)
    pushes = solve_side(jax.tree.map(lambda *leaves: jnp.stack(leaves), *pair), material)
    return jax.tree.map(lambda leaf: leaf[0], pushes), jax.tree.map(lambda leaf: leaf[1], pushes)


def slope_change(side: Side, material: Material, sigma: Array) -> Float[Array, "*sides n"]:
    """(n,) integral of Y_u - Y0_u over each slice, in heights: negative in compression."""
    xp = namespace(side, material, sigma)
    p = _pieces(side, material, sigma)
    moved = p.cap * p.saturated + p.linear * (p.high + p.low) / 2
    return -_along(xp.sign(side.displacement)) * moved * side.slope**2


def move_energy(side: Side, material: Material, push: Push) -> Float[Array, "*sides"]:
    """E_move of the side (eq. 6) at its minimum, in the continuum."""
    xp = namespace(side, material, push)
    k, mu = material.k, material.mu
    p = _pieces(side, material, push.sigma)
    squares = p.cap**2 * p.saturated
    squares += p.linear * (p.high * p.high + p.high * p.low + p.low * p.low) / 3
    strain = k / 2 * xp.sum(squares * side.slope**2, axis=-1)
    # |d(x)| = |d| - integral of q up to x, so its integral needs q's first moment only.
    middle = side.start + p.saturated + p.linear / 2
    moment = p.cap * p.saturated * (side.start + p.saturated / 2)
    moment += p.linear * ((p.high + p.low) / 2 * middle - (p.high - p.low) * p.linear / 12)
    stays = xp.maximum(xp.abs(side.displacement) - _displaced(side, material, push.sigma), 0.0)
    return strain + mu * (stays * side.span + xp.sum(moment * side.slope**2, axis=-1))


def edge_tension(side: Side, material: Material, push: Push, slope: Array) -> Array:
    """-dE/d(span) where the edge passes clay of rest slope ``slope``, its height staying put.

    k/2 ((Y_u / Y0_u)^2 - 1) - mu |d| while the lower bound is inactive.
    """
    xp = namespace(side, material, push)
    k = material.k
    sign = xp.sign(side.displacement)
    stretch = 1 - sign * push.sigma * slope
    stretch = xp.where(sign > 0, xp.maximum(stretch, material.floor), stretch)
    momentum = -sign * k * push.sigma
    energy = k / 2 * (stretch - 1) ** 2 + material.mu * xp.abs(side.displacement)
    return stretch * slope * momentum - energy


def _displaced(side: Side, material: Material, sigma: Array) -> Array:
    return abs(slope_change(side, material, sigma)).sum(axis=-1)


class _Pieces(NamedTuple):
    """Each slice is saturated first, then its push falls from high to low, then vanishes."""

    cap: Array  # (n,) push beyond which a slice is as thin as the lower bound
    saturated: Array  # (n,) length where the push exceeds it
    linear: Array  # (n,) length where the push lies between 0 and the cap
    high: Array  # (n,) push where the linear part begins
    low: Array  # (n,) push where it ends


def _pieces(side: Side, material: Material, sigma: Array) -> _Pieces:
    xp = namespace(side, material, sigma)
    rate = material.mu / material.k
    edge = _along(sigma) - rate * side.start
    fall = rate * _along(side.graded)
    compressed = _along(side.displacement) > 0
    cap = xp.where(compressed, (1 - material.floor) / side.slope, 0.0)
    begins = _divide(edge - cap, fall, xp.where(edge > cap, xp.inf, -xp.inf))
    saturated = xp.where(compressed, xp.clip(begins, 0.0, side.width), 0.0)
    vanishes = _divide(edge, fall, xp.where(edge > 0, xp.inf, -xp.inf))
    end = xp.clip(vanishes, saturated, side.width)
    return _Pieces(cap, saturated, end - saturated, edge - fall * saturated, edge - fall * end)


def _along(value: Array) -> Array:
    """A value for each side, for arithmetic with arrays of its slices."""
    return namespace(value).asarray(value)[..., None]


def _divide(a: Array, b: Array, otherwise: Array | float = 0.0) -> Array:
    """a / b, or ``otherwise`` where b is 0 (also under differentiation)."""
    xp = namespace(a, b, otherwise)
    safe = xp.where(b > 0, b, 1.0)
    return xp.where(b > 0, a / safe, otherwise)
