"""The optimality check of every answer: how much could the local model still gain?

With g, H the gradient and Hessian of the smooth energy on the free nodes,
d = Y - Y0, friction forces lam with |lam_i| <= h mu and forces z >= 0 of the lower bound,
r = g + lam - D^T z and positive definite H, the local model gains at most

    decrement = 1/2 r^T H^-1 r + sum (h mu |d_i| - lam_i d_i) + sum z_i (t_i - f t0_i)

by weak duality, whatever lam and z are.  So nobody has to say which nodes rest:
the certificate tries the method's own forces and some read off the point, and keeps
the best.  E_total is not convex; this certifies a local minimum.  On splines friction acts
at points, the lower bound at Gauss points, and D is what they see of the coefficients.
"""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from jaxclay.clay import text
from jaxclay.numerics.arrays import Array, Bool, Float, Shaped, namespace
from jaxclay.numerics.host import pytree
from jaxclay.schemes.base import DECREMENT, SMALL, AnyDisplaced, Forces, Newtonian, Pull

STEP = 1e-6  # accepted distance to the local model's minimum, over the unit l
_STILL = 1e-12  # over the unit l: clay that rests
_PENALTY = 1e4  # over the Hessian's entry there: more would drown the others' in rounding
_FIRMLY = (0.0, 1e-14, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
# So gently that the rounding of gradients on fine slices, many times the limit of friction, is left
# to the Hessian, which is stiff in it: clipped at the limit, it would push all the clay.
_GENTLY, _GENTLE = (1e-14, 1e-12, 1e-10, 1e-8, 1e-6), 1e-6
_AT_REST = (*_FIRMLY, *_GENTLY)
_TURNS = 7  # for each pair of forces, of which all but the last read it off
_LAST = _TURNS * (2 + len(_AT_REST))
_AT_BOUND = 1e-9  # slack over rest thickness below which the lower bound may push


@pytree
@dataclasses.dataclass(frozen=True)
class Certificate:
    """What was found.

    Attributes
    ----------
    accepted : bool
        Whether the answer is a local minimum: decrement <= 1e-10 max(E_free,
        1e-3), step <= 1e-6, curvature positive, thicknesses above the lower bound.
    decrement : float
        Most energy that the local model can still gain; inf without positive curvature.
    step : float
        Largest move to the local model's minimum, over the unit l.
    residual : float
        max |r_i| / (w_i (mu + k)), w_i the node's share of the clay.  Shown, never a gate:
        at exact minima on fine grids it is rounding noise.
    positive : bool
        Whether the Hessian is positive definite on the moves that are possible: if it
        must be, without the nodes that rest and without thinning what the lower bound pushes on.
    admissible : bool
        Whether heights increase, thicknesses obey the lower bound and agree with the
        heights, and the fixed nodes are where the tool wants them.
    energy_free : float
        E_free, the terms that touch a free node; gaps are relative to it.
    on_floor : int
        Slices on which the lower bound pushes.
    """

    accepted: Bool[Array, ""]
    decrement: Float[Array, ""]
    step: Float[Array, ""]
    residual: Float[Array, ""]
    positive: Bool[Array, ""]
    admissible: Bool[Array, ""]
    energy_free: Float[Array, ""]
    on_floor: Shaped[Array, ""]

    def __repr__(self) -> str:
        say, flag = text.figure, text.flag
        return text.lines(
            f"Certificate: {flag(self.accepted, 'accepted', 'refused')}",
            f"{self.gain}, step {say(self.step, '.2g')} (at most {STEP:.2g})",
            f"positive curvature: {flag(self.positive)}, admissible: {flag(self.admissible)}, "
            f"slices at the lower bound: {say(self.on_floor)}",
            f"E_free {say(self.energy_free)}, residual {say(self.residual, '.2g')}",
        )

    @property
    def gain(self) -> str:
        """The decrement beside what is accepted, in words."""
        most = text.derived(accepted_decrement, self.energy_free)
        decrement = text.figure(self.decrement, ".2g")
        return f"decrement {decrement} (at most {text.figure(most, '.2g')})"


def accepted_decrement(energy_free: Float[Array, "*of"]) -> Float[Array, "*of"]:
    """The largest decrement that is accepted where E_free is this."""
    return DECREMENT * namespace(energy_free).maximum(energy_free, SMALL)


def certify(problem: Newtonian, point: AnyDisplaced, forces: Forces) -> Certificate:
    """Certify a point; ``forces`` are the method's own multipliers, zeros if it has none."""
    model = problem.smooth_model(point)
    energy = model.value + problem.friction_limit @ abs(point.shift)

    def body(search: Search) -> Search:
        pull, tried = asked(problem, point, model, forces, search)
        answer = problem.newton_step(point, model.bands, pull)
        return taken(problem, point, search, pull, tried, *answer)

    first = first_search(problem, energy)
    found = jax.lax.while_loop(lambda search: ~search.over, body, first)
    return concluded(problem, point, found)


def concluded(problem: Newtonian, point: AnyDisplaced, found: Search) -> Certificate:
    """The certificate of a point whose forces have been searched for."""
    xp = namespace(point.shift, found.positive)
    best, positive, admissible = found.best, found.positive, problem.admissible(point)
    return Certificate(
        accepted=best.passes(found.energy_free) & positive & admissible,
        decrement=xp.where(positive, best.decrement, xp.inf),
        step=xp.where(positive, best.step, xp.inf),
        residual=best.residual / (problem.mu + problem.k),
        positive=positive,
        admissible=admissible,
        energy_free=found.energy_free,
        on_floor=best.on_floor,
    )


class _Verdict(NamedTuple):
    """What one pair of friction and of the lower bound says."""

    decrement: Array
    step: Array
    residual: Array
    on_floor: Array

    def passes(self, energy_free: Array) -> Array:
        return (self.decrement <= accepted_decrement(energy_free)) & (self.step <= STEP)


class Search(NamedTuple):
    """Where the search for the forces that certify a point stands.

    Tried are the method's own; its friction with the lower bound's forces z read off; and for
    each threshold h mu sign(d) beyond it, with what holds the clay within and z read off.  Such
    forces are those that penalties need to keep all in place (method of multipliers), first firm
    ones, then gentle ones.
    Where H is indefinite clay that rests with friction to spare, and slices that the lower bound
    pushes on, which cannot get thinner, may be held by penalties.

    Attributes
    ----------
    turn : int
        Which pair, and how far it is read off.
    friction, floor : (m,) and (s,) arrays
        Those forces.
    rests, held : bools
        Whether resting clay and slices are held, since H was indefinite.
    positive : bool
        Whether H is positive definite so.
    energy_free : float
    best : _Verdict
        Of the first pair that passes, else of that with the least decrement.
    """

    turn: Array
    friction: Array
    floor: Array
    rests: Array
    held: Array
    positive: Array
    energy_free: Array
    best: _Verdict

    @property
    def over(self) -> Array:
        """Whether a pair passes or none is left."""
        return (self.turn >= _LAST) | self.best.passes(self.energy_free)

    @property
    def nearly(self) -> Array:
        """Whether no pair passes, but by its step alone, though H is positive definite."""
        gains = self.best.decrement <= accepted_decrement(self.energy_free)
        return (self.turn >= _LAST) & self.positive & gains & (self.best.step > STEP)

    @property
    def pair(self) -> Array:
        """Which pair is tried."""
        return jax.lax.div(self.turn, _TURNS)

    @property
    def reading(self) -> Array:
        """How often this pair has been read off."""
        return jax.lax.rem(self.turn, _TURNS)

    @property
    def reads(self) -> Array:
        """Whether this turn reads it off."""
        return self.reading < _TURNS - 1

    def stays(self, point: AnyDisplaced) -> Array:
        """(m,) where this pair takes clay to rest, and its friction has to be read off."""
        return abs(point.shift) <= jnp.asarray((-1.0, -1.0, *_AT_REST))[self.pair]

    @property
    def penalty(self) -> Array:
        """What holds clay that rests, over the Hessian's entry there."""
        gently = self.reads & (self.pair >= 2 + len(_FIRMLY))
        return jnp.where(gently, _GENTLE, _PENALTY)

    def forces(self, problem: Newtonian, point: AnyDisplaced, own: Forces) -> Forces:
        """The pair of this turn, as far as it is read off."""
        limit, stays, begun = problem.friction_limit, self.stays(point), self.reading > 0
        moving = jnp.where(self.pair < 2, own.friction, limit * jnp.sign(point.shift))
        friction = jnp.where(stays, jnp.where(begun, self.friction, own.friction), moving)
        floor = jnp.where(self.pair == 0, own.floor, self.floor * begun)
        floor = jnp.where(self.reads, floor, jnp.maximum(floor, 0.0))
        return Forces(jnp.maximum(jnp.minimum(friction, limit), -limit), floor)


def first_search(problem: Newtonian, energy: Array) -> Search:
    """Before anything was tried; ``energy`` is E_free."""
    no, inf = jnp.asarray(False), jnp.asarray(jnp.inf)
    worst = _Verdict(inf, inf, inf, jnp.zeros(()))
    none = jnp.zeros_like(problem.friction_limit), jnp.zeros_like(problem.floor)
    return Search(jnp.asarray(_TURNS - 1), *none, no, no, no, energy, worst)


def searched(positive: Array, energy_free: Array, *best: Array) -> Search:
    """A search of which only the result is known."""
    return Search(_LAST, 0.0, 0.0, False, False, positive, energy_free, _Verdict(*best))


def asked(
    problem: Newtonian, point: AnyDisplaced, model: Any, own: Forces, search: Search
) -> tuple[Pull, Forces]:
    """What the next turn takes: the residual, beside a Hessian with penalties; its forces."""
    forces = search.forces(problem, point, own)
    r = model.gradient + problem.from_shift(forces.friction) - problem.from_thickness(forces.floor)
    spare = search.rests & (abs(forces.friction) < problem.friction_limit)
    rests = search.stays(point) & (search.reads | (spare & (abs(point.shift) <= _STILL)))
    held = (search.reads | search.held) & at_lower_bound(problem, point)
    of_friction, of_floor = problem.own_stiffness(model.bands)
    penalties = _PENALTY * held * of_floor, search.penalty * rests * of_friction
    none = jnp.zeros(())
    return Pull(*penalties, none, none, r, search.energy_free, 0 * of_floor), forces


def taken(
    problem: Newtonian, point: AnyDisplaced, search: Search, pull: Pull, forces: Forces,
    answer: Array, positive: Array,
) -> Search:  # fmt: skip
    """The search after a turn whose residual r gave H^-1 r, ``answer``."""
    d, limit, r, energy = point.shift, problem.friction_limit, pull.force, search.energy_free
    friction, floor = forces
    touches = at_lower_bound(problem, point)
    touching, pushing = touches.sum(), ((floor > 0) & touches).sum()
    decrement = 0.5 * (r @ answer) + (limit * abs(d) - friction * d).sum()
    decrement += (floor * problem.slack(point)).sum()
    # Penalties may stand in for the lower bound only where it pushes.
    honest = ~search.held | (pushing == touching)
    decrement = jnp.where(honest & ~jnp.isnan(decrement), decrement, jnp.inf)
    shift = problem.shift_change(answer)
    shares = problem.from_shift(limit)
    residual = jnp.max(abs(r) / jnp.where(shares > 0, shares / problem.mu, 1.0))
    now = _Verdict(decrement, jnp.max(abs(shift)), residual, 1.0 * pushing)
    better = now.passes(energy) | (decrement < search.best.decrement)
    better &= ~search.reads & positive
    # Where H is indefinite more of the clay is held, as long as its forces have been read off.
    own = search.turn < 2 * _TURNS
    rests = ~positive & ~search.rests
    held = ~positive & ~rests & ~search.held & (touching > 0)
    following = search.turn + jnp.where((touching > 0) | (search.turn >= _TURNS), 1, _TURNS)
    again = jnp.where(rests & own, 2 * _TURNS, search.turn)
    following = jnp.where(positive, following, jnp.where(rests | held, again, _LAST))
    reads = positive & search.reads
    return Search(
        turn=following,
        friction=jnp.where(reads, friction - pull.friction * shift, 0.0),
        floor=jnp.where(reads, floor + pull.floor * problem.thickness_change(answer), 0.0),
        rests=search.rests | rests,
        held=search.held | held,
        positive=positive,
        energy_free=energy,
        best=jax.tree.map(lambda a, b: jnp.where(better, a, b), now, search.best),
    )


def at_lower_bound(problem: Newtonian, point: AnyDisplaced) -> Bool[Array, "s"]:
    """(s,) where the lower bound may push."""
    return problem.slack(point) <= _AT_BOUND * problem.rest_thickness
