"""The sums of eq. 21 over slices anywhere: what both schemes in heights share.

Slice i of thickness t_i holds the share h_i of the clay, so that Y_u = t_i / h_i and
X_i = r0 sqrt(h_i / t_i) (eq. 22).  Its radius is that of a point p_i of the material; with
a_i = p_{i+1} - p_i

    X_u, Y_uu between slices i and i+1:  (X_{i+1} - X_i) / a_i and (Y_u,i+1 - Y_u,i) / a_i
    X_uu at slice i:                     (X_u,i - X_u,i-1) / c_i

and every square has a weight.  The paper's scheme has h, a, c and the weights all 1/n; second-order
slices (:mod:`jaxclay.schemes.slices`) have them where the clay is.

Solvers hold a :class:`Displaced`, thicknesses beside displacements, rather than heights: second
differences of heights are rounding noise on fine grids.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from jaxclay.model.band import Rest
from jaxclay.model.energy import Samples, Weights
from jaxclay.numerics.arrays import Array, Bool, Float, namespace


class Displaced(NamedTuple):
    """A displaced shape, lengths over the unit l: the point that a minimiser is at.

    Attributes
    ----------
    thickness : (n,) array
        t_i = Y_{i+1} - Y_i.
    shift : (n+1,) array
        Y_i - Y0_i.
    """

    thickness: Float[Array, "n"]
    shift: Float[Array, "n+1"]

    def moved(self, step: Float[Array, "nodes"]) -> Displaced:
        """The shape after every node has moved by ``step``, (n+1,)."""
        return Displaced(self.thickness + step[1:] - step[:-1], self.shift + step)


class Sums(NamedTuple):
    """Spacings and weights of the sums, shares of the clay.

    Attributes
    ----------
    width : (n,) array
        h_i.
    slices : (n,) array
        Weights of strain and of Y_u.
    nodes : (n+1,) array
        Weights of friction.
    apart : (n-1,) array
        a_i.
    between : (n-1,) array
        Weights of X_u and Y_uu.
    turn : (n-2,) array
        c_i of slices 1 .. n-2, spacings and weights of X_uu at once.
    """

    width: Float[Array, "n"]
    slices: Float[Array, "n"]
    nodes: Float[Array, "n+1"]
    apart: Float[Array, "n-1"]
    between: Float[Array, "n-1"]
    turn: Float[Array, "n-2"]


def radii(rest: Rest, sums: Sums, thickness: Float[Array, "n"]) -> Float[Array, "n"]:
    """(n,) X_i = r0 sqrt(h_i / t_i), eq. 22."""
    return rest.r0 / namespace(thickness).sqrt(thickness / sums.width)


def sample(rest: Rest, sums: Sums, point: Displaced) -> Samples:
    """Samples of the contour with X_i from eq. 22."""
    return sample_contour(rest, sums, point, radii(rest, sums, point.thickness))


def sample_contour(rest: Rest, sums: Sums, point: Displaced, X: Float[Array, "n"]) -> Samples:
    """The same for radii X (n,) of their own, whether or not they keep the volume."""
    Y_u = point.thickness / sums.width
    X_u = (X[1:] - X[:-1]) / sums.apart
    return Samples(
        stretch=point.thickness / rest.thickness,
        shift=point.shift,
        Y_u=Y_u,
        X_u=X_u,
        Y_uu=(Y_u[1:] - Y_u[:-1]) / sums.apart,
        X_uu=(X_u[1:] - X_u[:-1]) / sums.turn,
        weights=Weights(sums.slices, sums.nodes, sums.between, sums.turn),
    )


def sample_free(samples: Samples, free: Bool[Array, "nodes"]) -> Samples:
    """Samples with the terms that touch no free node set to nothing; free is (n+1,) bool."""
    xp = namespace(samples.shift, free)
    slices: Any = free[1:] | free[:-1]
    between: Any = slices[1:] | slices[:-1]
    turns: Any = between[1:] | between[:-1]
    return samples._replace(
        stretch=xp.where(slices, samples.stretch, 1.0),
        shift=xp.where(free, samples.shift, 0.0),
        Y_u=xp.where(slices, samples.Y_u, 0.0),
        X_u=xp.where(between, samples.X_u, 0.0),
        Y_uu=xp.where(between, samples.Y_uu, 0.0),
        X_uu=xp.where(turns, samples.X_uu, 0.0),
    )
