"""``scipy-lbfgsb`` and ``scipy-trust-constr``: SciPy's minimisers with energies from JAX.

L-BFGS-B (Byrd, Lu, Nocedal and Zhu 1995) works in the stretches, where the floor is
a bound, with friction smoothed in stages.  In friction's slack pair, p, q >= 0, it
is faster in snake units but gets nowhere with the printed constants (measured).

trust-constr, an interior-point method with conjugate gradients (Byrd, Hribar and
Nocedal 1999), takes the slack form and the exact banded Hessian.
"""

from __future__ import annotations

import time
import warnings

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.experiments.peers import stretches
from jaxclay.experiments.peers.base import Limits, Peer, Task, outcome
from jaxclay.experiments.peers.slack import slack_form
from jaxclay.numerics.arrays import Array
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.sums import Displaced

_MEMORY = 50  # pairs that L-BFGS-B keeps
_BAND = 2  # half-bandwidth of the Hessian in the thicknesses
_LAST_BARRIER = 1e-12
_AWAY = 1e-2  # over the unit l: where trust-constr starts its slacks


def _setup_lbfgsb(problem: Problem, start: Displaced, limits: Limits) -> Task:
    from scipy import optimize

    first = np.asarray(stretches.stretches(problem, start))
    moves = np.asarray(stretches.unknown(problem))
    low = np.where(moves, float(problem.material.floor), first)
    bounds = np.stack([low, np.where(moves, np.inf, first)], axis=1)
    arguments = jax.device_put((problem, start))

    def fun(x, eps):
        with jax.enable_x64(True):
            value, gradient = _smoothed(*arguments, x, eps)
        return float(value), np.asarray(gradient)

    def solve():
        x, iterations, finished, over = np.maximum(first, low), 0, False, _Watch(limits.seconds)
        for eps in stretches.LADDER:
            options = {
                "maxiter": limits.max_iterations - iterations,
                "maxfun": 10 * limits.max_iterations,
                "maxcor": _MEMORY,
                "gtol": limits.tolerance,
                "ftol": 0.0,
                "maxls": 40,
            }
            found = optimize.minimize(
                fun, x, eps, "L-BFGS-B", jac=True, bounds=bounds, callback=over, options=options
            )
            x, iterations = found.x, iterations + found.nit
            finished = iterations < limits.max_iterations and not over.rung
            if not finished:
                break
        return x, iterations, finished

    def read(answer):
        x, iterations, finished = answer
        with jax.enable_x64(True):
            point = stretches.point_of(*arguments, x)
        return outcome(point.thickness, point.shift, iterations, finished)

    fun(first, 1.0)  # compiles
    return Task(solve, read)


def _setup_trust_constr(problem: Problem, start: Displaced, limits: Limits) -> Task:
    from scipy import optimize, sparse

    form = slack_form(problem, start)
    slacks = len(form.lower) - form.thicknesses
    arguments, nothing = jax.device_put((problem, start)), sparse.csr_array((slacks, slacks))

    def fun(x):
        with jax.enable_x64(True):
            value, gradient = _smooth(*arguments, form.thickness(x))
        gradient = np.concatenate([np.asarray(gradient)[form.loose], np.zeros(slacks)])
        return float(value) + form.friction @ x, gradient + form.friction

    def hessian(x):
        with jax.enable_x64(True):
            bands = np.asarray(_bands(*arguments, form.thickness(x)))
        offsets = range(-_BAND, _BAND + 1)
        H = sparse.csr_array(sparse.dia_array((bands, list(offsets)), shape=(problem.slices,) * 2))
        return sparse.csr_array(sparse.block_diag([H[form.loose][:, form.loose], nothing]))

    first = form.start(_AWAY)
    settings = {
        "constraints": optimize.LinearConstraint(form.matrix, form.target, form.target),  # type: ignore[arg-type]
        "bounds": optimize.Bounds(form.lower, np.inf, keep_feasible=True),  # type: ignore[arg-type]
        "options": {
            "maxiter": limits.max_iterations,
            "gtol": limits.tolerance,
            "xtol": _LAST_BARRIER,
            "barrier_tol": _LAST_BARRIER,
            "initial_barrier_parameter": 1e-2,
            "initial_barrier_tolerance": 1e-2,
        },
    }

    def solve():
        over = _Watch(limits.seconds)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a Jacobian that has rank to spare
            found = optimize.minimize(
                fun, first, method="trust-constr", jac=True, hess=hessian, callback=over, **settings
            )
        return found, over.rung

    def read(answer):
        found, late = answer
        return form.read(found.x, found.nit, not late and found.status != 0)

    fun(first)  # compiles
    hessian(first)
    return Task(solve, read)


class _Watch:
    """A callback that ends a solve of SciPy's when its time is up."""

    def __init__(self, seconds: float):
        self.end = time.perf_counter() + seconds
        self.rung = False

    def __call__(self, intermediate_result):
        if time.perf_counter() > self.end:
            self.rung = True
            raise StopIteration


@jax.jit
def _smoothed(problem: Problem, start: Displaced, x: Array, eps: Array):
    return jax.value_and_grad(stretches.objective, argnums=2)(problem, start, x, eps)


def _energy(problem: Problem, start: Displaced, thickness: Array) -> Array:
    return problem.slices * problem.free_smooth(Displaced(thickness, start.shift))


_smooth = jax.jit(jax.value_and_grad(_energy, argnums=2))


@jax.jit
def _bands(problem: Problem, start: Displaced, thickness: Array) -> Array:
    """(5, n) diagonals of the Hessian, SciPy's way: entry j of a diagonal is in column j."""
    n, colours = problem.slices, 2 * _BAND + 1

    def product(v):
        gradient = jax.grad(lambda t: _energy(problem, start, t))
        return jax.jvp(gradient, (thickness,), (v,))[1]

    columns = jnp.arange(n)
    products = jax.vmap(product)(
        jnp.stack([columns % colours == c for c in range(colours)]).astype(float)
    )
    rows = columns - jnp.arange(-_BAND, _BAND + 1)[:, None]
    return products[columns % colours, jnp.clip(rows, 0, n - 1)]


LBFGSB = Peer(
    ("scipy",),
    _setup_lbfgsb,
    Limits(max_iterations=10_000, tolerance=1e-10),
    "SciPy's L-BFGS-B: bounds on the stretches, friction smoothed in stages",
)
TRUST_CONSTR = Peer(
    ("scipy",),
    _setup_trust_constr,
    # A looser tolerance is met, and ends it, while the barrier still stands.
    Limits(max_iterations=1000, tolerance=1e-16),
    "SciPy's trust-constr: interior point, exact banded Hessian, friction's slack pair",
)
