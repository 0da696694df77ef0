"""Search along a line for a lower value, which rounding may hide, near by or far off."""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxclay.numerics.arrays import Array

FAR = 1e100  # a minimum lies before it, and not as deep
_ARMIJO = 1e-4
_HARDLY = 0.3  # of the slope left by a Newton step: 0.37 of e^x, 0.25 of x^3
_STRAIGHT = 0.1  # of the slope at the start


class Search(NamedTuple):
    """What to look for along a line: value - 2e-4 length gain - rounding, or lower."""

    along: Array
    gain: Array  # what a step of length 1 promises
    rounding: Array
    least: Array  # length
    both: Array  # whether on either side
    slope: Array  # at length 0 if fun is convex there, else 0


class Tried(NamedTuple):
    """What has been found along the line so far."""

    length: Array  # signed; 0 where none is lower
    best: Array  # value
    slope: Array  # there
    straight: Array  # whether the slope falls to 0 along a Newton step as H has it
    factor: Array  # of the next length; 0 at the end
    bottomless: Array


def search_line(fun, x: Array, value: Array, search: Search, skip: Array) -> Tried:
    """The longest of some halved steps that lowers the function, or it doubled."""

    def body(carry: Tried) -> Tried:
        growing, length = carry.factor == 2, carry.factor * carry.length
        (_, there), (half, slope) = line(jnp.stack([length / 2, length]))
        steep, downhill = jnp.abs(slope), slope * length < 0
        # Of a straight slope the integral is the change of fun, which rounding may hide.
        straight = (search.slope > 0) & (length == 1) & (steep <= _STRAIGHT * search.slope)
        straight &= jnp.abs(half + search.slope / 2) <= _STRAIGHT * search.slope
        bar = value - 2 * _ARMIJO * jnp.abs(length) * search.gain - search.rounding
        lower = jnp.where(search.rounding + search.gain > 0, there <= bar, there < bar)
        lower &= (there < carry.best) & (jnp.isfinite(there) | (there < 0))
        bottomless = lower & (there < -FAR)
        # A longer step leads neither onto a minimum's far side nor over a hill.
        near = downhill & ((search.slope == 0) | (steep < jnp.abs(carry.slope)))
        lower = (lower & (~growing | near | bottomless)) | (straight & ~growing)

        # Not found yet: the other side, then half as far.
        shorter = jnp.where(search.both, jnp.where(length > 0, -1.0, -0.5), 0.5)
        missed = ~growing & ~lower
        over = missed & (jnp.abs(length) <= search.least) & (~search.both | (length < 0))
        hardly = downhill & (steep >= _HARDLY * jnp.abs(search.slope))
        longer = growing | ((jnp.abs(length) == 1) & hardly)
        ends = bottomless | (growing & ~lower) | ~(jnp.abs(length) < FAR) | over
        factor = jnp.where(missed, shorter, jnp.where(longer, 2.0, 0.0))
        return Tried(
            length=jnp.where(growing & ~lower, carry.length, jnp.where(over, 0.0, length)),
            best=jnp.where(lower, there, carry.best),
            slope=jnp.where(lower, slope, carry.slope),
            straight=straight | carry.straight,
            factor=jnp.where(ends, 0.0, factor),
            bottomless=bottomless | carry.bottomless,
        )

    @jax.vmap
    def line(length):
        return jax.jvp(fun, (x + length * search.along,), (search.along,))

    one, no = jnp.ones((), x.dtype), jnp.zeros((), bool)
    none = jnp.all(search.along == 0)
    start = jnp.where(none, 0.0, one), one * jnp.inf, one * jnp.inf, no, one * ~(skip | none), no
    return jax.lax.while_loop(lambda carry: carry.factor != 0, body, Tried(*start))
