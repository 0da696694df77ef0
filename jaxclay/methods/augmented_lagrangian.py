"""``augmented-lagrangian``: heights and radii both unknown, eq. 22 as a constraint.

Over Y and X, E_total is convex: quadratics and friction.  What is not is eq. 22,

    c_i = X_i^2 (Y_{i+1} - Y_i) / (h_i r0^2) - 1 = 0,

which enters as sum h_i (m_i c_i + rho/2 c_i^2).  Each stage of friction
(:mod:`jaxclay.methods.stages`) ends with m_i += rho c_i, and rho grows where the
largest |c_i| has not fallen to a quarter (Hestenes 1969, Powell 1969; Nocedal and
Wright 2006, section 17.3).  The minimiser inside is jaxopt's L-BFGS; the lower bound is the
stages' penalty, and scenes on which it is active take more iterations than the limit.

The answer is Y alone: its radii follow from eq. 22, so its volume is exact however
large c is.  It shows what eliminating X costs and gains: see ``lbfgs``.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxclay.methods.base import Method, State
from jaxclay.methods.coordinates import Unbounded
from jaxclay.methods.lbfgs import JAXOPT
from jaxclay.methods.smoothed import PLAIN_EPS, DescentSettings, Task
from jaxclay.methods.stages import Stage, first_stage, next_stage
from jaxclay.model.energy import integrate_smooth
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.host import pytree
from jaxclay.schemes import sums
from jaxclay.schemes.base import lifted, no_forces
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.sums import Displaced

_GROWTH = 10.0  # of rho
_FALLS = 0.25  # what of the violation may be left if rho is to stay
_VIOLATION = 1e-9  # largest |c_i| of an answer
_MOST_STAGES = 40


@pytree
@dataclasses.dataclass(frozen=True)
class LagrangianSettings(DescentSettings):
    """tolerance: energy to be gained, relative to E_free, at which a stage ends."""

    max_iterations: Array = 60_000


class _Memory(NamedTuple):
    stage: Stage
    radii: Array  # (n,) X_i where the stage starts
    multipliers: Array  # (n,) m_i
    rho: Array
    violation: Array  # largest |c_i| where the stage starts
    x: Array  # (2n+1,) steps of the nodes, then changes of the radii
    descent: Any

    def shape(self, problem: Problem, x: Array) -> tuple[Displaced, Array]:
        """Heights and radii at x."""
        nodes = problem.slices + 1
        step = jnp.where(self.stage.moves(problem), x[:nodes], 0.0)
        radii = self.radii + jnp.where(problem.loose, x[nodes:], 0.0)
        return self.stage.base.moved(step), radii

    def task(self, problem: Problem, settings: LagrangianSettings) -> Task:
        """The augmented Lagrangian of this stage over k, as a function of x."""

        def lagrangian(x: Array) -> Array:
            point, radii = self.shape(problem, x)
            samples = sums.sample_contour(problem.rest, problem.sums, point, radii)
            smooth = integrate_smooth(sums.sample_free(samples, problem.free), problem.material)
            kinks = self.stage.friction(problem, point.shift)
            floor = self.stage.penalty(problem, point.thickness)
            c = _constraint(problem, point, radii)
            volume = jnp.sum(problem.sums.width * (self.multipliers * c + self.rho / 2 * c**2))
            return (smooth + kinks + floor + volume) / problem.material.k

        # In heights the strain's least curvature is about k h.
        return Task(lagrangian, 1 / problem.slices, Unbounded(), settings)

    def started(self, problem: Problem, settings: LagrangianSettings) -> _Memory:
        """The stage with a new minimiser."""
        x = jnp.zeros(2 * problem.slices + 1)
        return self._replace(x=x, descent=JAXOPT.init(self.task(problem, settings), x))


def init(problem: Problem, start: Displaced, settings: LagrangianSettings) -> State:
    """Start with the radii of eq. 22 and without multipliers."""
    m, n = problem.material, problem.slices
    radii = sums.radii(problem.rest, problem.sums, start.thickness)
    # As stiff along the heights as strain, tension and bending are.
    rho = m.k + m.alpha + 4 * m.beta * n**2
    stage, violation = first_stage(start, PLAIN_EPS), jnp.asarray(jnp.inf)
    memory = _Memory(stage, radii, jnp.zeros(n), rho, violation, jnp.zeros(()), None)
    nothing = ~jnp.any(problem.free)
    memory = memory.started(problem, settings)
    return State(start, no_forces(problem), jnp.asarray(0), nothing, memory)


def step(problem: Problem, state: State, settings: LagrangianSettings) -> State:
    """One iteration of the L-BFGS inside, and what follows at a stage's end."""
    memory = state.memory
    task = memory.task(problem, settings)
    new, inner, size, failed = JAXOPT.advance(task, memory.x, memory.descent)
    # A line search that gives up may leave the shape anywhere.
    x = jnp.where(failed & ~(task.energy(new) < task.energy(memory.x)), memory.x, new)
    memory = memory._replace(x=x, descent=inner)
    point, _ = memory.shape(problem, x)
    left = memory.stage.left(problem, point, settings.tolerance) / problem.material.k
    ends = failed | (size <= jnp.sqrt(2 * task.curvature * left))
    memory, finished = jax.lax.cond(
        ends,
        lambda: _turned(problem, memory, settings),
        lambda: (memory, jnp.asarray(False)),
    )
    point = jax.tree.map(lambda a, b: jnp.where(ends, a, b), memory.stage.base, point)
    return State(lifted(problem, point), state.forces, state.iterations + 1, finished, memory)


def _turned(
    problem: Problem, memory: _Memory, settings: LagrangianSettings
) -> tuple[_Memory, Array]:
    """The next stage with its multipliers, rho and pins; also whether it is none."""
    point, radii = memory.shape(problem, memory.x)
    c = _constraint(problem, point, radii)
    violation = jnp.max(jnp.abs(c))
    stage, agrees = next_stage(problem, point, memory.stage)
    following = memory._replace(
        stage=stage,
        radii=radii,
        multipliers=memory.multipliers + memory.rho * c,
        rho=jnp.where(violation > _FALLS * memory.violation, _GROWTH, 1.0) * memory.rho,
        violation=violation,
    )
    finished = (agrees & (violation <= _VIOLATION)) | (stage.number >= _MOST_STAGES)
    return following.started(problem, settings), finished


def _constraint(problem: Problem, point: Displaced, radii: Array) -> Array:
    """(n,) c_i, 0 where neither end of a slice is free."""
    c = radii**2 * point.thickness / problem.sums.width / problem.rest.r0**2 - 1
    return jnp.where(problem.loose, c, 0.0)


METHOD = Method(
    LagrangianSettings, init, step, "heights and radii unknown, eq. 22 by multipliers and L-BFGS"
)
