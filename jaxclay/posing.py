"""pose: find the material under the tool and say what is fixed (eqs. 10, 11)."""

from __future__ import annotations

from typing import Any, Literal, overload

import jax.numpy as jnp
import numpy as np

from jaxclay._host import compiled, in_float64, is_concrete, is_transformed
from jaxclay.band import Band, Rest, Tool, locate_band, tool_of
from jaxclay.clay import Array, Clay, Material
from jaxclay.problem import Problem
from jaxclay.schemes.spline.host import posed as posed_spline
from jaxclay.smooth_clay import SmoothClay
from jaxclay.squash import Squash, check_fits

SCHEMES = ("paper", "spline")


@overload
def pose(
    clay: Clay | SmoothClay, squash: Squash, material: Material, scheme: Literal["paper"] = ...
) -> Problem: ...


@overload
def pose(
    clay: Clay | SmoothClay,
    squash: Squash,
    material: Material,
    scheme: str,
    degree: int = ...,
    elements: int = ...,
) -> Any: ...


def pose(
    clay: Clay | SmoothClay,
    squash: Squash,
    material: Material,
    scheme: str = "paper",
    degree: int = 5,
    elements: int = 8,
) -> Any:
    """Pose a squash: find the material under the tool and say what is fixed (eqs. 10, 11).

    Parameters
    ----------
    clay : Clay or SmoothClay
        The shape before the squash: in n slices for the paper's scheme; for splines a
        function, into which slices are turned (:meth:`jaxclay.Clay.as_function`).
    squash : Squash
        In the clay's length unit.
    material : Material
        Its constants.
    scheme : str
        "paper", heights at nodes (eqs. 20-22), or "spline".
    degree : int
        Of the splines, 3 to 5.
    elements : int
        How many equal spans the clay on each side of the band gets.

    Returns
    -------
    Problem or SplineProblem
        By scheme; what :func:`jaxclay.minimize` takes.

    Raises
    ------
    ValueError
        The band lies above the clay, leaves a held end no room, or, on the
        paper's scheme, holds fewer than two nodes, and so imposes no radius on this
        grid.  An unknown scheme, a degree outside 3 to 5, no elements.
    TypeError
        Inside a JAX transformation while float64 is off.
    """
    if scheme not in SCHEMES:
        raise ValueError(f"unknown scheme {scheme!r}: choose from {', '.join(SCHEMES)}")
    concrete = is_concrete(clay, squash, material)
    if concrete:
        check_fits(squash, clay)
    if scheme == "spline":
        return posed_spline(clay, squash, material, degree, elements)
    if isinstance(clay, SmoothClay):
        raise ValueError(
            "this clay is a function Y(u), but the paper's scheme takes slices: give it "
            'clay.sliced(64).clay, or use scheme="spline"'
        )
    problem = in_float64("pose", _pose, clay, squash, material)
    if concrete and not is_transformed(problem):
        _check_band(problem, squash)
    return problem


@compiled()
def _pose(clay: Clay, squash: Squash, material: Material) -> Problem:
    unit = clay.unit
    rest = Rest(clay.thickness / unit, clay.heights / unit, clay.r0 / unit**1.5)
    tool = tool_of(squash, unit)
    return placed(clay, rest, tool, material, locate_band(rest, tool, material))


def placed(clay: Clay, rest: Rest, tool: Tool, material: Material, band: Band) -> Problem:
    """The problem of a band that has been located: its nodes fixed where the tool wants them."""
    held = band.holds(rest.slices)
    in_band = band.bottom + (rest.r0 / tool.radius) ** 2 * (rest.nodes() - band.lower)
    shift = jnp.where(held, in_band - rest.heights, 0.0).at[0].set(0.0)
    ends = jnp.zeros_like(held).at[0].set(True).at[-1].set(tool.top_fixed)
    return Problem(clay, rest, tool, material, band, held | ends, shift)


@compiled()
def _held(problem: Problem) -> Array:
    return problem.band.holds(problem.slices)


def _check_band(problem: Problem, squash: Squash) -> None:
    held = in_float64("pose", _held, problem)  # on the host a node on the edge needs float64 too
    if held.sum() >= 2:
        return
    share = float(problem.band.upper - problem.band.lower)
    raise ValueError(
        f"the band from {float(squash.bottom):g} to {float(squash.top):g} holds {share:.3g} of "
        f"the clay, which fixes {held.sum()} of the nodes of {problem.slices} slices and so "
        f"imposes no radius: use at least {int(np.ceil(2 / share))} slices (2/{share:.3g}) "
        "or a taller band"
    )
