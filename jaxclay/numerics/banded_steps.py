"""The loop of :func:`.minimize_banded`: one factorisation and one step a pass.

Where the Hessian H is not positive definite a multiple of its rows' sizes is added (Nocedal and
Wright 2006, section 3.4), and every step is cut short until it lowers the function (Armijo 1966).

Nothing is remembered of the start, and nothing is summed over coordinates, which may differ in
scale.  With the Newton step d = -H^-1 g, a point is *still* if for every i

    |d_i| <= tolerance max(|x_i|, 1e-8)    or    |g_i| <= 1e-14 (|H| |x|)_i,

the latter the backward error of g = 0 by coordinate (Oettli and Prager 1964), below which g is
rounding.  It is a *minimum* if H is positive definite there and Newton's method converges as it
should at one: the slope along d falls to 0 as if H were constant, or 1/2 |g.d| has fallen a
hundredfold in one step.  Where rounding of f hides what is left to gain and whole Newton
steps have stopped to shrink, rounding is all that is left of g too.

Anything else (x^3, x^4, a flat direction, a saddle) is looked at first: a lower value on either
side along the Newton step, or along a direction of least curvature from the factor, is gone to.
If there is none, it is a minimum where H + 1e-12 of its rows' sizes is positive definite.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxclay.numerics.arrays import Array
from jaxclay.numerics.banded import (
    Factor,
    Model,
    factorize,
    local_model,
    product,
    reaches_beyond,
    solve,
    substituted,
)
from jaxclay.numerics.banded_search import FAR, Search, search_line

_FIRST_SHIFT = 1e-12  # over the rows' sizes, as are the others: singular but for rounding
_SMALL_SHIFT = 1e-8  # below it the next pass does without
_LAST_SHIFT = 1e8  # where a step is the gradient's and too short to see
_FALL = 0.25
_HALVINGS, _NEAREST = 40, 30  # of a step, and of a look around a point
_NOTHING = 4e-16  # of |f|: lost in rounding
_ROUNDING = 1e-14  # of the terms of a gradient
_SMALLEST = 1e-8  # size of a coordinate that is 0
_QUICK = 0.01  # of the last decrement; Newton leaves 0.13 where x^3 is flat
_TINY = 1e-6  # of x: a step so short that, if it shrinks no more, it is rounding

_GOING = -1


class BandedStatus(enum.IntEnum):
    """How :func:`minimize_banded` ended.

    Attributes
    ----------
    CONVERGED
        At a minimum: nothing moves by more than the tolerance or rounding, H is positive
        definite there or, but for rounding, semidefinite with nothing lower along its flat side.
    STALLED
        No step lowers the function, but it is no minimum as far as can be told.
    ITERATION_LIMIT
        It was ended by ``max_iterations``.
    NON_FINITE
        The function or its derivatives are not finite where it stopped.
    UNBOUNDED
        The function falls below -1e100, or on and on until a coordinate exceeds 1e100.
    TOO_NARROW
        The Hessian has entries outside the bands.
    """

    CONVERGED = 0
    STALLED = 1
    ITERATION_LIMIT = 2
    NON_FINITE = 3
    UNBOUNDED = 4
    TOO_NARROW = 5

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ").replace("non finite", "non-finite")


class State(NamedTuple):
    """What one pass leaves to the next.

    Attributes
    ----------
    x : (n,) array
    shift : float
        Of H, over the sizes of its rows.
    decrement : float
        1/2 g^T H^-1 g of the last positive definite pass.
    before : float
        The same if the last step was a whole Newton step, else not a number.
    verdict : int
        A status if x is about to be called so: the next pass looks for a lower value.
    iterations : int
    code : int
        The status, -1 until there is one.
    """

    x: Array
    shift: Array
    decrement: Array
    before: Array
    verdict: Array
    iterations: Array
    code: Array


def run(
    fun: Callable[[Array], Array], start: Array, half_bandwidth: int, tolerance, limit
) -> State:
    """Newton's method from ``start`` until it has a status."""

    def go_on(state: State) -> Array:
        return (state.code == _GOING) & (state.iterations < limit)

    zero, going = jnp.zeros((), start.dtype), jnp.asarray(_GOING)
    first = State(start, zero, zero + jnp.inf, zero + jnp.nan, going, jnp.asarray(0), going)
    last = jax.lax.while_loop(go_on, lambda s: _step(fun, s, half_bandwidth, tolerance), first)
    ended = jnp.where(last.code == _GOING, int(BandedStatus.ITERATION_LIMIT), last.code)
    return last._replace(code=ended)


class _View(NamedTuple):
    """What the model at a point says of it."""

    newton: Array  # step; 0 where H + shift is not positive definite
    decrement: Array
    positive: Array  # whether H + shift is
    plain: Array  # and H itself
    still: Array
    certain: Array  # whether it is a minimum
    hidden: Array  # whether rounding of fun hides what is left to gain
    tiny: Array  # whether the step is


