"""The contours that come with the package."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

# The Utah teapot's body (M. Newell 1975): cubic Bezier control points (radius, height).
_TEAPOT_BODY = (
    ((1.5, 0.0), (1.5, 0.075), (2.0, 0.3), (2.0, 0.75)),
    ((2.0, 0.75), (2.0, 1.2), (1.75, 1.725), (1.5, 2.25)),
)
_POINTS = 129


def _teapot() -> tuple[np.ndarray, np.ndarray]:
    s = np.linspace(0, 1, _POINTS)[:, None]
    pieces = []
    for a, b, c, d in np.array(_TEAPOT_BODY):
        ends = (1 - s) ** 3 * a + s**3 * d
        pieces.append(ends + 3 * s * (1 - s) * ((1 - s) * b + s * c))
    points = np.concatenate([pieces[0], pieces[1][1:]])
    return points[:, 1], points[:, 0]


def _amphora() -> tuple[np.ndarray, np.ndarray]:
    """A belly between a foot and a neck of the same radius, and a lip."""
    y = np.linspace(0, 1, _POINTS)
    belly = 0.19 * np.sin(np.pi * np.minimum(y / 0.82, 1)) ** 2
    lip = 0.03 * np.maximum((y - 0.82) / 0.18, 0) ** 2
    return y, 0.08 + belly + lip


def _bowl() -> tuple[np.ndarray, np.ndarray]:
    """A quarter of a sine on a foot."""
    y = np.linspace(0, 0.6, _POINTS)
    return y, 0.2 + 0.4 * np.sin(np.pi / 2 * y / 0.6)


PROFILES: dict[str, Callable[[], tuple[np.ndarray, np.ndarray]]] = {
    "teapot": _teapot,
    "amphora": _amphora,
    "bowl": _bowl,
}
"""Heights and radii (m,) of the packaged profiles, of their own length units, by name."""
