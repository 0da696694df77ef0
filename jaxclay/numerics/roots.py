"""Where a function of one number is least, inside a compiled call: the band asks for its place."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from jaxclay.numerics.arrays import Array, Float, Scalar

_SCANNED = 160  # places at once, where there are kinks
_BESIDE = 4  # kinks to either side of the least that are looked at closely
_CUTS = 40
_EXACT = 1e-15


def around_least(
    energies, places: Float[Array, "m"], low: Scalar, high: Scalar
) -> Float[Array, "k"]:
    """The place of least energy between low and high, and some before and after it.

    Many places are scanned in rounds, each between the neighbours of the last
    round's best: neighbouring kinks differ little where there are many.
    """
    first = jnp.searchsorted(places, low, side="left")
    last = jnp.searchsorted(places, high, side="right") - 1
    best, most = first, places.shape[0]
    while most > 1:
        steps = min(_SCANNED, most) - 1
        index = first + jnp.arange(steps + 1) * (last - first) // steps
        best = index[jnp.argmin(energies(places[index]))]
        apart = -(-(last - first) // steps)
        first, last = jnp.maximum(first, best - apart), jnp.minimum(last, best + apart)
        most = 2 * -(-most // steps) if most > _SCANNED else 1
    before = jnp.searchsorted(places, places[best], side="left") - jnp.arange(_BESIDE, 0, -1)
    after = jnp.searchsorted(places, places[best], side="right") + jnp.arange(_BESIDE)
    at = jnp.concatenate([before, best[None], after])
    return jnp.clip(places[jnp.clip(at, 0, places.shape[0] - 1)], low, high)


def sign_change(slope, left: Float[Array, ""], right: Float[Array, ""]) -> Float[Array, ""]:
    """Where a rising function passes 0: false position, whose stale end is halved (Illinois)."""

    def go_on(state):
        *_, change, cuts = state
        return (jnp.abs(change) > _EXACT) & (cuts < _CUTS)

    def cut(state):
        left, right, low, high, last, _, cuts = state
        share = jnp.where(high > low, low / jnp.where(high > low, low - high, -1.0), 0.5)
        middle = left + jnp.where((share > 0) & (share < 1), share, 0.5) * (right - left)
        value = slope(middle)
        falls = value < 0
        return (
            jnp.where(falls, middle, left),
            jnp.where(falls, right, middle),
            jnp.where(falls, value, low / 2),
            jnp.where(falls, high / 2, value),
            middle,
            jnp.where(value == 0, 0.0, middle - last),
            cuts + 1,
        )

    state = left, right, slope(left), slope(right), left, jnp.full_like(left, jnp.inf), 0
    return jax.lax.while_loop(go_on, cut, state)[4]


def follow(slope, root: Float[Array, ""], exactly: bool = False) -> Float[Array, ""]:
    """The root with its derivatives, up to the third, by two steps of Newton; at a kink it stays.

    ``exactly`` if the steps shall improve the root too.
    """

    def newton(_, root):
        value, rate = jax.jvp(slope, (root,), (jnp.ones_like(root),))
        rises = jax.lax.stop_gradient(rate) > 0
        value = value if exactly else value - jax.lax.stop_gradient(value)
        step = value / jnp.where(rises, rate, 1.0)
        return root - jnp.where(rises, step, 0.0)

    return jax.lax.fori_loop(0, 2, newton, root)
