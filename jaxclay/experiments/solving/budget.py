"""A solve with a budget in seconds.

A solve is one compiled call that nothing interrupts.  So it is given iterations instead of
seconds: as many as fit into them at the speed of the last one, and more, afresh, if it comes to
its limit early.  What is out of time has run for all of it.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any

import numpy as np

from jaxclay.experiments.contestants import Ready
from jaxclay.experiments.solving.clock import Times, compile_s, compiled
from jaxclay.solve.solution import Solution, Status

OUT_OF_TIME = "out of time"
_FIRST = 64  # iterations of which the first speed is taken
_MOST_GROWTH = 16.0  # of the iterations from one run to the next
_NEARLY = 0.9  # of its time: a run that took that much had all of it
_speeds: dict[Hashable, float] = {}  # iterations in a second, by program


def attempt(
    ready: Callable[[dict[str, Any]], Ready], program: Hashable, seconds: float, most: float
) -> tuple[Solution, Times, bool]:
    """The best answer within the time, its times, and whether its time ended it.

    ``most`` iterations are allowed whatever the time.
    """
    if program not in _speeds:
        compiled(program, ready({"max_iterations": 1}).call)
        _speeds[program] = _FIRST / seconds
    limit = max(int(_speeds[program] * seconds), 1)
    while True:
        limit = int(min(limit, most))
        now = ready({"max_iterations": limit})
        outcome, taken = compiled(program, now.call)
        answer = now.certified(outcome)
        iterations = int(answer.iterations)
        _speeds[program] = max(iterations, 1) / taken
        ended = iterations < limit or limit == most
        if ended or taken >= _NEARLY * seconds:
            times = Times(taken, taken, taken, compile_s(program), repeats=1, batch=1)
            return answer, times, not ended and answer.status is Status.ITERATION_LIMIT
        limit = int(limit * np.clip(seconds / taken, 1.2, _MOST_GROWTH)) + 1