def _step(fun, state: State, half_bandwidth: int, tolerance) -> State:
    """One factorisation of H + shift, and one step or one look around."""
    x, shift, looking = state.x, state.shift, state.verdict != _GOING
    model = local_model(fun, x, half_bandwidth)
    rows = _row_sizes(model, x)
    factor = factorize(model.bands.at[0].add(shift * rows))
    view = _viewed(state, model, factor, tolerance)
    # The greatest shift that fails shows the direction of most negative curvature.
    lowering = looking & view.positive & (shift > 0)
    search = _aimed(state, model, factor, view)
    tried = search_line(fun, x, model.value, search, view.certain | lowering)
    length = jnp.where(view.certain, 1.0, jnp.where(lowering, 0.0, tried.length))

    fails = ~looking & (~view.positive | (length == 0))
    sure = view.certain | (view.still & tried.straight)
    slow = (length == 0) | (view.decrement >= state.before / 2)
    noise = view.plain & ~tried.straight & slow & (view.hidden | view.tiny)
    # No hope of a minimum near by.
    bent = view.positive & (shift > _FIRST_SHIFT) & (view.hidden | view.still)
    asks = ~looking & ~sure & (noise | bent | view.still)
    wrong = looking & view.plain & (state.verdict == int(BandedStatus.STALLED))
    moved = jnp.where(asks | wrong, x, x + length * search.along)

    found_none = looking & ~lowering & ~wrong & (length == 0)
    code = jnp.where(sure, int(BandedStatus.CONVERGED), _GOING)
    code = jnp.where(found_none, state.verdict, code)
    code = jnp.where(fails & (shift >= _LAST_SHIFT), int(BandedStatus.STALLED), code)
    lost = ~asks & tried.bottomless | (jnp.max(jnp.abs(moved)) > FAR)
    code = jnp.where(lost, int(BandedStatus.UNBOUNDED), code)
    code, usable = _refused(fun, x, model, code)

    certified = jnp.where(bent, int(BandedStatus.STALLED), int(BandedStatus.CONVERGED))
    verdict = jnp.where(asks, certified, jnp.where(lowering, state.verdict, _GOING))
    following = jnp.where(fails, _grown(shift), jnp.where(looking, 0.0, _fallen(shift)))
    return State(
        x=jnp.where(usable, moved, x),
        shift=jnp.where(asks | lowering, _lowered(shift), following),
        decrement=view.decrement,
        before=jnp.where(view.plain & ~looking & (length == 1), view.decrement, jnp.nan),
        verdict=verdict,
        iterations=state.iterations + 1,
        code=code,
    )


def _viewed(state: State, model: Model, factor: Factor, tolerance) -> _View:
    x, shift = state.x, state.shift
    newton = jnp.where(factor.positive, -solve(factor, model.gradient), 0.0)
    decrement = jnp.where(factor.positive, -model.gradient @ newton / 2, state.decrement)
    plain = factor.positive & (shift == 0)

    size = jnp.maximum(jnp.abs(x), _SMALLEST)
    rounded = jnp.abs(model.gradient) <= product(_ROUNDING * jnp.abs(model.bands), jnp.abs(x))
    short = (1 + shift) * jnp.abs(newton) <= tolerance * size
    still = factor.positive & jnp.all(rounded | short)
    quick = decrement <= _QUICK * state.before
    certain = still & plain & (quick | jnp.all(rounded)) & (state.verdict == _GOING)
    hidden = (1 + shift) * decrement <= _NOTHING * jnp.abs(model.value)
    tiny = jnp.all(jnp.abs(newton) <= _TINY * size)
    return _View(newton, decrement, factor.positive, plain, still, certain, hidden, tiny)


def _aimed(state: State, model: Model, factor: Factor, view: _View) -> Search:
    """Along the Newton step, or to either side where a point is looked at."""
    looking = state.verdict != _GOING
    look = jnp.where(view.plain, view.newton, _least_curved(factor))
    reach = jnp.maximum(jnp.max(jnp.abs(state.x)), 1.0)
    look *= reach / jnp.maximum(jnp.max(jnp.abs(look)), 1e-300)
    return Search(
        along=jnp.where(looking, look, view.newton),
        gain=jnp.where(looking, 0.0, view.decrement),
        rounding=jnp.where(looking, _NOTHING * jnp.abs(model.value), 0.0),
        least=0.5 ** jnp.where(looking, _NEAREST, _HALVINGS),
        both=looking,
        slope=jnp.where(view.plain & ~looking, 2 * view.decrement, 0.0),
    )


def _refused(fun, x: Array, model: Model, code: Array) -> tuple[Array, Array]:
    """The status, and whether the model is one to go by."""
    narrow = reaches_beyond(fun, x, model.bands)
    finite = jnp.isfinite(model.value + jnp.sum(model.gradient) + jnp.sum(model.bands))
    code = jnp.where(narrow, int(BandedStatus.TOO_NARROW), code)
    return jnp.where(finite, code, int(BandedStatus.NON_FINITE)), finite & ~narrow


def _grown(shift: Array) -> Array:
    return jnp.maximum(jnp.where(shift < 1e-4, 1e4, 10.0) * shift, _FIRST_SHIFT)


def _fallen(shift: Array) -> Array:
    return jnp.where(_FALL * shift < _SMALL_SHIFT, 0.0, _FALL * shift)


def _lowered(shift: Array) -> Array:
    return jnp.where(shift > 10 * _FIRST_SHIFT, 0.1 * shift, 0.0)


def _row_sizes(model: Model, x: Array) -> Array:
    """Largest entry of each row of H, at least what makes a gradient step of x's size."""
    size = jnp.abs(model.bands)
    largest = size[0]
    for k in range(1, size.shape[0]):
        beside = jnp.pad(size[k, :-k], (k, 0))
        largest = jnp.maximum(largest, jnp.maximum(size[k], beside))
    pulled = jnp.abs(model.gradient) / jnp.maximum(jnp.abs(x), 1.0)
    largest = jnp.maximum(largest, pulled)
    return jnp.where(largest > 0, largest, 1.0)


def _least_curved(factor: Factor) -> Array:
    """p with p.Hp the first pivot that is not positive, p = L^-T e: of a factor not positive."""
    nodes = jnp.arange(factor.pivots.shape[0])
    first = jnp.argmax(~(factor.pivots > 0))
    leading = Factor(jnp.where((nodes < first)[:, None], factor.below, 0.0), factor.pivots)
    return substituted(leading, (nodes == first).astype(factor.pivots.dtype))
