"""What the throughput benchmark solves, and in which ways."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from population import population

import jaxclay

_SLICES = 64
_TOLERANCE = 1e-4


class Way(NamedTuple):
    """One scene solved: as users call it, and as part of a compiled call, if it can be."""

    single: Callable[..., Any]
    one: Callable[[Any], Any] | None


def scenes(name: str, count: int, seed: int = 0) -> list[tuple]:
    """The arguments of a way, for so many scenes that can be posed."""
    found = []
    for scene in population(2 * count, seed, worked=False):
        clay = jaxclay.Clay.cylinder(float(scene.clay.r0), slices=_SLICES)
        whole = clay, scene.squash, scene.material
        try:
            problem = jaxclay.pose(*whole, scheme="paper")
        except ValueError:  # a band too small for so few slices
            continue
        found.append((problem,) if name == "solve" else whole)
        if len(found) == count:
            return found
    raise ValueError(f"fewer than {count} scenes can be posed")


def _solve(scene):
    answer = jaxclay.minimize(*scene)
    return answer.heights, answer.status_code


def _on_slices(clay, squash, material):
    return jaxclay.deform(clay, squash, material, scheme="paper")


def _deform(scene):
    answer = _on_slices(*scene)
    return answer.heights, answer.status_code


def _on_spans(clay, squash, material):
    return jaxclay.minimize(jaxclay.pose(clay, squash, material, scheme="spline"))


def _spline(scene):
    answer = _on_spans(*scene)
    return answer.heights, answer.status_code


WAYS = {
    "solve": Way(jaxclay.minimize, _solve),
    "deform": Way(_on_slices, _deform),
    "spline": Way(_on_spans, _spline),
    f"to {_TOLERANCE:g}": Way(lambda *scene: jaxclay.deform(*scene, tolerance=_TOLERANCE), None),
}
