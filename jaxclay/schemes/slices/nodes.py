"""Where slices go: nodes on the band's edges, and by a density everywhere else.

Clay that will rest keeps nodes that it has: some of the old ones, none of them anew, so that
heights there stay what they were, bit for bit, squash after squash.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.model.band import Band
from jaxclay.numerics.arrays import Array, fixed, namespace, repeat
from jaxclay.schemes.slices.density import Density

IN_BAND, BESIDE = 2, 4  # least slices under the tool and on a side
_CUTS = 20  # of a stretch, on the way to a node
_STEPS = np.concatenate([-np.geomspace(16, 1 / 16, 17), np.geomspace(1 / 16, 16, 17)])
_NEAREST = 0.2  # of a slice, that is left beside a node that is moved
_FEW = 3  # old slices at rest that are worth keeping


class Stretch(NamedTuple):
    """A stretch of clay and its slices: how many at least and at most; ``old`` nodes to take from.

    ``old`` is None where nodes may lie anywhere.
    """

    low: Array
    high: Array
    least: int
    old: np.ndarray | None = None

    @property
    def most(self) -> float:
        """Most slices it may get."""
        return np.inf if self.old is None else len(self.old) - 1


def stretches(clay: Clay, band: Band, rests: tuple[float, float]) -> tuple[list[Stretch], int]:
    """The stretches of clay from bottom to top on the host, and which of them is the tool's.

    ``rests``: material below the first and above the second is expected to rest.
    """
    lower, upper = float(band.lower), float(band.upper)
    found: list[Stretch] = []
    u = clay.material
    if lower > 0:
        old = u[: np.searchsorted(u, rests[0], side="right")]
        keeps = len(old) > _FEW and old[-1] < lower
        if keeps:
            found.append(Stretch(0.0, old[-1], 1, old))
        found.append(Stretch(old[-1] if keeps else 0.0, lower, BESIDE))
    found.append(Stretch(lower, upper, IN_BAND))
    tool = len(found) - 1
    if upper < 1:
        old = u[np.searchsorted(u, rests[1]) :]
        keeps = len(old) > _FEW and old[0] > upper
        found.append(Stretch(upper, old[0] if keeps else 1.0, BESIDE))
        if keeps:
            found.append(Stretch(old[0], 1.0, 1, old))
    return found, tool


def least_slices(band: Band) -> int:
    """The fewest slices that a squash needs."""
    return IN_BAND + BESIDE * (int(band.lower > 0) + int(band.upper < 1))


def spread(
    found: list[Stretch], tool: int, counts: list[int] | None, slices: int, density: Density, marks
) -> Array:
    """The nodes (n+1,) that put equal shares of the density into the slices of each stretch.

    Slices go to stretches by their shares too, if ``counts`` does not say how many; ``tool`` is
    the stretch under the tool.  The nearest node is moved onto each of the ``marks``.
    """
    xp = namespace(found, density)
    cuts = xp.stack([stretch.low for stretch in found] + [found[-1].high])
    below = density.integral(cuts)
    if counts is None:
        parts = np.diff(below)
        if density.under >= 0:
            parts[tool] = density.under * (cuts[tool + 1] - cuts[tool])
        counts = _shared(slices, found, parts)
    share = [xp.arange(1, count) / count for count in counts]
    level = [
        low + (high - low) * part for low, high, part in zip(cuts, cuts[1:], share, strict=False)
    ]
    free = [i for i, stretch in enumerate(found) if stretch.old is None]
    if density.under >= 0:
        free.remove(tool)
    inner = dict(zip(free, _equidistributed(density, cuts, below, share, free), strict=True))
    nodes = [cuts[:1]]
    for i, stretch in enumerate(found):
        if stretch.old is not None:
            nodes.append(_some(stretch.old, counts[i], density, marks))
            continue
        mine = inner.get(i, level[i])
        mine = _marked(mine, stretch, marks) if xp is np else mine
        nodes.append(xp.concatenate([mine, cuts[i + 1 : i + 2]]))
    return xp.concatenate(nodes)


def _equidistributed(density: Density, cuts, below, share: list, free: list[int]) -> list[Array]:
    """The inner nodes of the stretches ``free``, from shares of their density: all at once."""
    xp = namespace(density, cuts, below, share)
    if not free:
        return []
    one = [xp.ones(share[i].shape) for i in free]
    low = xp.concatenate([cuts[i] * ones for i, ones in zip(free, one, strict=True)])
    high = xp.concatenate([cuts[i + 1] * ones for i, ones in zip(free, one, strict=True)])
    wanted = xp.concatenate([below[i] + (below[i + 1] - below[i]) * share[i] for i in free])

    def cut(bounds):
        low, high = bounds
        middle = (low + high) / 2
        under = fixed(density.integral(middle)) < fixed(wanted)
        return xp.where(under, middle, low), xp.where(under, high, middle)

    def newton(u):
        return u - (density.integral(u) - wanted) / density.value(u)

    if xp is np:
        first = _looked_up(density, cuts, wanted)
        places = np.clip(newton(np.clip(newton(first), low, high)), low, high)
    else:
        low, high = repeat(_CUTS, cut, fixed((low, high)))
        # Two steps carry the derivatives of the places, up to the third.
        places = repeat(2, newton, fixed((low + high) / 2))
    ends = np.cumsum([part.shape[0] for part in one])[:-1]
    return xp.split(places, ends)


def _looked_up(density: Density, cuts: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Where the integral has the wanted values, by straight lines between many places."""
    near = density.at[:, None] + density.length[:, None] * _STEPS
    places = np.concatenate([density.middle, cuts, near.ravel()])
    places = np.sort(np.minimum(np.maximum(places, cuts[0]), cuts[-1]))
    return np.interp(wanted, density.integral(places), places)


