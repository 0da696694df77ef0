"""Posing a squash: the band, the mesh, what is prescribed at its ends, the rest shape's samples."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp

from jaxclay.clay.clay import Clay
from jaxclay.model.energy import Terms
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.checks import check_whole
from jaxclay.numerics.host import check_float64, compiled, in_float64, is_concrete
from jaxclay.numerics.interpolation import Interpolant
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.rough import rough_shape
from jaxclay.schemes.slices.posing import place, pose_on_host, pose_traced
from jaxclay.schemes.slices.weights import band_terms
from jaxclay.schemes.spline import mesh
from jaxclay.schemes.spline.bspline import gauss_points
from jaxclay.schemes.spline.problem import SplineProblem
from jaxclay.schemes.spline.space import GAUSS, Space, space

_SLICES = 32  # of the answer's clay, at least


class _OnMesh(NamedTuple):
    """What a mesh adds to a squash; see :class:`SplineProblem`."""

    space: Space
    fixed: Array
    shift: Array
    slopes: Array
    band_terms: Terms


def posed(
    clay: Clay, squash: Squash, material: Material, degree: int, elements: int
) -> SplineProblem:
    """The problem on equal spans; see :func:`jaxclay.pose`."""
    if isinstance(degree, bool) or degree not in (3, 4, 5):
        raise ValueError(f"degree must be 3, 4 or 5, got {degree!r}")
    check_whole("elements", elements, 1)
    slices = max(clay.slices, _SLICES)
    if is_concrete(clay, squash, material):
        found = place(clay, squash, material)
        sliced, rest = pose_on_host(found, slices, "placed"), found.rest
    else:
        check_float64("pose")
        sliced = pose_traced(clay, squash, material, slices, "placed")
        rest = clay.interpolant.over(clay.unit)
    on: _OnMesh = in_float64(
        "pose", _on_mesh, sliced, rest, degree=int(degree), elements=int(elements)
    )
    return SplineProblem(sliced, rest, **on._asdict(), rough=rough_shape(sliced))


@compiled("degree", "elements")
def _on_mesh(sliced: Problem, rest: Interpolant, *, degree: int, elements: int) -> _OnMesh:
    tool, material, band, r0 = sliced.tool, sliced.material, sliced.band, sliced.rest.r0
    left, length = mesh.spans(band, elements)
    count = jnp.where(material.beta > 0, 3, jnp.where(material.alpha > 0, 2, 1))
    density = (r0 / tool.radius) ** 2
    below = _edge(rest, band.lower, band.bottom, density, "below")
    above = _edge(rest, band.upper, band.top, density, "above")
    fixed, shift = mesh.conditions(length, degree, count, below, above, tool.top_fixed)
    splines = space(left, length, degree, jnp.full(2 * elements, 0.5))
    u = left[:, None] + length[:, None] * gauss_points(GAUSS)[0]
    slopes = jnp.stack(rest.derivatives(u.reshape(-1)), axis=1)
    terms = band_terms(rest, r0, tool, material, band).terms
    return _OnMesh(splines, fixed, shift, slopes, terms)


def _edge(rest: Interpolant, at: Array, height: Array, density: Array, side: str):
    """(w, w_u, w_uu) at an edge of the band, Y0 taken from outside the band."""
    y_u, y_uu, _ = rest.derivatives(at, side)
    return height - rest.height(at), density - y_u, -y_uu
