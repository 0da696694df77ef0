"""``lbfgs``, ``lbfgs-preconditioned`` and ``optax-lbfgs``: limited-memory quasi-Newton.

The iterations are jaxopt's and optax's own (Liu and Nocedal 1989, zoom line
search); stages and stopping are in :mod:`jaxclay.methods.smoothed`.  The unknowns are
heights, or on splines coefficients.
"""

from __future__ import annotations

import warnings
from typing import Any

import jax.numpy as jnp

from jaxclay.methods.coordinates import (
    coefficients,
    heights,
    normalised,
    preconditioned,
    preconditioned_splines,
)
from jaxclay.methods.smoothed import PLAIN_EPS, SCALED_EPS, Descent, method
from jaxclay.numerics.checks import Missing

_MEMORY = 10


def import_jaxopt() -> Any:
    """The module jaxopt, without its notice on import.

    Raises
    ------
    Missing
        It is not installed, or not for the JAX that is: nobody maintains it any more.
    """
    try:
        return _quietly_imported()
    except Exception as error:
        raise Missing(
            f"this method is jaxopt's, which does not import ({error}): pip install jaxopt, or "
            "take another method, such as newton or optax-lbfgs",
            name="jaxopt",
        ) from error


def has_jaxopt() -> bool:
    """Whether :func:`import_jaxopt` succeeds."""
    try:
        return import_jaxopt() is not None
    except Missing:
        return False


def _quietly_imported() -> Any:
    with warnings.catch_warnings():
        warnings.filterwarnings(
            "ignore", message="JAXopt is no longer maintained", category=DeprecationWarning
        )
        import jaxopt

    return jaxopt


def _jaxopt_lbfgs(fun):
    jaxopt = import_jaxopt()
    return jaxopt.LBFGS(fun, history_size=_MEMORY, tol=0.0, implicit_diff=False)


def _jaxopt_init(task, x):
    return _jaxopt_lbfgs(task.energy).init_state(x)


def _jaxopt_advance(task, x, state):
    new, state = _jaxopt_lbfgs(task.energy).update(x, state)
    return new, state, state.error, state.failed_linesearch | jnp.all(new == x)


def _optax_lbfgs():
    import optax

    return optax.lbfgs(memory_size=_MEMORY)


def _optax_init(task, x):
    return _optax_lbfgs().init(x)


def _optax_advance(task, x, state):
    import optax

    value, gradient = optax.value_and_grad_from_state(task.energy)(x, state=state)
    updates, state = _optax_lbfgs().update(
        gradient, state, x, value=value, grad=gradient, value_fn=task.energy
    )
    new = optax.apply_updates(x, updates)
    size = jnp.linalg.norm(optax.tree.get(state, "grad"))
    return new, state, size, jnp.all(new == x)


JAXOPT = Descent(_jaxopt_init, _jaxopt_advance)
_OPTAX = Descent(_optax_init, _optax_advance)

PLAIN = method(
    JAXOPT,
    heights,
    PLAIN_EPS,
    "jaxopt's L-BFGS in the unknowns as they are",
    on_splines=normalised(coefficients),
)
PRECONDITIONED = method(
    JAXOPT,
    preconditioned,
    SCALED_EPS,
    "jaxopt's L-BFGS in coordinates of the start's Hessian",
    on_splines=preconditioned_splines,
)
OPTAX = method(
    _OPTAX,
    heights,
    PLAIN_EPS,
    "optax's L-BFGS in the unknowns as they are",
    on_splines=normalised(coefficients),
)
