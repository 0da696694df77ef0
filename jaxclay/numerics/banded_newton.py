"""Newton's method for any smooth function with a banded Hessian, in O(n) a step.

    result = minimize_banded(fun, start, half_bandwidth=2)

Where the Hessian H is not positive definite a multiple of the identity is added
(Nocedal and Wright 2006, section 3.4), and every step is cut short until it
lowers the function (Armijo 1966).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.numerics.arrays import Array
from jaxclay.numerics.banded import factorize, local_model, product, reaches_beyond, solve, widest
from jaxclay.numerics.checks import as_number, check_positive
from jaxclay.numerics.host import compiled, in_float64, is_concrete, is_transformed

_FIRST_SHIFT = 1e-8  # over H's largest entry, as are the others
_LAST_SHIFT = 1e8  # where a step is the gradient's and too short to see
_GROWTH, _FALL = 10.0, 0.25
_ARMIJO = 1e-4
_HALVINGS = 40
_NOTHING = 2e-16  # of |f|: lost in rounding

_GOING, _CONVERGED, _STALLED, _LIMIT, _NON_FINITE, _TOO_NARROW = range(-1, 5)
_MEANING = (
    "converged: a full Newton step from here on would gain nothing",
    "stalled: no step lowers the function any more, but the model has no minimum here: rounding "
    "hides it, the Hessian is singular or that of a saddle, or the function is not smooth",
    "iteration limit: raise max_iterations or start nearer; or there is no minimum",
    "non-finite: the function or its derivatives are not finite where it stopped",
    "too narrow: the Hessian has entries outside the bands; raise half_bandwidth",
)


class BandedResult(NamedTuple):
    """Where :func:`minimize_banded` ended.

    Attributes
    ----------
    x : (n,) array
    value : float
        fun at x.
    gradient : (n,) array
        Its gradient at x.
    decrement : float
        1/2 g^T H^-1 g: what the last step, the one that led to x, promised to gain.
    iterations : int
        Passes of the loop, each with one Hessian and one factorisation.
    converged : bool
        Whether x is a local minimum: H positive definite, nothing left to gain.
    code : int
        How it ended: see ``message``.
    """

    x: Array
    value: Array
    gradient: Array
    decrement: Array
    iterations: Array
    converged: Array
    code: Array

    @property
    def message(self) -> str:
        """How it ended, in words."""
        return _MEANING[int(self.code)]


def minimize_banded(
    fun: Callable[..., Array],
    start: Array,
    half_bandwidth: int,
    args: tuple = (),
    tolerance: float = 1e-12,
    max_iterations: int = 200,
) -> BandedResult:
    """Minimise a smooth function R^n -> R whose Hessian is banded, by Newton's method.

    One compiled call, on the host in float64.  It has converged when H is positive
    definite and the decrement 1/2 g^T H^-1 g is at most ``tolerance`` |fun|, or the
    Newton step, in the norm of H, ``tolerance`` times x; that step is still taken.
    Under ``jit`` and ``vmap`` nothing is raised: look at ``converged``.

        def chain(x, weights):
            return jnp.sum(weights * jnp.diff(x, 2) ** 2) + jnp.sum(jnp.cosh(x) - x)

        result = minimize_banded(chain, np.zeros(100), 2, args=(np.ones(98),))

    Parameters
    ----------
    fun : callable
        fun(x, *args) -> scalar, in JAX.  Compiled anew for every function object,
        so give the same one again, not a fresh lambda; what changes goes into ``args``.
    start : (n,) array
        n >= 2.
    half_bandwidth : int
        From 1 to n - 1: d^2 fun / dx_i dx_j = 0 wherever |i - j| exceeds it.  The
        gradient is exact whatever it is, but with a Hessian wider than stated no
        step can be trusted: at every point one product with a vector is compared.
    args : tuple of arrays or pytrees
        New values do not compile anew.  On the host integers become float64.
    tolerance : float
        Of the gain that is left and of the step.
    max_iterations : int
        Most passes of the loop.

    Raises
    ------
    ValueError
        A start that is not a finite vector, a half-bandwidth, tolerance or limit
        out of range, a Hessian wider than stated; the error says how wide it is.
    TypeError
        Inside a JAX transformation while float64 is off; args that are no tuple.
    """
    start = _checked(start, half_bandwidth, args, tolerance, max_iterations)
    name, values = "banded.minimize_banded", (start, args, tolerance, max_iterations)
    result = in_float64(name, _minimize, *values, energy=fun, half_bandwidth=int(half_bandwidth))
    if not is_transformed(result) and result.code == _TOO_NARROW:
        true = int(in_float64(name, _needed, result.x, args, energy=fun))
        needed = max(true, half_bandwidth + 1)
        raise ValueError(f"half_bandwidth must be {needed} for this Hessian, got {half_bandwidth}")
    return result


def _checked(start, half_bandwidth, args, tolerance, max_iterations) -> Array:
    if not isinstance(args, tuple):
        raise TypeError(f"args must be a tuple, such as (a,), got {type(args).__name__}")
    shape = np.shape(start)
    if len(shape) != 1 or shape[0] < 2:
        raise ValueError(f"start must be a vector of at least 2 values, got shape {shape}")
    whole = isinstance(half_bandwidth, int | np.integer)
    if not whole or not 1 <= half_bandwidth < shape[0]:
        raise ValueError(
            f"half_bandwidth must be a whole number from 1 to n - 1 = {shape[0] - 1}, "
            f"got {half_bandwidth!r}"
        )
    check_positive("tolerance", tolerance)
    if is_concrete(max_iterations) and not as_number("max_iterations", max_iterations) >= 1:
        raise ValueError(f"max_iterations must be at least 1, got {max_iterations}")
    if is_concrete(start) and not np.isfinite(start).all():
        i = int(np.argmin(np.isfinite(start)))
        raise ValueError(f"start must be finite, but start[{i}] is {np.asarray(start)[i]}")
    return jnp.asarray(start, float) if is_transformed(start, args) else np.asarray(start, float)


@compiled("energy")
def _needed(x: Array, args: tuple, *, energy) -> Array:
    return widest(lambda x: energy(x, *args), x)


class _State(NamedTuple):
    x: Array
    shift: Array  # of H, over its largest entry
    failed: Array  # whether the last pass found no step
    decrement: Array
    iterations: Array
    code: Array


@compiled("energy", "half_bandwidth")
def _minimize(start, args, tolerance, max_iterations, *, energy, half_bandwidth) -> BandedResult:
    def fun(x):
        return energy(x, *args)

    nothing = _NOTHING * jnp.abs(fun(start))

    def step(state: _State) -> _State:
        return _step(fun, state, half_bandwidth, tolerance, nothing)

    def go_on(state: _State):
        return (state.code == _GOING) & (state.iterations < max_iterations)

    zero = jnp.zeros((), start.dtype)
    none, going = jnp.asarray(0), jnp.asarray(_GOING)
    first = _State(start, zero, jnp.asarray(False), zero + jnp.inf, none, going)
    last = jax.lax.while_loop(go_on, step, first)
    value_and_gradient = jax.value_and_grad(fun)(last.x)
    code = jnp.where(last.code == _GOING, _LIMIT, last.code)
    end = last.decrement, last.iterations, code == _CONVERGED, code
    return BandedResult(last.x, *value_and_gradient, *end)


def _step(fun, state: _State, half_bandwidth: int, tolerance, nothing) -> _State:
    """One factorisation of H + shift, and one step if that is positive definite."""
    x, shift = state.x, state.shift
    value, gradient, bands = local_model(fun, x, half_bandwidth)
    largest = jnp.max(jnp.abs(bands))
    factor = factorize(bands.at[0].add(shift * jnp.where(largest > 0, largest, 1.0)))
    delta = jnp.where(factor.positive, -solve(factor, gradient), 0.0)
    decrement = jnp.where(factor.positive, -gradient @ delta / 2, state.decrement)

    gate = tolerance * jnp.maximum(jnp.abs(value), nothing)
    size = jnp.abs(x) @ product(jnp.abs(bands), jnp.abs(x)) / 2
    near = (decrement <= gate) | (decrement <= tolerance**2 * size)
    near &= factor.positive & (shift == 0)
    length = _line_search(fun, x, value, delta, decrement, jnp.where(near, gate, 0.0))
    fails = ~factor.positive | ((length == 0) & ~near)
    # A saddle, or a minimum along a whole line, where H alone is not positive definite.
    stuck = factor.positive & state.failed & (decrement <= _NOTHING * jnp.abs(value))

    code = jnp.where(near, _CONVERGED, _GOING)
    code = jnp.where(stuck | (fails & (shift >= _LAST_SHIFT)), _STALLED, code)
    code = jnp.where(reaches_beyond(fun, x, bands), _TOO_NARROW, code)
    finite = jnp.isfinite(value + jnp.sum(gradient) + jnp.sum(bands))
    code = jnp.where(finite, code, _NON_FINITE)
    moved = jnp.where((code == _GOING) | (code == _CONVERGED), x + length * delta, x)
    grown, fallen = jnp.maximum(_GROWTH * shift, _FIRST_SHIFT), _FALL * shift
    fallen = jnp.where((fallen < _FIRST_SHIFT) | (decrement <= gate), 0.0, fallen)
    shift = jnp.where(fails, grown, fallen)
    return _State(moved, shift, fails, decrement, state.iterations + 1, code)


def _line_search(fun, x, value, delta, decrement, allowed) -> Array:
    """Longest of some halved steps that lowers the function; 0 where none does.

    ``allowed`` is by how much it may rise all the same.
    """

    def rejected(length):
        there = fun(x + length * delta)
        lowers = there <= value - 2 * _ARMIJO * length * decrement + allowed
        return ~(lowers & jnp.isfinite(there))

    def go_on(carry):
        length, fails = carry
        return fails & (length > 0.5**_HALVINGS)

    def shorter(carry):
        return carry[0] / 2, rejected(carry[0] / 2)

    first = jnp.full((), 2.0, x.dtype), jnp.asarray(True)
    length, fails = jax.lax.while_loop(go_on, shorter, first)
    return jnp.where(fails, 0.0, length)
