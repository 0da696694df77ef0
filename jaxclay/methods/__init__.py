"""The methods, one file each; :data:`METHODS` is the table of them."""

from __future__ import annotations

from jaxclay.methods import greedy, lbfgs, newton
from jaxclay.methods.base import Method

METHODS: dict[str, Method] = {
    "newton": newton.METHOD,
    "lbfgs": lbfgs.PLAIN,
    "lbfgs-preconditioned": lbfgs.PRECONDITIONED,
    "optax-lbfgs": lbfgs.OPTAX,
    "greedy": greedy.GREEDY,
    "greedy-refined": greedy.REFINED,
}
