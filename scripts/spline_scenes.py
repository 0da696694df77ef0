"""What the parts of the spline benchmark share: scenes, what is true of them, figures."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from bounds import Bound

from jaxclay.compare.accuracy import truth
from jaxclay.compare.population import RandomScene, population
from jaxclay.compare.solves import Way
from jaxclay.solution import Solution

_TRUTH, _TRUE = 1e-7, 2e-6  # tolerance of the answers taken for true, largest estimate of those


class Effort(NamedTuple):
    """How thoroughly to measure.

    Attributes
    ----------
    scenes : int
        Of the random population, for errors.
    timed : int
        The first so many of them are timed.
    slices : tuple of int
        Grids of the paper's scheme.
    elements : tuple of int
        Uniform spans for orders, each twice the one before.
    seconds : float
        Of timed repeats that a solve gets.
    batch : int
        Squashes solved at once.
    """

    scenes: int
    timed: int
    slices: tuple[int, ...]
    elements: tuple[int, ...]
    seconds: float
    batch: int


THOROUGH = Effort(200, 60, (64, 128, 256, 512, 1024, 2048, 4096), (4, 8, 16, 32), 0.05, 512)
QUICK = Effort(12, 4, (64, 128, 256), (4, 8, 16), 0.02, 32)
ADAPTIVE = Way("spline", "newton", 5, True, 1e-4)
FIXED = Way("spline", "newton", 5, False, 8)


class Known(NamedTuple):
    """A scene and the answer that its errors are measured from."""

    scene: RandomScene
    exact: Solution


@lru_cache
def known(count: int) -> tuple[list[Known], str]:
    """Scenes of which the truth is known, and a note on the others."""
    every = [Known(scene, truth(scene, _TRUTH)) for scene in population(count)]
    true = [one for one in every if float(one.exact.error_estimate or np.inf) <= _TRUE]
    others = " ".join(str(one.scene.number) for one in every if one not in true)
    return true, f"left out, as no answer to {_TRUE:g} was found: scenes {others or 'none'}"


def percentiles(values, form: str = "{:.3g}") -> str:
    """Median, 10%, 90%, 99%."""
    values = np.asarray(values, float)
    if not len(values):
        return "-"
    cells = (form.format(value) for value in _percentile(values, (50, 10, 90, 99)))
    return "{} [{}, {}, {}]".format(*cells)


def _percentile(values, share) -> np.ndarray:
    # Of the values themselves, so that inf may be among them.
    return np.percentile(np.asarray(values, float), share, method="inverted_cdf")


def at_most(what: str, values, share: float, most: float, unit: str = "") -> Bound:
    """A bound on a percentile from above."""
    value = float(_percentile(values, share)) if len(values) else np.nan
    return Bound(what, f"<= {most:g}{unit}", f"{value:.3g}{unit}", value <= most)


def at_least(what: str, values, share: float, least: float, unit: str = "") -> Bound:
    """A bound on a percentile from below."""
    value = float(_percentile(values, share)) if len(values) else np.nan
    return Bound(what, f">= {least:g}{unit}", f"{value:.3g}{unit}", value >= least)
