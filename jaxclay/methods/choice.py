"""A method by its name, its settings checked."""

from __future__ import annotations

import dataclasses
from typing import Any

from jaxclay.methods import METHODS

# Coefficients couple all points of friction: less smoothing than this drowns in rounding.
_SPLINE_DEFAULTS = {"newton": {"tolerance": 1e-10, "smoothing": 1e-12}}


def method_settings(method: str, settings: dict[str, Any]) -> Any:
    """The method's settings, defaults filled in; errors name what is allowed."""
    if not isinstance(method, str) or method not in METHODS:
        raise ValueError(f"unknown method {method!r}: choose from {', '.join(METHODS)}")
    kind = METHODS[method].settings
    known = [field.name for field in dataclasses.fields(kind)]
    for name in settings:
        if name not in known:
            raise ValueError(f"{method} has no setting {name!r}: it takes {', '.join(known)}")
    return kind(**settings)


def spline_settings(method: str, settings: dict[str, Any]) -> Any:
    """The same for the scheme "spline", which not every method knows."""
    chosen = method_settings(method, _SPLINE_DEFAULTS.get(method, {}) | settings)
    if not METHODS[method].splines:
        able = ", ".join(name for name, other in METHODS.items() if other.splines)
        raise ValueError(f'{method} moves nodes; for scheme "spline" choose from {able}')
    return chosen
