"""What the L-BFGS methods share: a smooth objective, its stages, their coordinates.

Friction is smoothed as sqrt(d^2 + eps^2) with eps stepped down.  Then the nodes
that hardly moved are pinned at rest, the others keep their sign of friction,
and the objective is smooth as it is; pins are moved until they agree with the
forces.  Below the thickness floor the energy goes on with a steep penalty
instead of infinity, at which line searches break down; what still lies below
the floor in the end is lifted onto it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxclay import local
from jaxclay._host import is_concrete, pytree
from jaxclay.certificate import SMALL, friction_limit
from jaxclay.clay import Array
from jaxclay.methods.base import Method, State, check_setting, lifted, no_forces, sent_home
from jaxclay.problem import Problem
from jaxclay.schemes.paper import Point

# Smoothing of friction, over the unit l.  In Y the kinks soon stop L-BFGS; scaled coordinates
# take them up.
_PLAIN_EPS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
_SCALED_EPS = (*_PLAIN_EPS, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
_PINNINGS = 10
_PENALTY = 1e3  # first weight of the floor's penalty over k; grows as eps falls


@pytree
@dataclasses.dataclass(frozen=True)
class DescentSettings:
    """tolerance: energy to be gained, relative to E_free, at which a stage ends."""

    max_iterations: Array = 2000
    tolerance: Array = 1e-12

    def __post_init__(self):
        if is_concrete(self):
            check_setting("max_iterations", self.max_iterations, 1)
            check_setting("tolerance", self.tolerance, 1e-15, 1e-2)


class Descent(NamedTuple):
    """An unconstrained minimiser, one iteration at a time.

    Attributes
    ----------
    init : (fun, x) -> state
    advance : (fun, x, state) -> (x, state, size, failed)
        ``size`` is the gradient's norm, ``failed`` whether the line search gave up.
    """

    init: Callable[[Callable, Array], Any]
    advance: Callable[[Callable, Array, Any], tuple[Array, Any, Array, Array]]


class _Memory(NamedTuple):
    base: Point  # where x = 0
    x: Array
    descent: Any
    stage: Array
    signs: Array  # (n+1,) friction's sign while pinning
    pinned: Array  # (n+1,) bool
    scale: Array  # (n+1, n+1) or (): step of the nodes for a unit of x
    ladder: Array  # the eps of each stage; pinning follows


def method(descent: Descent, preconditioned: bool, summary: str) -> Method:
    """The staged method around a minimiser; in coordinates of the start's Hessian if asked."""

    def restarted(problem: Problem, memory: _Memory) -> _Memory:
        if preconditioned:
            memory = memory._replace(scale=_inverse_factor(problem, memory))
        return memory._replace(descent=descent.init(_objective(problem, memory), memory.x))

    def init(problem: Problem, start: Point, settings: DescentSettings) -> State:
        unpinned = jnp.zeros_like(problem.fixed)
        x = jnp.zeros_like(start.shift)
        ladder = jnp.asarray(_SCALED_EPS if preconditioned else _PLAIN_EPS)
        memory = _Memory(start, x, None, jnp.asarray(0), x, unpinned, jnp.ones(()), ladder)
        memory = restarted(problem, memory)
        nothing = ~jnp.any(problem.free)
        return State(start, no_forces(problem), jnp.asarray(0), nothing, memory)

    def step(problem: Problem, state: State, settings: DescentSettings) -> State:
        memory = state.memory
        fun = _objective(problem, memory)
        x, inner, size, failed = descent.advance(fun, memory.x, memory.descent)
        # A line search that gives up may leave the shape anywhere.
        x = jnp.where(failed & ~(fun(x) < fun(memory.x)), memory.x, x)
        point = memory.base.moved(_to_step(problem, memory, x))
        ends = failed | (size <= _target(problem, point, memory, settings, preconditioned))
        memory = memory._replace(x=x, descent=inner)

        def next_stage():
            following, agrees = _next_stage(problem, point, memory)
            return restarted(problem, following), agrees

        memory, finished = jax.lax.cond(ends, next_stage, lambda: (memory, jnp.asarray(False)))
        point = jax.tree.map(lambda a, b: jnp.where(ends, a, b), memory.base, point)
        return State(lifted(problem, point), state.forces, state.iterations + 1, finished, memory)

    return Method(DescentSettings, init, step, summary)


