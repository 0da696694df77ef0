"""Shapes that signatures promise, checked by jaxtyping and beartype as the tests run.

Arrays alone: what else signatures say is pyright's.  To be imported before the package.
"""

import importlib
import importlib.util
from typing import get_args

# Not all of numerics: what asks for types and tracers is called a million times, without shapes.
WHERE = ["clay", "model", "schemes", "methods", "solve"]
WHERE += [
    f"numerics.{name}" for name in ("banded", "banded_newton", "distance", "interpolation", "roots")
]


def checked(fun):
    """beartype's check of a function's arrays."""
    from beartype import beartype

    hints = fun.__annotations__
    for name in [name for name, hint in hints.items() if not _of_arrays(hint)]:
        del hints[name]
    return beartype(fun) if hints else fun


def _of_arrays(hint) -> bool:
    from jaxtyping import AbstractArray

    if isinstance(hint, type) and (issubclass(hint, AbstractArray) or hint.__name__ == "Scalar"):
        return True
    return any(map(_of_arrays, get_args(hint)))


if all(map(importlib.util.find_spec, ("beartype", "jaxtyping"))):  # the tests run without, too
    importlib.import_module("jaxtyping").install_import_hook(
        [f"jaxclay.{name}" for name in WHERE], "shapes.checked"
    )
