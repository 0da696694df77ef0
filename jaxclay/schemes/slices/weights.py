"""The second-order sums: spacings and weights on any nodes, and what the tool's clay adds.

The radius of a slice is that of its middle, but beside an edge of the band the last slice under
the tool stands for the edge itself: p_i is the edge.  So X = x0 and Y_u = (r0/x0)^2 enter at the
edge, half a slice from the first free middle, and X_u = 0 there is the difference of two slices
under the tool.  Midpoints carry X_u and Y_uu with weight a_i, at the ends of the clay with the
half cell beyond too; X_uu has its own spacing for weight, and none beyond the last midpoint
(X_uu = 0 at a natural end).  Friction is summed by the trapezoid rule: that is separable, so that
forces within their limits are the whole certificate, but of first order where the displacement
changes its sign between two nodes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jaxclay.model.band import Band, Tool
from jaxclay.model.energy import Terms
from jaxclay.model.material import Material
from jaxclay.numerics.arrays import Array, Bool, Float, namespace
from jaxclay.numerics.interpolation import Interpolant
from jaxclay.schemes.sums import Sums

_PARTS = 4  # of a slice of the rest shape, between which displacements are taken as straight
_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(3)


def sums_of(nodes: Float[Array, "nodes"], held: Bool[Array, "nodes"]) -> Sums:
    """The sums on nodes (n+1,), those of the band ``held``."""
    xp = namespace(nodes, held)
    width = nodes[1:] - nodes[:-1]
    banded = held[1:] & held[:-1]
    no = xp.zeros(1, bool)
    first = banded & ~xp.concatenate([no, banded[:-1]])
    last = banded & ~xp.concatenate([banded[1:], no])
    place = xp.where(last, nodes[1:], xp.where(first, nodes[:-1], (nodes[1:] + nodes[:-1]) / 2))
    apart = place[1:] - place[:-1]
    half = (place[1:] + place[:-1]) / 2
    under = banded[1:] & banded[:-1]
    upper = xp.where(under, place[:-1], half)[1:]
    lower = xp.where(under, place[1:], half)[:-1]
    turn = xp.where(under[1:] & under[:-1], apart[1:], upper - lower)
    begin, end = place[:1], 1 - place[-1:]
    none = xp.zeros_like(apart[2:])
    between = apart + xp.concatenate([begin, none, end])
    zero = xp.zeros(1)
    around = xp.concatenate([zero, width]) + xp.concatenate([width, zero])
    return Sums(
        width=width,
        slices=xp.where(banded, 0.0, width),
        nodes=xp.where(held, 0.0, around / 2),
        apart=apart,
        between=xp.where(under, 0.0, between),
        turn=turn,
    )


class BandTerms(NamedTuple):
    """What E_total has of the clay under the tool, which no minimiser moves.

    Attributes
    ----------
    terms : Terms
        Its strain, friction and alpha Y_u^2 on the rest shape.
    edges : (2,) array
        Friction at its edges, over a share of the clay.
    """

    terms: Terms
    edges: Float[Array, "2"]

    def with_half_cells(self, width: Float[Array, "2"]) -> Terms:
        """With friction of the first slices beside the tool, (2,) shares, 0 where there are none.

        Half of each counts at the edge.
        """
        return self.terms._replace(friction=self.terms.friction + (width * self.edges).sum() / 2)


def band_terms(rest: Interpolant, r0, tool: Tool, material: Material, band: Band) -> BandTerms:
    """The clay under the tool; friction's kink is exact where the displacement is straight."""
    xp = namespace(rest, r0, tool, material, band)
    density = (r0 / tool.radius) ** 2
    share = xp.arange(_PARTS) / _PARTS
    step = rest.nodes[1:] - rest.nodes[:-1]
    u = (rest.nodes[:-1, None] + step[:, None] * share).reshape(-1)
    u = xp.clip(xp.concatenate([u, rest.nodes[-1:]]), band.lower, band.upper)
    u = np.unique(u) if xp is np else u
    part = u[1:] - u[:-1]
    slope = rest.slope(u[:-1, None] + part[:, None] * (1 + _PLACES) / 2)
    strain = (part * ((density / slope - 1) ** 2 @ _WEIGHTS)).sum() / 2
    a = band.bottom + density * (u - band.lower) - rest.height(u)
    edges = material.mu * abs(a[xp.asarray([0, -1])])
    a, b = a[:-1], a[1:]
    size = abs(a) + abs(b)
    turns = a * b < 0
    straight = xp.where(turns, (a * a + b * b) / xp.where(turns, size, 1.0), size) / 2
    none = 0.0 * strain
    terms = Terms(
        strain=material.k / 2 * strain,
        friction=material.mu * xp.sum(part * straight),
        tension=material.alpha * density**2 * (band.upper - band.lower),
        bending=none,
    )
    return BandTerms(terms, edges)
