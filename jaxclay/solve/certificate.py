"""The optimality check of every answer: how much could the local model still gain?

With g, H the gradient and Hessian of the smooth energy on the free nodes,
d = Y - Y0, friction forces lam with |lam_i| <= h mu and forces z >= 0 of the lower bound,
r = g + lam - D^T z and positive definite H, the local model gains at most

    decrement = 1/2 r^T H^-1 r + sum (h mu |d_i| - lam_i d_i) + sum z_i (t_i - f t0_i)

by weak duality, whatever lam and z are.  So nobody has to say which nodes rest:
the certificate tries the solver's own forces and some read off the point, and keeps
the best.  E_total is not convex; this certifies a local minimum.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxclay.clay import text
from jaxclay.numerics.arrays import Array, Bool, Float, Shaped, namespace
from jaxclay.numerics.banded import Model
from jaxclay.numerics.host import pytree
from jaxclay.schemes.base import DECREMENT, SMALL, Forces
from jaxclay.schemes.sums import Displaced
from jaxclay.schemes.system import Linear, System

STEP = 1e-6  # accepted distance to the local model's minimum, over the unit l
_CONSISTENT = 1e-12  # over the unit l
_AT_REST = (0.0, 1e-14, 1e-12, 1e-10, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
_PENALTY = 1e4  # over the Hessian's entry there: more would drown the others' in rounding
_TURNS = 5  # for each pair of forces, of which all but the last read off the lower bound's
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


def certify(system: System, point: Displaced, forces: Forces) -> Certificate:
    """Certify a point; ``forces`` are the solver's own multipliers, zeros if it has none."""
    model = system.smooth_model(point)
    energy = model.value + system.friction_limit @ abs(point.shift)

    def body(search: Search) -> Search:
        linear, tried = asked(system, point, model, forces, search)
        answer = system.solve(model.bands, linear)
        return taken(system, point, model, energy, search, linear, tried, *answer)

    found = jax.lax.while_loop(lambda search: ~search.over, body, first_search(system))
    return concluded(system, point, found)


