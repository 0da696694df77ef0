"""``adam``: Adam over the thicknesses, the first-order baseline that people know.

The iterations are optax's own (Kingma and Ba 2015), each clipped to the lower bound.
Adam's steps do not shrink by themselves: when the least energy has not fallen for a
while, it starts anew from there at half the step.  Stages are in
:mod:`jaxclay.methods.smoothed`; a stage ends at its best shape, or at the last one
where the gradient is small enough.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxclay.methods.base import check_setting
from jaxclay.methods.smoothed import Descent, Task, method
from jaxclay.methods.thickness import EPS, BoundedSettings, eliminated
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.host import is_concrete, pytree

_PATIENCE = 20  # iterations without a new least energy before the step is halved
_SMALL = 1e-6  # change of stretch from whose gradient on steps shrink in proportion, Adam's epsilon
_HALVINGS = 20  # of the step in a stage


@pytree
@dataclasses.dataclass(frozen=True)
class AdamSettings(BoundedSettings):
    """Settings of Adam.

    Attributes
    ----------
    tolerance : float
        Energy to be gained, relative to E_free, at which a stage ends.
    step : float
        The first learning rate: how much a stretch t_i / t0_i changes in an iteration.
    """

    step: Array = 0.03

    def __post_init__(self):
        super().__post_init__()
        if is_concrete(self):
            check_setting("step", self.step, 1e-6, 1.0)


class _Memory(NamedTuple):
    moments: Any
    energy: Array
    gradient: Array
    best: Array
    least: Array  # energy of the best
    waited: Array  # iterations since then
    halvings: Array


def _adam(task: Task):
    import optax

    return optax.adam(task.settings.step, eps=_SMALL * task.curvature)


def _init(task: Task, x: Array) -> _Memory:
    energy, gradient = jax.value_and_grad(task.energy)(x)
    none = jnp.asarray(0)
    return _Memory(_adam(task).init(x), energy, gradient, x, energy, none, none)


def _advance(task: Task, x: Array, memory: _Memory):
    updates, moments = _adam(task).update(memory.gradient, memory.moments)
    new = task.bounds.nearest(x + updates * 0.5**memory.halvings)
    tired = memory.waited >= _PATIENCE
    new = jnp.where(tired, memory.best, new)
    moments = jax.tree.map(lambda a, b: jnp.where(tired, a, b), _adam(task).init(x), moments)
    energy, gradient = jax.value_and_grad(task.energy)(new)
    better = energy < memory.least
    following = _Memory(
        moments,
        energy,
        gradient,
        best=jnp.where(better, new, memory.best),
        least=jnp.where(better, energy, memory.least),
        waited=jnp.where(better | tired, 0, memory.waited + 1),
        halvings=memory.halvings + tired,
    )
    shrunk = task.bounds.nearest(new - gradient / task.curvature)
    size = task.curvature * jnp.linalg.norm(shrunk - new)
    failed = (following.halvings > _HALVINGS) | ~jnp.isfinite(energy)
    return new, following, size, failed


METHOD = method(
    Descent(_init, _advance),
    eliminated,
    EPS,
    "optax's Adam in the thicknesses, its step halved where it makes no headway",
    AdamSettings,
)
