"""One code for host and trace: array types, the namespace of the arguments, and loops in it.

On the host array functions are NumPy's and loops are Python's, which end as soon as nothing
changes any more; inside a JAX transformation they are jax.numpy's and ``fori_loop``'s.

Signatures say shapes as jaxtyping does, ``Float[Array, "n+1"]``; the tests check them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

T = TypeVar("T")

Array = Any
"""What is computed with: NumPy's arrays on the host, JAX's inside transformations."""

if TYPE_CHECKING:
    from typing import Annotated as Bool
    from typing import Annotated as Float
    from typing import Annotated as Int
    from typing import Annotated as Shaped

    Scalar = Any
else:

    class _Shaped:
        """``Float[Array, "n+1"]``, jaxtyping's where it is installed, else the array type alone.

        That takes 50 ms to import, so it is looked for when a signature is evaluated: in tests and
        for documentation.
        """

        def __init__(self, kind: str):
            self.kind = kind

        def __getitem__(self, of: tuple[Any, str]) -> Any:
            try:
                import jaxtyping
            except ImportError:
                return of[0]
            return getattr(jaxtyping, self.kind)[of]

    Bool, Float, Int, Shaped = map(_Shaped, ("Bool", "Float", "Int", "Shaped"))

    class _Number(type):
        def __instancecheck__(cls, value: Any) -> bool:
            return isinstance(value, float | int) or getattr(value, "shape", None) == ()

    class Scalar(metaclass=_Number):
        """A number: Python's, NumPy's, or an array without axes."""


_PLAIN = {np.ndarray, np.float64, np.bool_, np.int64, float, int, bool}  # known to be NumPy's
_PARTS = (tuple, list)


def namespace(*trees: Any) -> Any:
    """``jax.numpy`` if any leaf is JAX's own or traced, else ``numpy``."""
    for tree in trees:
        if type(tree) in _PLAIN:
            continue
        # Looked through by hand, since this is asked some hundred times for one squash.
        if isinstance(tree, _PARTS):
            parts = tree
        elif isinstance(tree, jax.Array):
            return jnp
        else:
            parts = getattr(tree, "__dict__", {}).values()
        if namespace(*parts) is jnp:
            return jnp
    return np


def pick(values: Any, index: Any) -> Any:
    """Entries of the last axis at indices that are known to lie inside."""
    if namespace(values, index) is np:
        return values[..., index]
    values = jnp.asarray(values)
    return values.at[..., index].get(mode="promise_in_bounds", wrap_negative_indices=False)


def repeat(steps: int, body: Callable[[T], T], carry: T) -> T:
    """``carry`` after ``steps`` times ``body``; on the host fewer where it has settled."""
    if namespace(carry) is jnp:
        return jax.lax.fori_loop(0, steps, lambda _, carry: body(carry), carry)
    for _ in range(steps):
        following = body(carry)
        settled = _same(carry, following)
        carry = following
        if settled:
            break
    return carry


def _same(one: Any, other: Any) -> bool:
    if isinstance(one, tuple):
        return all(map(_same, one, other))
    return bool(np.all(one == other))


def iterate(go_on: Callable[[T], Any], body: Callable[[T], T], carry: T) -> T:
    """``carry`` after ``body`` for as long as ``go_on``, ``while_loop`` inside a transformation."""
    if namespace(carry) is jnp:
        return jax.lax.while_loop(go_on, body, carry)
    while go_on(carry):
        carry = body(carry)
    return carry


def fixed(tree: T) -> T:
    """The tree without derivatives."""
    return jax.lax.stop_gradient(tree) if namespace(tree) is jnp else tree