def concluded(system: System, point: Displaced, found: Search) -> Certificate:
    """The certificate of a point whose forces have been searched for."""
    xp = namespace(point.shift, found.positive)
    best, positive, admissible = found.best, found.positive, _admissible(system, point)
    return Certificate(
        accepted=best.passes(found.energy_free) & positive & admissible,
        decrement=xp.where(positive, best.decrement, xp.inf),
        step=xp.where(positive, best.step, xp.inf),
        residual=best.residual / (system.mu + system.k),
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

    Tried are the solver's own; its friction with the lower bound's forces z read off; and
    for each threshold h mu sign(d) beyond it and -g within, with z read off.  These forces
    are those that stiff penalties need to hold the slices there (method of multipliers).  Where H
    is indefinite nodes that rest with friction to spare are left out, and slices that the lower
    bound pushes on, which cannot get thinner, may be held by penalties.

    Attributes
    ----------
    turn : int
        Which pair, and how far its z is read off.
    floor : (n,) array
        Those forces.
    dropped, held : bools
        Whether nodes are left out, and slices held, since H was indefinite.
    positive : bool
        Whether H is positive definite so.
    energy_free : float
    best : _Verdict
        Of the first pair that passes, else of that with the least decrement.
    """

    turn: Array
    floor: Array
    dropped: Array
    held: Array
    positive: Array
    energy_free: Array
    best: _Verdict

    @property
    def over(self) -> Array:
        """Whether a pair passes or none is left."""
        return (self.turn >= _LAST) | self.best.passes(self.energy_free)

    def refuses_own(self, before: Search) -> Array:
        """Whether this turn, the one after ``before``, has refused the solver's own forces."""
        return (before.turn < _TURNS) & (self.turn >= _TURNS) & ~self.over

    @property
    def reading(self) -> Array:
        """How often z has been read off for this pair."""
        return jax.lax.rem(self.turn, _TURNS)

    @property
    def reads(self) -> Array:
        """Whether this turn reads off z."""
        return self.reading < _TURNS - 1

    def forces(self, system: System, point: Displaced, gradient, own: Forces) -> Forces:
        """The pair of this turn, z as far as it is read off."""
        d, limit = point.shift, system.friction_limit
        i = jax.lax.div(self.turn, _TURNS)
        threshold = jnp.asarray((-1.0, -1.0, *_AT_REST))[i]
        moves = abs(d) > threshold
        read = jnp.where(i < 2, own.friction, jnp.where(moves, limit * jnp.sign(d), -gradient))
        floor = jnp.where(i == 0, own.floor, self.floor * (self.reading > 0))
        floor = jnp.where(self.reads, floor, jnp.maximum(floor, 0.0))
        return Forces(jnp.maximum(jnp.minimum(read, limit), -limit), floor)


def first_search(system: System) -> Search:
    """Before anything was tried."""
    no, inf = jnp.asarray(False), jnp.asarray(jnp.inf)
    worst = _Verdict(inf, inf, inf, jnp.zeros(()))
    turn, none = jnp.asarray(_TURNS - 1), jnp.zeros_like(system.floor)
    return Search(turn, none, no, no, no, jnp.zeros(()), worst)


def searched(positive: Array, energy_free: Array, *best: Array) -> Search:
    """A search of which only the result is known."""
    return Search(_LAST, 0.0, False, False, positive, energy_free, _Verdict(*best))


def asked(
    system: System, point: Displaced, model: Model, own: Forces, search: Search
) -> tuple[Linear, Forces]:
    """What the next turn takes: the residual, a Hessian that penalties may hold; its forces."""
    forces = search.forces(system, point, model.gradient, own)
    rests = (point.shift == 0) & (abs(model.gradient) < system.friction_limit) & search.dropped
    keep = system.free * (1 - rests)
    r = model.gradient + forces.friction - system.from_thickness(forces.floor)
    penalties = (search.reads | search.held) * _penalties(system, point, model)
    return Linear(penalties, 0 * r, keep * r, keep), forces


def taken(
    system: System, point: Displaced, model: Model, energy: Array, search: Search,
    linear: Linear, forces: Forces, answer: Array, positive: Array,
) -> Search:  # fmt: skip
    """The search after a turn whose residual r gave H^-1 r, ``answer``; ``energy`` is E_free."""
    d, limit, r = point.shift, system.friction_limit, linear.force
    friction, floor = forces
    touches = at_lower_bound(system, point)
    pushed = (floor > 0) & touches
    touching, pushing = touches.sum(), pushed.sum()
    left = 0.5 * r * answer + limit * abs(d) - friction * d
    decrement = (left[1:] + floor * system.slack(point)).sum()
    # Penalties may stand in for the lower bound only where it pushes.
    honest = ~search.held | (pushing == touching)
    decrement = jnp.where(honest & ~jnp.isnan(decrement), decrement, jnp.inf)
    shares = jnp.where(limit > 0, limit / system.mu, 1.0)
    step, residual = jnp.max(jnp.stack([abs(answer), abs(r) / shares]), axis=1)
    now = _Verdict(decrement, step, residual, 1.0 * pushing)
    better = now.passes(energy) | (decrement < search.best.decrement)
    better &= ~search.reads & positive
    # An indefinite H is tried again as long as more of it can be left out.
    drops = ~positive & ~search.dropped
    holds = ~positive & ~drops & ~search.held & (touching > 0)
    following = search.turn + jnp.where(search.reads | (touching > 0), 1, _TURNS)
    following = jnp.where(positive, following, _LAST)
    rises = linear.between * system.thickness_change(answer)
    return Search(
        turn=jnp.where(drops | holds, search.turn, following),
        floor=jnp.where(positive & search.reads, floor + rises, 0.0),
        dropped=search.dropped | drops,
        held=search.held | holds,
        positive=positive,
        energy_free=energy,
        best=jax.tree.map(lambda a, b: jnp.where(better, a, b), now, search.best),
    )


def _penalties(system: System, point: Displaced, model: Model) -> Array:
    """(n,) their strength on the slices at the lower bound."""
    first, *_, bend = model.bands
    return at_lower_bound(system, point) * (_PENALTY * jnp.maximum(first, first - bend))


def _admissible(system: System, point: Displaced) -> Array:
    """Whether the shape keeps above the lower bound, in step with itself and to the tool."""
    # A slice at the lower bound may lie below it by rounding.
    low = -1e-12 * system.rest_thickness
    obeys_bound = (system.slack(point) >= low).all() & (point.thickness > 0).all()
    # Thicknesses and displacements are held apart; the energy is of both, so they must agree.
    apart = system.rest_thickness + system.thickness_change(point.shift) - point.thickness
    missed = (1 - system.free) * (point.shift - system.target)
    consistent = abs(apart).max() <= _CONSISTENT
    return obeys_bound & consistent & (abs(missed).max() <= _CONSISTENT)


def at_lower_bound(system: System, point: Displaced) -> Bool[Array, "n"]:
    """(n,) slices on which the lower bound may push."""
    return system.slack(point) <= _AT_BOUND * system.rest_thickness
