"""What a page can have of a piece as a file: contour and body."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from jaxclay.clay.clay import Clay
from jaxclay.files.mesh import mesh_bytes
from jaxclay.files.profiles import save_profile
from jaxclay.files.svg import save_svg

Made = Callable[[Clay, float, float | None], bytes]


def _written(save: Callable[[Clay, Path, float], None]) -> Made:
    """What a function writes, as bytes."""

    def made(clay: Clay, millimetres: float, wall: float | None) -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "clay"
            save(clay, path, millimetres)
            return path.read_bytes()

    return made


def _mesh(kind: str) -> Made:
    return lambda clay, millimetres, wall: mesh_bytes(clay, kind, millimetres, wall)


EXPORTS: dict[str, tuple[str, Made]] = {
    "csv": ("text/csv", _written(lambda clay, path, millimetres: save_profile(clay, path))),
    "svg": ("image/svg+xml", _written(save_svg)),
    "stl": ("model/stl", _mesh(".stl")),
    "obj": ("model/obj", _mesh(".obj")),
    "glb": ("model/gltf-binary", _mesh(".glb")),
}
"""MIME type and what makes the bytes, by a file's ending."""
