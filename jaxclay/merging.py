"""Fewer pieces for the same contour: neighbours become one where it hardly moves."""

from __future__ import annotations

import numpy as np

from jaxclay.bernstein import hermite, in_piece

_NO_WIDTH = 1e-13  # of the volume: rounding apart, such a piece is empty
# Where contours are compared on each of the given pieces: Chebyshev's points and both ends.
_PLACES = (1 - np.cos(np.pi * np.arange(7) / 6)) / 2


def merged(
    breaks: np.ndarray, control: np.ndarray, r0: float, unit: float, tolerance: float
) -> tuple[np.ndarray, np.ndarray]:
    """The same clay in fewer pieces, on the host: (breaks, control) without empty ones.

    Two neighbours become the piece with the Y, Y_u and Y_uu of their outer ends
    if (X, Y) moves nowhere by more than ``tolerance`` along the contour's normal
    and the piece's slope has positive Bernstein coefficients.  That is repeated,
    always measured against what was given, until no pair merges.  A break where
    Y_u or Y_uu jumps so stays unless it cannot be seen.

    Parameters
    ----------
    breaks, control : (m+1,), (m, 6) arrays
        As in :class:`jaxclay.SmoothClay`.
    r0, unit : float
        Of the clay.
    tolerance : float
        Over l.
    """
    breaks, control = without_empty(breaks, control)
    given = _Given(breaks, control, float(r0))
    first = np.arange(len(breaks))  # piece j now covers the given first[j] .. first[j+1] - 1
    pairs = np.arange(len(control) - 1)  # j: whether pieces j and j + 1 merge is not known yet
    while len(pairs):
        fits = given.moved(first[pairs], first[pairs + 2]) <= tolerance * unit
        taken = _every_other(pairs[fits])
        is_new = np.zeros(len(first) - 1, bool)
        is_new[taken] = True
        first, is_new = np.delete(first, taken + 1), np.delete(is_new, taken + 1)
        pairs = np.flatnonzero(is_new[:-1] | is_new[1:])
    low, high = first[:-1], first[1:]
    alone = (high - low == 1)[:, None]
    return breaks[first], np.where(alone, control[low], given.joined(low, high))


def padded(breaks: np.ndarray, control: np.ndarray, pieces: int) -> tuple[np.ndarray, np.ndarray]:
    """The same with empty pieces at the end, ``pieces`` in all.

    Raises
    ------
    ValueError
        There are more pieces already.
    """
    missing = pieces - len(control)
    if missing < 0:
        raise ValueError(f"{len(control)} pieces do not fit into {pieces}: ask for more, or merge")
    top = np.full((missing, control.shape[1]), control[-1, -1])
    return np.append(breaks, np.ones(missing)), np.concatenate([control, top])


class _Given:
    """The contour at ``_PLACES`` of each of m pieces, and what joining neighbours makes of it."""

    def __init__(self, breaks: np.ndarray, control: np.ndarray, r0: float):
        width = np.diff(breaks)
        self.breaks, self.r0 = breaks, r0
        self.u = breaks[:-1, None] + width[:, None] * _PLACES
        self.u[:, -1] = breaks[1:]
        Y, Y_u, Y_uu, _ = values = in_piece(control[:, None], width[:, None], _PLACES)
        self.start = np.stack([v[:, 0] for v in values[:3]])
        self.end = np.stack([v[:, -1] for v in values[:3]])
        self.X, self.Y = r0 / np.sqrt(Y_u), Y
        X_u = -self.X * Y_uu / (2 * Y_u)
        length = np.hypot(X_u, Y_u)
        self.normal = Y_u / length, -X_u / length

    def joined(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Control (p, 6) of the pieces that replace those given from low to high - 1, (p,)."""
        width = self.breaks[high] - self.breaks[low]
        return hermite(width, tuple(self.start[:, low]), tuple(self.end[:, high - 1]))

    def moved(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """(p,) by how much each moves the contour along its normal; inf if Y_u might fall."""
        control, width = self.joined(low, high), self.breaks[high] - self.breaks[low]
        count = high - low
        begins = np.cumsum(count) - count
        owner = np.repeat(np.arange(len(low)), count)
        piece = np.arange(len(owner)) - np.repeat(begins - low, count)
        s = (self.u[piece] - self.breaks[low][owner, None]) / width[owner, None]
        Y, Y_u = in_piece(control[owner, None], width[owner, None], s, 2)
        X = self.r0 / np.sqrt(np.maximum(Y_u, 1e-300))
        across = (X - self.X[piece]) * self.normal[0][piece]
        across += (Y - self.Y[piece]) * self.normal[1][piece]
        farthest = np.maximum.reduceat(np.abs(across).max(axis=1), begins)
        return np.where((np.diff(control, axis=1) > 0).all(axis=1), farthest, np.inf)


def _every_other(pairs: np.ndarray) -> np.ndarray:
    """Of each run of consecutive numbers the first, third, fifth, ..."""
    place = np.arange(len(pairs))
    starts = np.append(True, np.diff(pairs) > 1)[: len(pairs)]
    return pairs[(place - np.maximum.accumulate(np.where(starts, place, 0))) % 2 == 0]


def without_empty(breaks: np.ndarray, control: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same clay without pieces whose width is none but for rounding."""
    filled = np.diff(breaks) > _NO_WIDTH
    starts = breaks[:-1][filled]
    starts[0] = 0.0
    return np.append(starts, 1.0), control[filled]
