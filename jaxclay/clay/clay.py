"""Clay: what is shaped (eqs. 1-3, 22).

Notation: u in [0, 1] is the material coordinate (equal steps hold equal
volumes), Y(u) the height, X(u) the radius.  Slice i holds the share
h_i = u_{i+1} - u_i of the clay and has thickness t_i = Y_{i+1} - Y_i and radius
X_i = r0 sqrt(h_i / t_i) (eq. 22), with r0 = sqrt(volume / pi).
"""

from __future__ import annotations

import dataclasses
import warnings
from typing import NamedTuple

import jax
import numpy as np

from jaxclay.clay import text
from jaxclay.clay.contour import contour_error, polyline, slice_points
from jaxclay.clay.html import clay_html
from jaxclay.clay.outline import Outline, outline
from jaxclay.clay.slicing import cut_near, equal_volume_heights, volume_below
from jaxclay.numerics.arrays import Array, Float, Scalar, namespace
from jaxclay.numerics.checks import (
    check_increasing,
    check_nodes,
    check_positive,
    check_slices,
    within,
)
from jaxclay.numerics.distance import farthest
from jaxclay.numerics.host import is_concrete, kept, pytree
from jaxclay.numerics.interpolation import Interpolant, are_nodes, interpolant

NEAR = 1e-5  # of l: how near the slices of a profile are to it, if nobody says


