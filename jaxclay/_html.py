"""What notebooks show of a Clay and a Solution: a small inline SVG and the figures that matter."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import numpy as np

from jaxclay.contour import polyline

if TYPE_CHECKING:
    from jaxclay.clay import Clay
    from jaxclay.solution import Solution

_SIZE = 180  # pixels of the longer side


def clay_html(clay: Clay) -> str:
    """A silhouette and the clay's dimensions."""
    X = polyline(clay)[1:-1, 0]
    rows = {
        "height": f"{float(clay.height):.6g}",
        "radius": f"{X.min():.4g} to {X.max():.4g}",
        "volume": f"{float(clay.volume):.6g}",
        "slices": f"{clay.slices}",
        "unit l": f"{float(clay.unit):.6g}",
    }
    return _side_by_side(_svg((clay, "#E8D5C0", "#0072B2", "")), "Clay", rows)


def solution_html(solution: Solution) -> str:
    """The shape before and after, the status and what the certificate says."""
    certificate, rough = solution.certificate, solution.rough
    rows = {
        "status": str(solution.status),
        "case": rough.case + (f", below {rough.case_below}" if rough.case_below != "none" else ""),
        "E_total": f"{float(solution.energy):.9g}",
        "E_free": f"{float(certificate.energy_free):.6g}",
        "iterations": f"{int(solution.iterations)}",
        "unknowns": f"{int(solution.unknowns)}",
        "decrement": f"{float(certificate.decrement):.2g}",
        "height": f"{float(solution.clay.height):.6g}",
        "floor": f"active on {int(certificate.on_floor)} slices"
        if certificate.on_floor
        else "inactive",
    }
    svg = _svg(
        (solution.clay, "#E8D5C0", "#0072B2", ""),
        (solution.before, "none", "#8C8C8C", "4 3"),
    )
    return _side_by_side(svg, f"Solution ({solution.method})", rows)


def _svg(*shapes: tuple[Clay, str, str, str]) -> str:
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


def _side_by_side(svg: str, title: str, rows: dict[str, str]) -> str:
    cells = "".join(
        f"<tr><th style='text-align:left'>{escape(name)}</th><td>{escape(value)}</td></tr>"
        for name, value in rows.items()
    )
    return (
        "<div style='display:flex;gap:1.5em;align-items:center'>"
        f"{svg}<table><caption><b>{escape(title)}</b></caption>{cells}</table></div>"
    )
