"""Minimisers; :data:`METHODS` is the table of them.

Choose ``newton`` unless you study methods: the others are baselines, or the paper's own.
``base``: what a method is.  ``loop``: the one loop that runs them.  ``choice``: a name and settings
to a method.  ``smoothed``: stages, lower bound and stopping around any descent of smooth functions;
to add one, start there.  ``stages``, ``penalties``: friction smoothed on nodes and on splines.
``coordinates``, ``thickness``: what a descent's unknowns are.

It may import ``numerics``, ``clay``, ``model`` and ``schemes``.
"""

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
