"""Many problems of one shape in one compiled call.

On a CPU the call solves one problem after the other, each to its own end, so that nobody waits
for a straggler; how many there are is an argument, so that a batch that is not full neither
compiles anew nor computes more than it needs.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.methods.choice import method_settings
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.host import compiled, let_go
from jaxclay.schemes.problem import Problem
from jaxclay.solve.batch import minimize_batch, stack
from jaxclay.solve.minimize import minimize
from jaxclay.solve.solution import Solution

CAPACITY = 256  # problems of one call


def minimized(
    problems: list[Problem], method: str, settings: list[dict[str, float]]
) -> list[Solution]:
    """The answers to problems on as many slices each, with the settings of each."""
    if method == "newton":
        return minimize_batch(problems, [method_settings(method, one) for one in settings])
    chosen = [_apart(method_settings(method, one)) for one in settings]
    answers: dict[int, Solution] = {}
    for shape in dict.fromkeys(shape for _, shape in chosen):
        same = [i for i, (_, its) in enumerate(chosen) if its == shape]
        for begin in range(0, len(same), CAPACITY):
            part = same[begin : begin + CAPACITY]
            pairs = [(problems[i], chosen[i][0]) for i in part]
            answers.update(zip(part, _solved(pairs, method, shape), strict=True))
    return [answers[i] for i in range(len(problems))]


def _solved(pairs: list[tuple[Problem, dict]], method: str, shape: tuple) -> list[Solution]:
    let_go()
    with jax.enable_x64(True):
        found = _many.whole(
            *stack(pairs, CAPACITY), np.array(len(pairs)), method=method, shape=shape
        )
    leaves, structure = jax.tree.flatten(jax.tree.map(np.asarray, found))
    return [jax.tree.unflatten(structure, [leaf[i] for leaf in leaves]) for i in range(len(pairs))]


@compiled("method", "shape")
def _many(problems: Problem, settings: Any, count: Array, *, method: str, shape: tuple) -> Solution:
    """The first ``count`` answers."""

    def one(i):
        problem, chosen = jax.tree.map(lambda leaf: leaf[i], (problems, settings))
        return minimize(problem, method, **chosen, **dict(shape))

    def put(i, found):
        return jax.tree.map(lambda whole, leaf: whole.at[i].set(leaf), found, one(i))

    shapes = jax.eval_shape(one, 0)
    empty = jax.tree.map(lambda leaf: jnp.zeros((CAPACITY, *leaf.shape), leaf.dtype), shapes)
    return jax.lax.fori_loop(0, count, put, empty)


def _apart(settings: Any) -> tuple[dict[str, float], tuple]:
    """Settings that are arguments of a compiled call, and those that it is compiled for."""
    values = {f: getattr(settings, f.name) for f in dataclasses.fields(settings)}
    free = {f.name: float(v) for f, v in values.items() if not f.metadata.get("static")}
    return free, tuple((f.name, v) for f, v in values.items() if f.name not in free)
