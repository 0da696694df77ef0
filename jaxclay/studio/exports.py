"""What a page can have of a piece as a file: contour and body."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from jaxclay.files.mesh import mesh_bytes
from jaxclay.files.piece import Piece
from jaxclay.files.profiles import save_profile
from jaxclay.files.svg import save_svg

Made = Callable[[Piece, float, float | None], bytes]


def _written(save: Callable[[Piece, Path, float], None]) -> Made:
    """What a function writes, as bytes."""

    def made(piece: Piece, millimetres: float, wall: float | None) -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "clay"
            save(piece, path, millimetres)
            return path.read_bytes()

    return made


def _table(piece: Piece, path: Path, millimetres: float) -> None:
    """In the piece's own lengths and heights."""
    save_profile(piece.clay, path, piece.base, piece.length_unit)


def _mesh(kind: str) -> Made:
    return lambda piece, millimetres, wall: mesh_bytes(piece.clay, kind, millimetres, wall)


EXPORTS: dict[str, tuple[str, Made]] = {
    "csv": ("text/csv", _written(_table)),
    "svg": ("image/svg+xml", _written(lambda piece, path, mm: save_svg(piece.clay, path, mm))),
    "stl": ("model/stl", _mesh(".stl")),
    "obj": ("model/obj", _mesh(".obj")),
    "glb": ("model/gltf-binary", _mesh(".glb")),
}
"""MIME type and what makes the bytes, by a file's ending."""
