"""Newton's method for any smooth function with a banded Hessian, in O(n) a step.

    result = minimize_banded(fun, start, half_bandwidth=2)

.. include:: banded_newton.md
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.numerics.arrays import Array, Bool, Float, Int
from jaxclay.numerics.banded import local_model, solve_exactly, widest
from jaxclay.numerics.banded_steps import BandedStatus, run
from jaxclay.numerics.checks import as_number, check_positive
from jaxclay.numerics.host import _outside, compiled, in_float64, is_concrete, is_transformed

_MEANING = {
    BandedStatus.CONVERGED: "a minimum, to the tolerance or to rounding",
    BandedStatus.STALLED: "no step lowers the function, yet it is no minimum that can be told from "
    "a saddle or a kink: start elsewhere; smooth what is not smooth; or take large constants out "
    "of the function, whose rounding may hide what is left",
    BandedStatus.ITERATION_LIMIT: "raise max_iterations or start nearer; or there is no minimum",
    BandedStatus.NON_FINITE: "the function or its derivatives are not finite where it stopped: "
    "start where they are, or scale the function so that they do not overflow",
    BandedStatus.UNBOUNDED: "the function falls for ever: add what holds it from below, or start "
    "nearer the local minimum that you mean",
    BandedStatus.TOO_NARROW: "the Hessian has entries outside the bands: raise half_bandwidth",
}


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
        Whether x is a local minimum.
    code : int
        How it ended: see ``status`` and ``message``.
    """

    x: Float[Array, "n"]
    value: Float[Array, ""]
    gradient: Float[Array, "n"]
    decrement: Float[Array, ""]
    iterations: Int[Array, ""]
    converged: Bool[Array, ""]
    code: Int[Array, ""]

    @property
    def status(self) -> BandedStatus:
        """How it ended."""
        return BandedStatus(int(self.code))

    @property
    def message(self) -> str:
        """The status, what it means and what to do."""
        return f"{self.status}: {_MEANING[self.status]}"


def minimize_banded(
    fun: Callable[..., Array],
    start: Array,
    half_bandwidth: int,
    args: tuple = (),
    tolerance: float = 1e-12,
    max_iterations: int = 200,
) -> BandedResult:
    """Minimise a smooth function R^n -> R whose Hessian is banded, by Newton's method.

    One compiled call, on the host in float64.  It has converged where the last Newton step
    moves every coordinate x_i by at most ``tolerance`` |x_i| (of those below 1e-8:
    ``tolerance`` 1e-8), or the gradient is nothing but rounding, and H is positive definite,
    or semidefinite with nothing lower.
    Under ``jit`` and ``vmap`` nothing is raised: look at ``converged``.

    ``x`` and ``value`` can be differentiated by ``args``, any number of times and in either mode,
    by the implicit function theorem: dx = -H^-1 d(gradient), with the banded factor at
    the minimum.  This means something only where H is positive definite there.  By ``start``
    the derivative is 0.

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
        Of the last step, over x, coordinate by coordinate.
    max_iterations : int
        Most passes of the loop.

    Raises
    ------
    ValueError
        A start that is not a finite vector, a half-bandwidth, tolerance or limit
        out of range, a Hessian wider than stated; the error says how wide it is.
    TypeError
        Inside a JAX transformation while float64 is off; args that are no tuple; a function
        that closes over traced values, which belong into ``args``.

    References
    ----------
    Nocedal and Wright 2006, *Numerical Optimization*, sections 3.4 and 3.5; Curtis, Powell and
    Reid 1974, *On the estimation of sparse Jacobian matrices*.
    """
    start = _checked(start, half_bandwidth, args, tolerance, max_iterations)
    name, values = "banded.minimize_banded", (start, args, tolerance, max_iterations)
    _check_closure(fun, start, args)
    result = in_float64(name, _minimize, *values, energy=fun, half_bandwidth=int(half_bandwidth))
    if not is_transformed(result) and result.code == BandedStatus.TOO_NARROW:
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


def _check_closure(fun, start, args) -> None:
    """Raise if ``fun`` holds traced values, whose derivatives would be lost."""
    if _outside():
        return
    held = jax.make_jaxpr(lambda x, args: fun(x, *args))(start, args).consts
    if is_transformed(held):
        shapes = ", ".join(str(np.shape(leaf)) for leaf in held if is_transformed(leaf))
        raise TypeError(
            f"fun closes over traced values, of shapes {shapes}: give them in args, as in "
            "minimize_banded(fun, start, half_bandwidth, args=(a,)) with fun(x, a)"
        )


@compiled("energy")
def _needed(x: Array, args: tuple, *, energy) -> Array:
    return widest(lambda x: energy(x, *args), x)


@compiled("energy", "half_bandwidth")
def _minimize(start, args, tolerance, max_iterations, *, energy, half_bandwidth) -> BandedResult:
    return _implicitly(energy, half_bandwidth, start, args, tolerance, max_iterations)


@partial(jax.custom_jvp, nondiff_argnums=(0, 1))
def _implicitly(energy, half_bandwidth, start, args, tolerance, max_iterations) -> BandedResult:
    def fun(x):
        return energy(x, *args)

    last = run(fun, start, half_bandwidth, tolerance, max_iterations)
    value, gradient = jax.value_and_grad(fun)(last.x)
    converged = last.code == int(BandedStatus.CONVERGED)
    end = last.decrement, last.iterations, converged, last.code
    return BandedResult(last.x, value, gradient, *end)


@_implicitly.defjvp
def _implicitly_jvp(energy, half_bandwidth, primals, tangents):
    """Where the gradient stays 0; the rule for derivatives of this rule is the rule itself."""
    args, change = primals[1], tangents[1]
    result = _implicitly(energy, half_bandwidth, *primals)
    x = result.x
    _, rate = jax.jvp(lambda args: jax.grad(energy)(x, *args), (args,), (change,))
    bands = local_model(lambda x: energy(x, *args), x, half_bandwidth).bands
    step = -solve_exactly(bands, rate)
    _, gain = jax.jvp(lambda x, args: energy(x, *args), (x, args), (step, change))
    rest = jax.tree.map(jax.custom_derivatives.zero_from_primal, result)
    return result, rest._replace(x=step, value=gain)
