"""pose: find the material under the tool and say what is fixed (eqs. 10, 11)."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from jaxclay.clay.clay import Clay, equal_nodes, on_nodes, unchecked_clay
from jaxclay.model.band import Band, Rest, Tool, imposed, locate_band, tool_of
from jaxclay.model.energy import Terms
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash, check_fits
from jaxclay.numerics.checks import check_slices
from jaxclay.numerics.host import (
    check_float64,
    compiled,
    in_float64,
    is_concrete,
    is_transformed,
    promoting,
)
from jaxclay.schemes.paper import sums_of
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.slices.posing import SPACINGS, place, pose_on_host, pose_traced
from jaxclay.schemes.spline.pose import posed as posed_spline

SCHEMES = ("slices", "paper", "spline")
_DEGREE, _ELEMENTS = 5, 8


@promoting
def pose(
    clay: Clay,
    squash: Squash,
    material: Material,
    scheme: str = "slices",
    degree: int | None = None,
    elements: int | None = None,
    *,
    slices: int | tuple[int, int, int] | None = None,
    spacing: str | None = None,
) -> Any:
    """Pose a squash: find the material under the tool and say what is fixed (eqs. 10, 11).

    Parameters
    ----------
    clay : Clay
        The shape before the squash; for splines the function Y(u) between its nodes.
    squash : Squash
        In the clay's length unit.
    material : Material
        Its constants.
    scheme : str
        "slices", heights at nodes of which the band's edges are some, of second order; "paper",
        heights at equal steps of the clay (eqs. 20-22), of first order; or "spline".
    degree : int, optional
        Of the splines, 3 to 5 (5 if not given).
    elements : int, optional
        How many equal spans of splines the clay on each side of the band gets (8 if not given).
    slices : int or (int, int, int), optional
        How many slices, as many as the clay has if not given; with the scheme "slices" also how
        many below, under and above the tool.  Inside a transformation those three are fixed by
        the call: a quarter below, unless ``squash.bottom`` is the number 0, an eighth under it
        and the rest above, if it does not say; the nodes move with the band's edges.
    spacing : str, optional
        Of the scheme "slices": "placed", close where the contour bends (if not given), or
        "equal" on each side of the band and under it.

    Returns
    -------
    Problem or SplineProblem
        By scheme; what :func:`jaxclay.minimize` takes.

    Raises
    ------
    ValueError
        The band lies above the clay, leaves a held end no room, or, on the paper's scheme, holds
        fewer than two nodes, and so imposes no radius on this grid.  Too few slices for the
        sides of the band.  An unknown scheme, an argument that belongs to another, slices of
        unequal volume on the paper's scheme, a degree outside 3 to 5, no elements.
    TypeError
        Inside a JAX transformation while float64 is off.
    """
    check_scheme(scheme, slices=slices, spacing=spacing, degree=degree, elements=elements)
    concrete = is_concrete(clay, squash, material)
    if concrete:
        check_fits(squash, clay)
    if scheme == "spline":
        degree = _DEGREE if degree is None else degree
        return posed_spline(
            clay, squash, material, degree, _ELEMENTS if elements is None else elements
        )
    if scheme == "slices":
        spacing = "placed" if spacing is None else spacing
        wanted = clay.slices if slices is None else slices
        if concrete:
            return pose_on_host(place(clay, squash, material), wanted, spacing)
        check_float64("pose")
        return pose_traced(clay, squash, material, wanted, spacing)
    clay = _equal(clay, slices)
    problem = in_float64("pose", _pose, clay, squash, material)
    if concrete and not is_transformed(problem):
        _check_band(problem, squash)
    return problem


def check_scheme(scheme: str, **arguments: Any) -> None:
    """Raise where the scheme is unknown, or an argument belongs to another one."""
    if scheme not in SCHEMES:
        raise ValueError(f"unknown scheme {scheme!r}: choose from {', '.join(SCHEMES)}")
    owners = {
        "slices": ("slices", "paper"), "spacing": ("slices",),
        "degree": ("spline",), "elements": ("spline",),
    }  # fmt: skip
    for name, value in arguments.items():
        if value is not None and scheme not in owners[name]:
            owner = " and ".join(f'"{owner}"' for owner in owners[name])
            raise ValueError(f'{name}={value!r} belongs to scheme {owner}, not to "{scheme}"')
    spacing = arguments.get("spacing")
    if spacing not in (None, *SPACINGS):
        raise ValueError(f"unknown spacing {spacing!r}: choose from {', '.join(SPACINGS)}")


def _equal(clay: Clay, slices: Any) -> Clay:
    """The clay in slices of equal volume, as many as asked for, without edges of tools."""
    if slices is not None:
        check_slices(slices)
        if clay.equal and clay.slices == slices:
            return clay
        return on_nodes(clay, equal_nodes(slices))
    if not clay.equal:
        if is_concrete(clay):
            raise ValueError(
                "this clay has slices of unequal volume, but the paper's scheme takes equal ones: "
                f"give slices={clay.slices}, or clay.resliced({clay.slices}).clay"
            )
        return on_nodes(clay, equal_nodes(clay.slices))
    return clay


@compiled()
def _pose(clay: Clay, squash: Squash, material: Material) -> Problem:
    unit = clay.unit
    clay = unchecked_clay(clay.heights, clay.thickness, clay.r0, unit)
    nodes = jnp.asarray(equal_nodes(clay.slices), clay.heights.dtype)
    rest = Rest(clay.thickness / unit, clay.heights / unit, clay.r0 / unit**1.5, nodes)
    tool = tool_of(squash, unit)
    return problem_of(clay, rest, tool, material, locate_band(rest, tool, material))


def problem_of(clay: Clay, rest: Rest, tool: Tool, material: Material, band: Band) -> Problem:
    """The problem of a band that has been located: its nodes fixed where the tool wants them."""
    _, fixed, shift = imposed(rest, tool, band)
    sums = sums_of(rest.slices, rest.heights)
    none = jnp.zeros((), rest.heights.dtype)
    return Problem(
        clay, rest, tool, material, band, fixed, shift, sums, Terms(none, none, none, none)
    )


def _check_band(problem: Problem, squash: Squash) -> None:
    held = problem.rest.held(problem.band)
    if held.sum() >= 2:
        return
    share = float(problem.band.upper - problem.band.lower)
    raise ValueError(
        f"the band from {float(squash.bottom):g} to {float(squash.top):g} holds {share:.3g} of "
        f"the clay, which fixes {held.sum()} of the nodes of {problem.slices} slices and so "
        f"imposes no radius: use at least {int(np.ceil(2 / share))} slices (2/{share:.3g}) "
        "or a taller band"
    )
