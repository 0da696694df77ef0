"""The methods, one file each; :data:`METHODS` is the table of them."""

from __future__ import annotations

from jaxclay.methods import (
    adam,
    augmented_lagrangian,
    greedy,
    lattice,
    lbfgs,
    lbfgsb,
    newton,
    projected_gradient,
)
from jaxclay.methods.base import Method

METHODS: dict[str, Method] = {
    "newton": newton.METHOD,
    "lbfgs": lbfgs.PLAIN,
    "lbfgs-preconditioned": lbfgs.PRECONDITIONED,
    "optax-lbfgs": lbfgs.OPTAX,
    "lbfgsb": lbfgsb.METHOD,
    "projected-gradient": projected_gradient.METHOD,
    "augmented-lagrangian": augmented_lagrangian.METHOD,
    "adam": adam.METHOD,
    "greedy": greedy.GREEDY,
    "greedy-refined": greedy.REFINED,
    "lattice": lattice.METHOD,
}
"""Every method by name: what :func:`jaxclay.minimize` takes as ``method``."""