@pytree
@dataclasses.dataclass(frozen=True, eq=False)
class Clay:
    """A rotationally symmetric piece of clay, n slices of given volumes (eqs. 2, 20, 22).

    Build it with :meth:`cylinder` or :meth:`from_profile`, or read it with
    :func:`jaxclay.load_profile`; squashes on the scheme "slices" put its nodes where the
    contour bends.

    Attributes
    ----------
    heights : (n+1,) array, length
        Y_0 = 0 < Y_1 < ... < Y_n, the slices' boundaries from bottom to top.
    thickness : (n,) array, length
        t_i = Y_{i+1} - Y_i, kept beside the heights because differences of
        heights are rounding noise on fine grids.
    r0 : float, length^(3/2)
        sqrt(volume / pi); never changes, whatever the clay goes through.
    unit : float, length
        l, the height of the piece when it first became clay.  Energies are
        those of lengths divided by l.
    material : (n+1,) array
        Nodes u_0 = 0 < u_1 < ... < u_n = 1, the material coordinates of the heights; i/n, slices
        of equal volume, if not given.
    edges : (m, 2) array
        (u, radius) where the edges of tools that shaped the clay have left their radius: points
        of the contour at nodes.  Two rows of one u are the radii below and above a jump.

    Raises
    ------
    ValueError
        Heights that do not increase from 0, an r0 or a unit that is not positive, nodes that do
        not increase from 0 to 1, edges that are no nodes.
    """

    heights: Array
    thickness: Array
    r0: Array
    unit: Array
    material: Array = None
    edges: Array = None

    def __post_init__(self):
        if not is_concrete(self):
            return
        set_field = object.__setattr__
        defaults = {"material": equal_nodes(np.size(self.thickness)), "edges": np.zeros((0, 2))}
        for name in ("heights", "thickness", "r0", "unit", "material", "edges"):
            value = getattr(self, name)
            value = defaults[name] if value is None else value
            set_field(self, name, np.array(value, np.float64))
        if self.heights.ndim != 1 or self.heights.shape[0] != self.thickness.shape[0] + 1:
            raise ValueError(
                f"heights must be one more than thickness: got shapes {self.heights.shape} and "
                f"{self.thickness.shape}"
            )
        check_slices(self.slices)
        check_increasing(self.heights, "heights")
        if self.heights[0] != 0:
            raise ValueError(f"heights must start at 0, got {self.heights[0]:g}")
        if not (self.thickness > 0).all():
            raise ValueError(f"every thickness must be positive, got {self.thickness.min():g}")
        apart = np.abs(np.diff(self.heights) - self.thickness).max()
        if apart > 1e-9 * self.heights[-1]:
            raise ValueError(
                f"thickness must be the differences of the heights, but they differ by {apart:g}"
            )
        check_positive("r0", self.r0)
        check_positive("unit", self.unit)
        check_nodes("material", self.material, self.slices)
        _check_edges(self.edges, self.material)

    @classmethod
    def cylinder(cls, radius: float = 0.5, height: float = 1.0, slices: int = 64) -> Clay:
        """A cylinder of the given radius and height, in one length unit, of ``slices`` slices.

        Raises
        ------
        ValueError
            A radius or a height that is not positive, fewer than 3 slices.
        """
        check_positive("radius", radius)
        check_positive("height", height)
        check_slices(slices)
        return cls(
            heights=height * np.arange(slices + 1) / slices,
            thickness=np.full(slices, height / slices),
            r0=radius * np.sqrt(height),
            unit=height,
        )

    @classmethod
    def from_profile(
        cls, heights, radii, slices: int | None = None, minimum_radius: float | None = None
    ) -> Clay:
        """Clay from a measured contour.

        The contour is the polyline through the points (radii, heights), so the
        solid is a stack of cone frusta; its volume is kept exactly.  Its lowest
        point becomes height 0 and its total height the unit l.

        Parameters
        ----------
        heights, radii : (m,) array_like, same length unit
            From bottom to top, or as :func:`jaxclay.clay.outline.outline` takes them.
        slices : int, optional
            n, how many slices of equal volume.  If not given, as many as bring the contour within
            1e-5 l of the points' (16,384 at most), of unequal volume where it turns.
        minimum_radius : float, optional
            Radii below it are raised to it; if not given, a tip on the axis to three hundredths of
            the largest.

        Raises
        ------
        ValueError
            Names the first bad value, its place and what is allowed.

        Warns
        -----
        UserWarning
            A tip was clipped without being asked for, or two halves averaged.
        """
        heights = np.asarray(heights, np.float64)
        radii = np.asarray(radii, np.float64)
        if heights.ndim != 1 or heights.shape != radii.shape or heights.size < 2:
            raise ValueError(
                "heights and radii must be two lists of the same length, at least 2: got shapes "
                f"{heights.shape} and {radii.shape}"
            )
        drawn = outline(heights, radii, minimum_radius)
        if drawn.altered:
            warnings.warn(", ".join(drawn.altered), stacklevel=2)
        return cut(drawn, slices).clay

    @property
    def slices(self) -> int:
        """n, the number of slices."""
        return self.thickness.shape[0]

    @property
    def radii(self) -> Float[Array, "n"]:
        """(n,) radius of each slice, length (eq. 22)."""
        return self.r0 / (self.thickness / (self.material[1:] - self.material[:-1])) ** 0.5

    @property
    def volume(self) -> Float[Array, "..."]:
        """Volume of the stack of slices, length^3; pi r0^2, which nothing changes (eq. 2)."""
        return np.pi * self.r0**2

    @property
    def height(self) -> Float[Array, "..."]:
        """Y_n, length."""
        return self.heights[-1]

    @property
    def equal(self) -> bool:
        """Whether the slices are of equal volume; False where traced nodes do not tell."""
        return is_concrete(self.material) and np.array_equal(
            self.material, equal_nodes(self.slices)
        )

    @kept
    def interpolant(self) -> Interpolant:
        """Y(u) between the nodes: :mod:`jaxclay.numerics.interpolation`."""
        return interpolant(self.material, self.heights, self.thickness, self.edges, self.r0)

    def height_at(self, u: Array) -> Float[Array, "..."]:
        """Height Y(u) at the material coordinates u in [0, 1], length; at nodes exactly Y_i.

        Between the nodes cubic, of order 4, and rising: :mod:`jaxclay.numerics.interpolation`.
        """
        return self.interpolant.height(within("u", u, 0.0, 1.0))

    def material_at(self, height: Array) -> Float[Array, "..."]:
        """The u with Y(u) = height: the fraction of the volume below heights in [0, Y_n]."""
        return self.interpolant.inverse(within("height", height, 0.0, self.height))

    def radius_at(self, height: Array) -> Float[Array, "..."]:
        """Radius X = r0 Y_u^-1/2 (eq. 3) at heights in [0, Y_n], length; above where it jumps."""
        return self.r0 / self.interpolant.slope(self.material_at(height)) ** 0.5

    def resliced(self, nodes: Array | int) -> Converted:
        """The clay on other nodes, its volume kept exactly, and how far its contour is off.

        Parameters
        ----------
        nodes : int or (m+1,) array
            How many slices of equal volume, or the material coordinates of the new nodes, from 0
            to 1.  The heights there are those of :meth:`height_at`.

        Returns
        -------
        Converted
            ``clay``, and ``error``: the largest distance between the two contours over l.

        Raises
        ------
        ValueError
            Fewer than 3 slices, nodes that do not increase from 0 to 1.
        """
        if np.ndim(nodes) == 0:
            check_slices(nodes)  # type: ignore[arg-type]
            nodes = equal_nodes(int(nodes))  # type: ignore[arg-type]
        nodes = np.asarray(nodes, np.float64)
        check_nodes("nodes", nodes)
        clay = on_nodes(self, nodes)
        return Converted(clay, contour_error(clay, self))

    def __repr__(self) -> str:
        edges = sum(np.shape(self.edges)[-2:-1])
        size = text.size(self.thickness)
        return text.lines(f"Clay: {size}, {edges} radii of edges", text.dimensions(self))

    def _repr_html_(self) -> str:
        return clay_html(self)


