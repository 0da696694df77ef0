"""The body as a closed triangle mesh in millimetres: STL, OBJ and GLB by trimesh (extra ``mesh``).

The contour is the polyline through slices' middles, edges and ends, some of them where there are
more than rings, turned about the axis, which is z, upwards.  A regular polygon in place of a
circle lacks area, and a polyline in place of a curve some more: all radii are a little longer, so
that the body has the clay's volume.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.clay.contour import check_rises, slice_points
from jaxclay.files.replacing import replacing
from jaxclay.numerics.checks import check_positive, check_whole, needing

FORMATS = (".stl", ".obj", ".glb")
_SIDES = 256
_FLAT = 1e-9  # of the height: points nearer than that are one
_OFFSETS = np.sin(np.linspace(-np.pi / 2, np.pi / 2, 65))
_LEAST_ROOM = 0.05  # of a piece's least radius, that a wall leaves inside


def mesh_of(
    clay: Clay, millimetres: float = 100.0, wall: float | None = None, rings: int = 256
) -> Any:
    """The body, watertight, its normals outwards.

    Parameters
    ----------
    clay : Clay
        What is turned.
    millimetres : float
        How many millimetres one unit of the clay's lengths is.
    wall : float, mm, optional
        Thickness of wall and floor of a vessel, open at the top, with the clay's outside; the
        whole body if not given.
    rings : int
        Points of the contour at most, at least 8; a circle is a polygon of 256 sides.

    Returns
    -------
    trimesh.Trimesh
        In millimetres, z upwards, the foot at 0.

    Raises
    ------
    ValueError
        Lengths that are not positive, a contour that does not rise, a wall that fills the piece.
    ImportError
        trimesh is missing.
    """
    with needing("mesh", "jaxclay.files.mesh"):
        import trimesh
    check_positive("millimetres", millimetres)
    check_whole("rings", rings, 8)
    check_rises(clay)
    points = _distinct(slice_points(clay) * millimetres)
    if len(points) > rings:
        points = points[np.round(np.linspace(0, len(points) - 1, rings)).astype(int)]
    area = _SIDES / 2 * np.sin(2 * np.pi / _SIDES)  # of the polygon in a circle of radius 1
    points[:, 0] *= np.sqrt(float(clay.volume) * millimetres**3 / (area * _squares(points)))
    if wall is not None:
        points = _vessel(points, wall)
    vertices, faces = _turned(points)
    return trimesh.Trimesh(vertices, faces, process=False)


def save_mesh(
    clay: Clay,
    path: str | os.PathLike,
    millimetres: float = 100.0,
    wall: float | None = None,
    rings: int = 256,
) -> None:
    """Write the body as STL, OBJ or GLB, by the file's name; it appears whole or not at all.

    All in millimetres; STL and OBJ with z upwards, GLB with y, as its standard has it, which
    importers turn back.

    Parameters
    ----------
    clay, millimetres, wall, rings
        As :func:`mesh_of` takes them.
    path : path
        The file, its name ending in .stl, .obj or .glb.

    Raises
    ------
    ValueError
        Another ending, or what :func:`mesh_of` refuses.
    OSError
        The file cannot be written.
    ImportError
        trimesh is missing.
    """
    kind = Path(path).suffix.lower()
    data = mesh_bytes(clay, kind, millimetres, wall, rings)
    with replacing(path) as temporary:
        temporary.write_bytes(data)


def mesh_bytes(
    clay: Clay, kind: str, millimetres: float, wall: float | None = None, rings: int = 256
) -> bytes:
    """What :func:`save_mesh` writes, ``kind`` one of :data:`FORMATS`."""
    if kind not in FORMATS:
        raise ValueError(f"a mesh is written as {', '.join(FORMATS)}, got {kind!r}")
    mesh = mesh_of(clay, millimetres, wall, rings)
    if kind == ".glb":
        mesh.vertices = mesh.vertices[:, [0, 2, 1]] * [1, 1, -1]
    data = mesh.export(file_type=kind[1:])
    return data.encode() if isinstance(data, str) else data


def _distinct(points: np.ndarray) -> np.ndarray:
    """Without points that lie on the one before."""
    apart = np.linalg.norm(np.diff(points, axis=0), axis=1) > _FLAT * points[-1, 1]
    return points[np.append(True, apart)]


def _squares(points: np.ndarray) -> float:
    """The integral of radius^2 over the height."""
    (a, b), steps = (points[:-1, 0], points[1:, 0]), np.diff(points[:, 1])
    return float(np.sum(steps * (a * a + a * b + b * b)) / 3)


def _vessel(points: np.ndarray, wall: float) -> np.ndarray:
    """The outside up to the rim, and from there the inside down to the floor on the axis."""
    check_positive("wall", wall)
    radius, y = points.T
    # The outside, eroded by a disc: nowhere is the wall thinner.
    near = np.clip(y[:, None] + wall * _OFFSETS, 0.0, y[-1])
    inner = np.interp(near, y, radius) - np.sqrt(np.maximum(wall**2 - (near - y[:, None]) ** 2, 0))
    inner = inner.min(axis=1)
    if wall >= y[-1] / 2 or inner.min() < _LEAST_ROOM * radius.min():
        raise ValueError(
            f"a wall of {wall:g} mm fills the piece, {y[-1]:.4g} mm tall with a least radius of "
            f"{radius.min():.4g} mm: a thinner one, or more millimetres a unit"
        )
    above = y > wall
    floor = np.interp(wall, y, inner)
    inside = np.concatenate([[[floor, wall]], np.stack([inner, y], axis=1)[above]])
    return np.concatenate([points, inside[::-1]])


def _turned(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of the closed body: rings, and a vertex on the axis at either end."""
    sides = _SIDES
    angle = 2 * np.pi * np.arange(sides) / sides
    radius, y = points[:, :1], points[:, 1:]
    rings = np.stack([radius * np.cos(angle), radius * np.sin(angle), y + 0 * angle], axis=2)
    axis = np.array([[0.0, 0.0, points[0, 1]], [0.0, 0.0, points[-1, 1]]])
    vertices = np.concatenate([rings.reshape(-1, 3), axis])
    i, j = np.meshgrid(np.arange(len(points) - 1) * sides, np.arange(sides), indexing="ij")
    after = (j + 1) % sides
    a, b, c, d = i + j, i + after, i + sides + after, i + sides + j
    walls = np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)])
    bottom, top = len(vertices) - 2, len(vertices) - 1
    k, last = np.arange(sides), (len(points) - 1) * sides
    foot = np.stack([bottom + 0 * k, (k + 1) % sides, k], axis=1)
    lid = np.stack([top + 0 * k, last + k, last + (k + 1) % sides], axis=1)
    return vertices, np.concatenate([walls.reshape(-1, 3), foot, lid])
