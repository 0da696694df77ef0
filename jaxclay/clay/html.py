"""What notebooks show of a Clay: a small inline SVG and the figures that matter."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np

from jaxclay.clay.contour import Piece, polyline

_SIZE = 180  # pixels of the longer side


def clay_html(clay: Any) -> str:
    """A silhouette and the clay's dimensions."""
    X = polyline(clay)[1:-1, 0]
    rows = {
        "height": f"{float(clay.height):.6g}",
        "radius": f"{X.min():.4g} to {X.max():.4g}",
        "volume": f"{float(clay.volume):.6g}",
        "slices": f"{clay.slices}",
        "unit l": f"{float(clay.unit):.6g}",
    }
    return side_by_side(silhouettes((clay, "#E8D5C0", "#0072B2", "")), "Clay", rows)


def silhouettes(*shapes: tuple[Piece, str, str, str]) -> str:
    """Clays in one picture, each with its fill, its stroke and its dashes."""
    outlines = []
    for clay, *style in shapes:
        points = polyline(clay)
        outlines.append((np.concatenate([points, points[::-1] * [-1, 1]]), style))
    everything = np.concatenate([points for points, _ in outlines])
    (left, bottom), (right, top) = everything.min(axis=0), everything.max(axis=0)
    scale = _SIZE / max(right - left, top - bottom)
    paths = []
    for points, (fill, stroke, dash) in outlines:
        x, y = (points[:, 0] - left) * scale + 4, (top - points[:, 1]) * scale + 4
        line = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        paths.append(
            f'<polygon points="{line}" fill="{fill}" stroke="{stroke}" stroke-width="1.5" '
            f'stroke-dasharray="{dash}"/>'
        )
    width, height = (right - left) * scale + 8, (top - bottom) * scale + 8
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
        f'role="img" aria-label="silhouette">{"".join(paths)}</svg>'
    )


def side_by_side(svg: str, title: str, rows: dict[str, str]) -> str:
    """A picture and a table of figures beside it."""
    cells = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th><td>{escape(value)}</td></tr>"
        for name, value in rows.items()
    )
    return (
        "<div style='display:flex;gap:1.5em;align-items:center'>"
        f"{svg}<table><caption><b>{escape(title)}</b></caption>{cells}</table></div>"
    )
