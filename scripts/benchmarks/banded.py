"""minimize_banded beside Optimistix and SciPy on smoothed Poisson counts; see scripts/docs.

Medians of warm calls made in turn, on one thread, since SciPy's and JAX's get in each other's
way.  The error is the largest of the log rates, from those of minimize_banded; Optimistix's BFGS
holds a dense matrix and takes part up to n = 1000.
"""

from __future__ import annotations

import os
from collections.abc import Callable

os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import jax
import jax.numpy as jnp
import numpy as np
import optimistix
import scipy.optimize
from clocks import medians

from jaxclay.numerics.banded_newton import minimize_banded

WEIGHT = 1e3


def poisson(x, counts):
    """Counts with a penalty on second differences, per count."""
    loss = jnp.sum(jnp.exp(x) - counts * x)
    return (loss + WEIGHT / 2 * jnp.sum(jnp.diff(x, 2) ** 2)) / x.shape[0]


def solvers(counts: np.ndarray) -> dict[str, Callable[[], tuple[np.ndarray, int]]]:
    """Each a call that returns x and the iterations."""
    start = np.zeros(len(counts))
    args = jnp.asarray(counts)
    with_gradient = jax.jit(jax.value_and_grad(poisson))
    push = jax.jit(lambda x, p: jax.jvp(lambda x: jax.grad(poisson)(x, args), (x,), (p,))[1])
    bfgs = optimistix.BFGS(rtol=1e-9, atol=1e-9)

    @jax.jit
    def by_bfgs(counts):
        found = optimistix.minimise(poisson, bfgs, start, counts, max_steps=20000, throw=False)
        return found.value, found.stats["num_steps"]

    def banded():
        found = minimize_banded(poisson, start, 2, args=(counts,))
        return found.x, int(found.iterations)

    def scipys(method: str, **more):
        def fun(x):
            value, gradient = with_gradient(x, args)
            return float(value), np.asarray(gradient)

        found = scipy.optimize.minimize(fun, start, jac=True, method=method, **more)
        return found.x, found.nit

    strict = {"maxiter": 5000, "maxfun": 10000, "ftol": 1e-15, "gtol": 1e-9, "maxcor": 20}
    calls = {
        "minimize_banded": banded,
        "SciPy L-BFGS-B": lambda: scipys("L-BFGS-B", options=strict),
        "SciPy trust-krylov": lambda: scipys(
            "trust-krylov", hessp=lambda x, p: np.asarray(push(x, p)), options={"gtol": 1e-9}
        ),
    }
    if len(counts) <= 1000:  # its matrix is dense
        calls["Optimistix BFGS"] = lambda: jax.block_until_ready(by_bfgs(args))
    return calls


def main() -> None:
    """Print a row a solver and size."""
    jax.config.update("jax_enable_x64", True)
    print("| n | solver | ms | iterations | error |\n| --- | --- | --- | --- | --- |")
    for n in (300, 2000):
        rate = 8 + 6 * np.sin(np.linspace(0, 9, n))
        calls = solvers(np.random.default_rng(0).poisson(rate).astype(float))
        times = medians(calls, 1.0)
        best = calls["minimize_banded"]()[0]
        for name, call in calls.items():
            x, iterations = call()
            error = np.abs(np.asarray(x) - best).max()
            seconds = 1e3 * times[name]
            print(f"| {n} | {name} | {seconds:.3g} | {int(iterations)} | {error:.1e} |")


if __name__ == "__main__":
    main()
