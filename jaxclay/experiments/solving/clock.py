"""The one clock: it times exactly the call that a user makes, with compiling apart.

What is timed is called until a call compiles nothing, by JAX's own word; a timed call in which
JAX compiles after all, as where it has let go of old programs, does not count.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

import jax
import numpy as np
from jax.experimental.compilation_cache import compilation_cache

from jaxclay.experiments.contestants import Ready
from jaxclay.solve.solution import Solution, Status

OUT_OF_TIME = "out of time"
_LONG = 0.05  # seconds: a run longer than that is made twice only
_VERY_LONG = 0.15  # seconds: and longer than that, once
_ENOUGH = 0.02  # seconds of repeats that short runs get
_MOST_REPEATS = 25
_MOST_COMPILING = 5  # calls in which JAX may compile before one is taken as it is
_FIRST = 64  # iterations of which the first speed within a budget is taken
_MOST_GROWTH = 16.0  # of the iterations from one run within a budget to the next
_NEARLY = 0.9  # of its time: a run that took that much had all of it
_NONE = np.zeros(0)


class Times(NamedTuple):
    """Columns of times; seconds are medians of ``repeats`` calls.

    In a batch of throughput ``solve_s`` is the call's share of each task, and compiling is in it.
    """

    solve_s: float = np.nan
    solve_s_least: float = np.nan
    solve_s_most: float = np.nan
    compile_s: float = np.nan
    first_s: float = np.nan
    repeats: int = 0
    batch: int = 0
    trace_iterations: np.ndarray = _NONE
    trace_s: np.ndarray = _NONE
    trace_energy: np.ndarray = _NONE


_spent = [0.0]  # seconds that JAX says it has compiled for in this process
_compiling: dict[Hashable, float] = {}  # seconds by program
_speeds: dict[Hashable, float] = {}  # iterations in a second, by program


def _add(event: str, duration_secs: float, **_: Any) -> None:
    _spent[0] += duration_secs if event.startswith("/jax/core/compile/") else 0.0


jax.monitoring.register_event_duration_secs_listener(_add)


def clocked(call: Callable[[], Any]) -> tuple[Any, float, float]:
    """What a call returns, its seconds, and those of them that JAX compiled for."""
    before, begin = _spent[0], time.perf_counter()
    answer = jax.block_until_ready(call())
    return answer, time.perf_counter() - begin, _spent[0] - before


def compiled(program: Hashable, call: Callable[[], Any]) -> tuple[Any, float]:
    """The answer and seconds of a call in which JAX compiled nothing.

    What earlier ones compiled is noted as the ``program``'s compiling.
    """
    whole = 0.0
    for _ in range(_MOST_COMPILING):
        answer, seconds, compiling = clocked(call)
        if not compiling:
            break
        whole += compiling
    if whole:
        _compiling[program] = max(_compiling.get(program, 0.0), whole)
    return answer, seconds


def first_answer(program: Hashable, call: Callable[[], Any]) -> float:
    """Seconds of a call with nothing compiled and nothing kept, as the first of a process is."""
    kept = jax.config.jax_enable_compilation_cache  # type: ignore[attr-defined]
    jax.clear_caches()
    try:
        _keep(False)
        _, seconds, _compiling[program] = clocked(call)
    finally:
        _keep(kept)
    return seconds


def _keep(kept: bool) -> None:
    jax.config.update("jax_enable_compilation_cache", kept)
    compilation_cache.reset_cache()  # whether there is one has been noted


def setting_up(program: Hashable, setup: Callable[[], Any]) -> Any:
    """What ``setup`` returns; its seconds are noted as the ``program``'s compiling."""
    ready, seconds, _ = clocked(setup)
    _compiling.setdefault(program, seconds)
    return ready


def timed(program: Hashable, call: Callable[[], Any], repeats: int) -> tuple[Any, Times]:
    """The answer, and the times of so many calls, more of short ones and fewer of long."""
    answer, seconds = compiled(program, call)
    # Short runs are cheap to repeat and noisy, long ones the opposite.
    more = int(np.clip(_ENOUGH / max(seconds, 1e-9), repeats, max(repeats, _MOST_REPEATS)))
    count = more if seconds < _LONG else 2 if seconds < _VERY_LONG else 1
    taken = [seconds, *(compiled(program, call)[1] for _ in range(count - 1))]
    return answer, _times(program, taken)


def _times(program: Hashable, taken: list[float]) -> Times:
    compiling = _compiling.get(program, np.nan)  # or setting a peer up, if known
    middle = float(np.median(taken))
    return Times(middle, min(taken), max(taken), compiling, repeats=len(taken), batch=1)


def within_budget(
    program: Hashable, ready: Callable[[dict[str, Any]], Ready], seconds: float, most: float
) -> tuple[Solution, Times, bool]:
    """The best answer within so many seconds, its times, and whether its time ended it.

    A solve is one compiled call that nothing interrupts.  So it is given iterations instead of
    seconds: as many as fit into them at the speed of the last one, and more, afresh, if it comes
    to its limit early; ``most`` are allowed whatever the time.
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
        _speeds[program] = max(int(answer.iterations), 1) / taken
        ended = answer.iterations < limit or limit == most
        if ended or taken >= _NEARLY * seconds:
            late = not ended and answer.status is Status.ITERATION_LIMIT
            return answer, _times(program, [taken]), late
        limit = int(limit * np.clip(seconds / taken, 1.2, _MOST_GROWTH)) + 1
