"""``lbfgsb``: L-BFGS-B over the thicknesses, which makes lower bounds plain boxes.

The iterations are jaxopt's own (Byrd, Lu and Nocedal 1995); the unknowns are in
:mod:`jaxclay.methods.thickness`, stages and stopping in
:mod:`jaxclay.methods.smoothed`.
"""

from __future__ import annotations

import jax.numpy as jnp

from jaxclay.methods.coordinates import normalised
from jaxclay.methods.lbfgs import import_jaxopt
from jaxclay.methods.smoothed import Descent, method
from jaxclay.methods.thickness import EPS, BoundedSettings, eliminated

_MEMORY = 10


def _solver(task):
    jaxopt = import_jaxopt()
    return jaxopt.LBFGSB(task.energy, history_size=_MEMORY, tol=0.0, implicit_diff=False)


def _init(task, x):
    return _solver(task).init_state(x, tuple(task.bounds))


def _advance(task, x, state):
    new, state = _solver(task).update(x, state, tuple(task.bounds))
    # It leaves the box by rounding (1e-16 at most was seen), so the gradient still fits.
    new = task.bounds.nearest(new)
    size = jnp.linalg.norm(task.bounds.nearest(new - state.grad) - new)
    failed = state.failed_linesearch | jnp.all(new == x) | ~jnp.all(jnp.isfinite(new))
    return new, state, size, failed


METHOD = method(
    Descent(_init, _advance),
    normalised(eliminated),
    EPS,
    "jaxopt's L-BFGS-B in the thicknesses, above the lower bound",
    BoundedSettings,
)
