"""``optimistix-bfgs``: Optimistix's BFGS in the stretches, friction smoothed in stages.

Its own steps in a loop of ours, as its manual shows for stepping by hand, so that
the limit on iterations is a number and not a reason to compile again.
"""

from __future__ import annotations

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.experiments.peers import stretches
from jaxclay.experiments.peers.base import Limits, Peer, Task, outcome
from jaxclay.numerics.arrays import Array
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.sums import Displaced


def _setup(problem: Problem, start: Displaced, limits: Limits) -> Task:
    arguments = jax.device_put((problem, start, limits.tolerance, limits.max_iterations))
    compiled = _solve.lower(*arguments).compile()

    def solve():
        return jax.block_until_ready(compiled(*arguments))

    def read(answer):
        point, iterations, finished = jax.tree.map(np.asarray, answer)
        return outcome(point.thickness, point.shift, iterations, finished)

    return Task(solve, read)


@jax.jit
def _solve(problem: Problem, start: Displaced, tolerance: Array, limit: Array):
    """The point, the iterations and whether the last stage ended by its own rule."""

    def stage(carry, eps):
        x, used = carry
        fun = partial(stretches.objective, problem, start, eps=eps)
        x, steps, finished = _minimise(fun, x, tolerance, limit - used)
        return (x, used + steps), finished

    first = (stretches.stretches(problem, start), jnp.asarray(0))
    (x, used), finished = jax.lax.scan(stage, first, jnp.asarray(stretches.LADDER))
    return stretches.point_of(problem, start, x), used, finished[-1]


def _minimise(fun, x: Array, tolerance: Array, limit: Array) -> tuple[Array, Array, Array]:
    """One stage of BFGS: where it ended, its steps, whether by its own rule."""
    import equinox as eqx
    import optimistix as optx

    solver = optx.BFGS(rtol=tolerance, atol=tolerance)  # pyright: ignore[reportArgumentType]
    function = eqx.filter_closure_convert(lambda y, args: (fun(y), None), x, None)
    energy, auxiliary = function.out_struct
    state = solver.init(function, x, None, {}, energy, auxiliary, frozenset())
    arrays, rest = eqx.partition(state, eqx.is_array)

    def ends(y, state):
        return solver.terminate(function, y, None, {}, state, frozenset())[0]

    def go_on(carry):
        _, _, steps, finished = carry
        return ~finished & (steps < limit)

    def body(carry):
        y, arrays, steps, _ = carry
        new, state, _ = solver.step(function, y, None, {}, eqx.combine(arrays, rest), frozenset())
        return new, eqx.filter(state, eqx.is_array), steps + 1, ends(y, state)

    carry = x, arrays, jnp.asarray(0), ends(x, state)
    x, arrays, steps, finished = jax.lax.while_loop(go_on, body, carry)
    state = eqx.combine(arrays, rest)
    best, _, _ = solver.postprocess(
        function, x, None, None, {}, state, frozenset(), optx.RESULTS.successful
    )
    return best, steps, finished


PEER = Peer(
    ("optimistix", "equinox"),
    _setup,
    Limits(max_iterations=10_000, tolerance=1e-14),
    "Optimistix's BFGS, compiled: stretches, friction smoothed in stages",
)
