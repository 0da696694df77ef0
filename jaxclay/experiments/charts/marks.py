"""Marks: what an attempt at a minimum came to, apart from what the method says of itself."""

from __future__ import annotations

import enum

# Two certified minima of a scene are the same where their energies differ by less, over E_free.
# The certificate itself lets 1e-10 pass.
SAME = 1e-8


class Mark(enum.Enum):
    """How an attempt ended: its symbol in the charts, its colour, and what it means."""

    SOLVED = "✓", "#0072B2", "certified, and the certified answer of another method lies no lower"
    STALLED = "s", "#E69F00", "the method stopped by its own rule where the certificate refuses"
    OUT_OF_TIME = "t", "#F5D9A0", "still going on when its time was over"
    ITERATION_LIMIT = "i", "#D9C58B", "still going on when its iterations were used up"
    REFUSED = "r", "#B0B0B0", "no answer, and the message says why"
    NON_FINITE = "∞", "#CC79A7", "energy or step became infinite or not a number"
    WRONG = "X", "#000000", "called converged, but a certified minimum lies lower"

    def __init__(self, symbol: str, colour: str, meaning: str):
        self.symbol, self.colour, self.meaning = symbol, colour, meaning

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ").replace("non finite", "non-finite")


def mark_of(status: str, gap: float) -> Mark:
    """The mark of an answer whose energy lies ``gap`` above another method's certified minimum.

    ``gap`` is over E_free, nan where no such minimum is known.
    """
    if status == "converged":
        return Mark.WRONG if gap > SAME else Mark.SOLVED
    return {str(mark): mark for mark in Mark}.get(status, Mark.REFUSED)
