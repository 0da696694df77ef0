"""The factors of the Hessian that judging a point takes, with what rests or is held left out."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxclay import banded, local
from jaxclay.banded import Model
from jaxclay.clay import Array
from jaxclay.local import Stiffness
from jaxclay.problem import Problem
from jaxclay.schemes.sums import Point

_SPRING = 1e4  # over the Hessian's largest entry


class Factors(NamedTuple):
    """Factors of the Hessian H that judging a point takes.

    Attributes
    ----------
    plain : Stiffness
        H's; where H is indefinite, without the nodes that rest.
    dropped : (n+1,) bool array
        Those nodes, if they had to be left out.
    sprung : Stiffness
        The same with stiff springs that hold the slices at the floor; there only
        if any slice is at the floor.
    springs : (n,) array
        Their strength.
    """

    plain: Stiffness
    dropped: Array
    sprung: Stiffness
    springs: Array

    @property
    def positive(self) -> Array:
        """Whether the Hessian is positive definite on the moves that are possible.

        Slices that the floor pushes on cannot get thinner, and to get thicker costs
        a force; so where H is indefinite, springs may hold them.
        """
        return self.plain.positive | self.sprung.positive

    def relaxed(self, force: Array) -> Array:
        """H^-1 force, for force (n+1,)."""
        stiff = jax.tree.map(
            lambda a, b: jnp.where(self.plain.positive, a, b), self.plain, self.sprung
        )
        return local.relaxed(stiff, force)


def factors_at(problem: Problem, point: Point, model: Model, rests: Array, tight: Array) -> Factors:
    """The factors at a point with local model ``model``.

    ``rests`` (n+1,) marks the nodes that rest with friction to spare, ``tight``
    (n,) the slices at the floor.
    """
    springs = jnp.where(tight, _SPRING * jnp.max(jnp.abs(model.bands[0])), 0.0)
    whole, without_rests, with_springs, done = range(4)

    def factor(dropped: Array, between: Array) -> Stiffness:
        kept = dataclasses.replace(problem, fixed=problem.fixed | dropped)
        bands = banded.masked(model.bands, kept.free)
        return local.stiffness(kept, point, bands, between, jnp.zeros_like(point.shift))

    def body(carry):
        turn, factors = carry
        sprung = turn == with_springs
        dropped = jnp.where(turn == without_rests, rests, factors.dropped)
        new = factor(dropped, jnp.where(sprung, springs, 0.0))
        plain, held = (
            jax.tree.map(lambda a, b, use=use: jnp.where(use, a, b), new, old)
            for use, old in ((~sprung, factors.plain), (sprung, factors.sprung))
        )
        indefinite = (turn == whole) & ~plain.positive & jnp.any(rests)
        after = jnp.where(~sprung & jnp.any(tight), with_springs, done)
        turn = jnp.where(indefinite, without_rests, after)
        return turn, Factors(plain, dropped, held, springs)

    # A loop, so that factoring is compiled once.
    shapes = jax.eval_shape(factor, rests, springs)
    nothing = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)
    first = Factors(nothing, jnp.zeros_like(rests), nothing, springs)
    return jax.lax.while_loop(lambda carry: carry[0] != done, body, (jnp.asarray(whole), first))[1]
