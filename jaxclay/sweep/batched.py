"""Many problems of one shape in one compiled call.

On a CPU the call solves one problem after the other, each to its own end, so that nobody waits
for a straggler; how many there are is an argument, so that a batch that is not full neither
compiles anew nor computes more than it needs.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay._host import as_float64, compiled
from jaxclay.clay import Array
from jaxclay.methods.choice import method_settings
from jaxclay.minimize import Solution, minimize
from jaxclay.problem import Problem

CAPACITY = 256  # problems of one call


def minimized(
    problems: list[Problem], method: str, settings: list[dict[str, float]]
) -> list[Solution]:
    """The answers to problems on as many slices each, with the settings of each."""
    chosen = [_as_dict(method_settings(method, one)) for one in settings]
    answers: list[Solution] = []
    for begin in range(0, len(problems), CAPACITY):
        part = slice(begin, begin + CAPACITY)
        answers += _solved(problems[part], method, chosen[part])
    return answers


def _solved(problems: list[Problem], method: str, settings: list[dict]) -> list[Solution]:
    with jax.enable_x64(True):
        stacked = stack([*zip(problems, settings, strict=True)], CAPACITY)
        found = _many.whole(*stacked, np.array(len(problems)), method=method)
        found = jax.tree.map(np.asarray, found)
    return list(unstack(found, len(problems)))


@compiled("method")
def _many(problems: Problem, settings: Any, count: Array, *, method: str) -> Solution:
    """The first ``count`` answers."""

    def one(i):
        problem, chosen = jax.tree.map(lambda leaf: leaf[i], (problems, settings))
        return minimize(problem, method, **chosen)

    def put(i, found):
        return jax.tree.map(lambda whole, leaf: whole.at[i].set(leaf), found, one(i))

    shapes = jax.eval_shape(one, 0)
    empty = jax.tree.map(lambda leaf: jnp.zeros((CAPACITY, *leaf.shape), leaf.dtype), shapes)
    return jax.lax.fori_loop(0, count, put, empty)


def stack(trees: list[Any], size: int | None = None) -> Any:
    """One tree of arrays with a leading axis, filled up to ``size`` with the last tree."""
    trees = as_float64(trees)
    trees = trees + [trees[-1]] * ((size or len(trees)) - len(trees))
    return jax.tree.map(lambda *leaves: np.stack(leaves), *trees)


def unstack(tree: Any, count: int) -> Iterator[Any]:
    """The first ``count`` trees of a stack."""
    leaves, structure = jax.tree.flatten(tree)
    for i in range(count):
        yield jax.tree.unflatten(structure, [leaf[i] for leaf in leaves])


def _as_dict(settings: Any) -> dict[str, float]:
    return {
        field.name: float(getattr(settings, field.name)) for field in dataclasses.fields(settings)
    }
