"""A problem's constants, folded once into its :class:`.System`."""

from __future__ import annotations

from jaxclay.model.band import Rest
from jaxclay.model.material import Material
from jaxclay.numerics.arrays import Array, Bool, Float, namespace
from jaxclay.schemes.sums import Sums
from jaxclay.schemes.system import System, padded


def system_of(
    rest: Rest,
    sums: Sums,
    material: Material,
    free: Bool[Array, "nodes"],
    target: Float[Array, "nodes"],
    upper: Bool[Array, "nodes-1"],
    emphasis: Float[Array, "nodes-1"] | None = None,
) -> System:
    """The system of a rest shape whose ``free`` nodes (n+1,) move and the others to ``target``.

    ``upper`` (n,): whether a slice lies above the band's lower edge.  ``emphasis`` (n,): how many
    times alpha and beta count at each slice, 1 if not given.
    """
    xp = namespace(rest, sums, material, free, target, upper)
    more = xp.ones(sums.width.shape[0]) if emphasis is None else emphasis
    pairs = (more[1:] + more[:-1]) / 2
    loose = free[1:] | free[:-1]
    limit = free * (material.mu * sums.nodes)
    between = loose[1:] | loose[:-1]
    turning = between[1:] | between[:-1]
    apart = 1 / sums.apart
    weight = pairs * between * sums.between * apart * apart
    tension, change = 2 * material.alpha * weight, 2 * material.beta * weight
    turn = 2 * material.beta * more[1:-1] * turning / sums.turn
    return System(
        free=1.0 * free,
        target=target,
        friction_limit=limit,
        upper=1.0 * upper,
        width=sums.width,
        rest_thickness=rest.thickness,
        floor=loose * (material.floor * rest.thickness),
        strain=loose * sums.slices * material.k,
        slope=2 * material.alpha * more * loose * sums.slices,
        radii=_by_radii(apart, tension, turn),
        apart=apart,
        tension=tension,
        change=change,
        turn=turn,
        r0=rest.r0,
        k=material.k,
        mu=material.mu,
        friction_total=xp.maximum(limit.sum(), 1e-300),
    )


def _by_radii(apart: Array, tension: Array, turn: Array) -> tuple[Array, Array, Array]:
    """d^2E / dX^2 in bands (n,)."""
    near, far = apart[:-1], apart[1:]
    both = near + far
    own = padded(tension, 0, 1) + padded(tension, 1, 0)
    own += padded(turn * near * near, 0, 2) + padded(turn * both * both, 1, 1)
    own += padded(turn * far * far, 2, 0)
    beside = padded(tension, 0, 1) + padded(turn * near * both, 0, 2)
    beside += padded(turn * far * both, 1, 1)
    return own, -beside, padded(turn * near * far, 0, 2)
