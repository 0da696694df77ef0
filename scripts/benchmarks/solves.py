"""The compiled call of a solve alone, ready to be timed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import jax

from jaxclay.methods import loop
from jaxclay.methods.choice import method_settings
from jaxclay.numerics.host import as_float64
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.rough import rough_shape
from jaxclay.solve.certified_newton import packed, program
from jaxclay.solve.start import start_of


def compiled_call(problem: Problem, start: Any, method: str) -> Callable[[], Any]:
    """The compiled call of :func:`jaxclay.minimize` alone, its arguments ready on the device."""
    rough, settings = rough_shape(problem), method_settings(method, {})
    begin = start_of(problem, rough.point, start, method)
    if method == "newton":
        values = on_device(packed(problem.system, begin, settings, rough.feasible))
        return lambda: program.whole(values)
    values = on_device((problem, begin, settings, rough.feasible))
    return lambda: loop.solve.whole(*values, method=method)


def on_device(values: Any) -> Any:
    """The same as float64 arrays of JAX's."""
    with jax.enable_x64(True):
        return jax.device_put(as_float64(values))