def _shared(slices: int, found: list[Stretch], parts: np.ndarray) -> list[int]:
    """How many of the slices each stretch gets, by its part."""
    least = np.array([stretch.least for stretch in found])
    most = np.array([stretch.most for stretch in found])
    parts = np.maximum(parts, 1e-12)
    counts = np.clip(np.floor(parts / parts.sum() * slices), least, most)
    while counts.sum() < slices:
        counts[np.argmax(np.where(counts < most, parts / (counts + 0.5), -1.0))] += 1
    while counts.sum() > slices:
        counts[np.argmin(np.where(counts > least, parts / counts, np.inf))] -= 1
    return [int(count) for count in counts]


def _some(old: np.ndarray, count: int, density: Density, marks: np.ndarray) -> np.ndarray:
    """``count`` + 1 of the old nodes, less the first: ends, and those nearest to equal shares."""
    at = density.integral(old)
    share = at[0] + (at[-1] - at[0]) * np.arange(count + 1) / count
    order, last = np.arange(count + 1), len(old) - 1
    chosen = np.rint(np.interp(share, at, np.arange(len(old)))).astype(int)
    # Each beyond the one before, and below the one after.
    chosen = np.maximum.accumulate(chosen - order) + order
    chosen[-1] = last
    chosen = np.minimum(chosen, last - order[::-1])
    kept = marks[np.isin(marks, old)] if len(marks) else marks
    inner = _marked(old[chosen[1:-1]], Stretch(old[0], old[-1], 1), kept)
    return np.append(inner, old[-1])


def _marked(inner: np.ndarray, stretch: Stretch, marks: np.ndarray) -> np.ndarray:
    """Nodes whose nearest one is moved onto each mark inside the stretch, each at most once."""
    if not len(marks):
        return inner
    inner, taken = inner.copy(), np.zeros(len(inner), bool)
    for mark in marks:
        if not stretch.low < mark < stretch.high or not len(inner):
            continue
        i = int(np.argmin(np.where(taken, np.inf, abs(inner - mark))))
        below = inner[i - 1] if i > 0 else stretch.low
        above = inner[i + 1] if i + 1 < len(inner) else stretch.high
        # Nearer to its neighbours it would make slices that rounding spoils.
        low = below + _NEAREST * (inner[i] - below)
        if not taken[i] and low < mark < above - _NEAREST * (above - inner[i]):
            inner[i], taken[i] = mark, True
    return inner