class Converted(NamedTuple):
    """Clay on other nodes, or from a profile.

    Attributes
    ----------
    clay : Clay
    error : float
        Largest distance between the two contours over l (:func:`jaxclay.contour_error`).
    """

    clay: Clay
    error: float


def cut(drawn: Outline, slices: int | None = None, near: float = NEAR) -> Converted:
    """Clay from an outline, its volume kept exactly, and how far its contour is off, over l.

    In ``slices`` of equal volume, or if that is None in as many as bring it within ``near`` of l.
    """
    if slices is not None:
        check_slices(slices)
    y, radii = drawn.heights - drawn.heights[0], drawn.radii
    r0, unit = np.sqrt(volume_below(y, radii)[-1]), y[-1]

    def clay(heights, nodes=None, edges=None) -> Clay:
        return Clay(heights, np.diff(heights), r0, unit, nodes, edges)

    if slices is not None:
        found = clay(equal_volume_heights(y, radii, slices))
    else:
        found = clay(*cut_near(y, radii, near * unit, lambda *parts: slice_points(clay(*parts))))
    inner = np.stack([radii, y], axis=1)
    line, contour = np.concatenate([[[0, 0]], inner, [[0, unit]]]), polyline(found)
    return Converted(found, max(farthest(contour, line), farthest(line, contour)) / float(unit))


def equal_nodes(slices: int) -> Float[Array, "{slices}+1"]:
    """(n+1,) i/n, the nodes of slices of equal volume."""
    return np.arange(slices + 1) / slices


def on_nodes(clay: Clay, nodes: Float[Array, "nodes"]) -> Clay:
    """The clay on other nodes; what lies on its own nodes stays bit for bit."""
    xp = namespace(clay, nodes)
    heights, thickness = clay.interpolant.on(nodes)
    edges = clay.edges
    if xp is np:
        edges = edges[are_nodes(nodes, edges[:, 0])]
    return unchecked_clay(heights, thickness, clay.r0, clay.unit, nodes, edges)


def unchecked_clay(
    heights: Float[Array, "nodes"],
    thickness: Float[Array, "nodes-1"],
    r0: Scalar,
    unit: Scalar,
    material: Float[Array, "nodes"] | None = None,
    edges: Float[Array, "m 2"] | None = None,
) -> Clay:
    """A Clay from arrays that may be traced, or a solver's word; no validation."""
    material = equal_nodes(thickness.shape[0]) if material is None else material
    edges = np.zeros((0, 2)) if edges is None else edges
    return jax.tree.unflatten(_STRUCTURE, (heights, thickness, r0, unit, material, edges))


def _check_edges(edges: np.ndarray, material: np.ndarray) -> None:
    if edges.ndim != 2 or edges.shape[1] != 2:
        raise ValueError(f"edges must be rows of (u, radius), got shape {edges.shape}")
    for u, radius in edges:
        check_positive("the radius of an edge", radius)
        if u not in material:
            raise ValueError(f"an edge lies on a node, but there is none at u = {u!r}")
    if (np.diff(edges[:, 0]) < 0).any():
        raise ValueError("edges must be in order of u")


_STRUCTURE = jax.tree.structure(Clay.cylinder(slices=3))
