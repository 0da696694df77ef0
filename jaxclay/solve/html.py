"""What notebooks show of a Solution: the shape before and after, and the figures that matter."""

from __future__ import annotations

from typing import Any

from jaxclay.clay.html import side_by_side, silhouettes


def solution_html(solution: Any) -> str:
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
        "lower bound": f"active on {int(certificate.on_floor)} slices"
        if certificate.on_floor
        else "inactive",
    }
    svg = silhouettes(
        (solution.clay, "#E8D5C0", "#0072B2", ""),
        (solution.before, "none", "#8C8C8C", "4 3"),
    )
    return side_by_side(svg, f"Solution ({solution.method})", rows)
