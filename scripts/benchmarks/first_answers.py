"""First answers of a fresh process: python first_answers.py NAME prints what each costs.

A JSON list with an entry for each step: CPU seconds of all threads, seconds that XLA compiled,
programs that it compiled.  Imports come before the first step.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable

import jax
from clocks import compilations

import jaxclay

Steps = list[Callable[[], object]]


def lbfgs() -> Steps:
    """jaxopt.LBFGS on the reference scene, n = 64, snake units: what J is."""
    import jax.numpy as jnp
    import jaxopt

    jax.config.update("jax_enable_x64", True)
    n, r0, k, mu = 64, 0.5, 1.0, 1.0
    h = 1 / n
    alpha, beta = h**2, h**4
    Y0 = jnp.arange(n + 1) * h
    band = (r0 / 0.4) ** 2 * Y0[:13]  # eqs. 10, 11: u0 = 3/16

    def E_total(free):  # eqs. 9, 20-22, frozen: not the package's own, which may become faster
        Y = jnp.concatenate([band, free])
        Y_u = jnp.diff(Y) / h
        X = r0 / jnp.sqrt(Y_u)
        strain = h * jnp.sum(k / 2 * (Y_u - 1) ** 2)
        friction = h * mu * jnp.sum(jnp.abs(Y - Y0))
        tension = h * alpha * (jnp.sum((jnp.diff(X) / h) ** 2) + jnp.sum(Y_u**2))
        turns = jnp.sum((jnp.diff(X, 2) / h**2) ** 2) + jnp.sum((jnp.diff(Y, 2) / h**2) ** 2)
        return strain + friction + tension + h * beta * turns

    start = Y0[13:] + band[-1] - Y0[12]  # pushed up without a change of shape

    def answer():
        found = jaxopt.LBFGS(E_total, tol=1e-6, maxiter=500).run(start)
        return jax.block_until_ready(found)

    return [answer]


def deform() -> Steps:
    """On 64 slices."""
    return [lambda: _squashed([(0.0, 0.29296875, 0.4)], slices=64)]


def tolerance() -> Steps:
    """To 1e-4; then three more squashes of that piece."""
    pieces = []
    more = [(0.5, 0.7, 0.42), (0.1, 0.2, 0.36), (0.8, 1.0, 0.45)]
    return [
        lambda: pieces.append(_squashed([(0.0, 0.29296875, 0.4)], tolerance=1e-4)),
        lambda: _squashed(more, pieces[0], tolerance=1e-4),
    ]


def sessions() -> Steps:
    """Two sessions of 20 squashes to 1e-3."""
    from answers_accuracy import squash_often
    from slices_scenes import MATERIALS

    material = MATERIALS["snake"]
    return [lambda seed=seed: squash_often(seed, material, 1e-3) for seed in (100, 101)]


def _squashed(squashes, clay=None, **how):
    clay = jaxclay.Clay.cylinder() if clay is None else clay
    for squash in squashes:
        material = jaxclay.Material.from_snake_units()
        answer = jaxclay.deform(clay, jaxclay.Squash(*squash), material, **how)
        clay = answer.raise_for_status().clay
    return clay


def main(name: str) -> None:
    """Run the steps of a name."""
    steps, rows = globals()[name](), []
    for step in steps:
        compilations.clear()
        begin = time.process_time()
        step()
        rows.append([time.process_time() - begin, sum(compilations), len(compilations)])
    print(json.dumps(rows))


if __name__ == "__main__":
    main(sys.argv[1])
