"""``projected-gradient``: accelerated projected gradient over the thicknesses.

The iterations are jaxopt's own (Beck and Teboulle 2009, with backtracking).  The
projection goes to the shapes that are above the lower bound and end where a held end
is, exactly: see :class:`jaxclay.methods.thickness.Simplex`.  An iteration that
raises the energy starts the momentum anew (O'Donoghue and Candes 2015), without which
it oscillates; where one without momentum does, rounding has the last word.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxclay.methods.coordinates import normalised
from jaxclay.methods.lbfgs import import_jaxopt
from jaxclay.methods.smoothed import Descent, method
from jaxclay.methods.thickness import EPS, BoundedSettings, summed


def _solver(task):
    def projection(x, _):
        return task.bounds.nearest(x)

    jaxopt = import_jaxopt()
    return jaxopt.ProjectedGradient(task.energy, projection, tol=0.0, implicit_diff=False)


def _init(task, x):
    return _solver(task).init_state(x), task.energy(x)


def _advance(task, x, state):
    inner, before = state
    new, following = _solver(task).update(x, inner)
    energy = task.energy(new)
    worse = ~(energy <= before)
    calm = following._replace(velocity=x, t=jnp.ones_like(following.t))
    following = jax.tree.map(lambda a, b: jnp.where(worse, a, b), calm, following)
    state = following, jnp.where(worse, before, energy)
    size = jnp.where(worse, jnp.inf, following.error)
    return jnp.where(worse, x, new), state, size, worse & (inner.t == 1)


METHOD = method(
    Descent(_init, _advance),
    normalised(summed),
    EPS,
    "jaxopt's accelerated projected gradient in the thicknesses, above the lower bound",
    BoundedSettings,
)