def _objective(problem: Problem, memory: _Memory) -> Callable[[Array], Array]:
    """E_free with smoothed or signed friction and the floor's penalty, as a function of x."""
    eps, stage = _eps(memory), jnp.minimum(memory.stage, memory.ladder.shape[0] - 1)
    pinning = memory.stage >= memory.ladder.shape[0]
    limit, floor, rest = friction_limit(problem), problem.floor, problem.rest.thickness
    weight = _PENALTY * problem.material.k * 10.0**stage / problem.slices

    def fun(x: Array) -> Array:
        point = memory.base.moved(_to_step(problem, memory, x))
        below = jnp.maximum(floor - point.thickness, 0.0) / rest
        # Half the floor is far outside, but the radius is still finite there.
        kept = jnp.maximum(point.thickness, floor / 2)
        d = point.shift
        friction = jnp.where(pinning, memory.signs * d, jnp.sqrt(d**2 + eps**2))
        smooth = problem.free_terms(Point(kept, d)).smooth
        return smooth + jnp.sum(limit * friction) + weight / 2 * jnp.sum(below**2)

    return fun


def _to_step(problem: Problem, memory: _Memory, x: Array) -> Array:
    step = memory.scale @ x if memory.scale.ndim else x
    return jnp.where(problem.free & ~memory.pinned, step, 0.0)


def _inverse_factor(problem: Problem, memory: _Memory) -> Array:
    """L^-T of the Hessian where a stage starts, or of Gauss-Newton's if that is not definite."""
    limit, eps = friction_limit(problem), _eps(memory)
    kink = limit * eps**2 / (memory.base.shift**2 + eps**2) ** 1.5
    curvature = jnp.diag(jnp.where(memory.stage < memory.ladder.shape[0], kink, 0.0))
    factor = jnp.linalg.cholesky(local.hessian(problem, memory.base) + curvature)
    fallback = jnp.linalg.cholesky(local.gauss_newton(problem, memory.base) + curvature)
    factor = jnp.where(jnp.all(jnp.isfinite(factor)), factor, fallback)
    return jax.scipy.linalg.solve_triangular(factor, jnp.eye(factor.shape[0]), lower=True).T


def _eps(memory: _Memory) -> Array:
    return memory.ladder[jnp.minimum(memory.stage, memory.ladder.shape[0] - 1)]


def _target(problem, point, memory, settings, preconditioned) -> Array:
    """Gradient norm at which about the tolerance is left to gain, or the stage's share."""
    energy = settings.tolerance * jnp.maximum(problem.free_terms(point).total, SMALL)
    smoothing = 1e-2 * _eps(memory) * jnp.sum(friction_limit(problem))
    smoothing = jnp.where(memory.stage < memory.ladder.shape[0], smoothing, 0.0)
    gain = jnp.maximum(energy, smoothing)
    # In the Hessian's coordinates curvature is about 1; in Y the least is about k h.
    curvature = 1.0 if preconditioned else problem.material.k / problem.slices
    return jnp.sqrt(2 * gain * curvature)


def _next_stage(problem: Problem, point: Point, memory: _Memory) -> tuple[_Memory, Array]:
    """The next eps; after the last the pins, until they agree with the forces."""
    limit, d = friction_limit(problem), point.shift
    stage = memory.stage + 1
    starts_pinning = stage == memory.ladder.shape[0]
    g = local.gradient(problem, point)
    rests = jnp.abs(d) <= 10 * memory.ladder[-1]
    crossed = memory.signs * d < 0
    leaves = memory.pinned & (jnp.abs(g) > limit)
    pinned = jnp.where(starts_pinning, rests, (memory.pinned & ~leaves) | crossed)
    pinned = pinned & problem.free & (stage >= memory.ladder.shape[0])
    agrees = (stage > memory.ladder.shape[0]) & jnp.all(pinned == memory.pinned)
    signs = jnp.where(pinned, 0.0, jnp.where(d == 0, -jnp.sign(g), jnp.sign(d)))
    base = sent_home(problem, point, pinned)
    following = memory._replace(
        base=base, x=jnp.zeros_like(memory.x), stage=stage, signs=signs, pinned=pinned
    )
    return following, agrees | (stage >= memory.ladder.shape[0] + _PINNINGS)
