"""How the public functions meet JAX: pytree dataclasses, and float64 on the host.

Called from the host, jaxclay computes in float64 whatever JAX's global flag
says and returns NumPy arrays.  Inside ``jit``, ``grad``, ``vmap`` or ``scan``
the caller owns the flag, so there it must be on.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import jax
import jax.core
import numpy as np
from jax._src.core import trace_state_clean  # JAX has no public way to ask, but making an array
from jax._src.xla_bridge import backends_are_initialized  # nor here

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])

MOST_MAPPINGS = 20_000  # of the 65,530 that Linux lets a process have
LOOK_AFTER = 16  # compilations, of some hundred mappings each


def pytree(cls: type[T]) -> type[T]:
    """Register a frozen dataclass as a pytree whose fields are all leaves or subtrees.

    Unflattening skips ``__init__``, so that validation runs once, on the host,
    and never on tracers or on the placeholders that JAX puts into trees.
    Fields marked ``metadata={"static": True}`` belong to the tree's structure; those
    marked "host" are None in what comes out of a transformation.
    """
    fields = dataclasses.fields(cls)  # type: ignore[arg-type]
    static = [f.name for f in fields if f.metadata.get("static")]
    host = [f.name for f in fields if f.metadata.get("host")]
    data = [f.name for f in fields if f.name not in static + host]

    keys = [jax.tree_util.GetAttrKey(name) for name in data]

    def flatten(obj):
        held = obj.__dict__
        return [held[name] for name in data], tuple([held[name] for name in static])

    def flatten_with_keys(obj):
        children, aux = flatten(obj)
        return list(zip(keys, children, strict=True)), aux

    def unflatten(aux, children):
        obj = object.__new__(cls)
        for name, value in [*zip(static, aux, strict=True), *zip(data, children, strict=True)]:
            object.__setattr__(obj, name, value)
        for name in host:
            object.__setattr__(obj, name, None)
        return obj

    jax.tree_util.register_pytree_with_keys(cls, flatten_with_keys, unflatten, flatten)
    return cls


def is_concrete(*trees: Any) -> bool:
    """Whether no leaf is a tracer, so that values can be looked at."""
    return not any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(trees))


def is_transformed(*trees: Any) -> bool:
    """Whether any leaf is a tracer, so that this call is part of a JAX transformation."""
    return not is_concrete(*trees)


def kept(compute: Callable[[Any], T]) -> Any:
    """A property that is computed once, but anew inside each transformation."""
    name = f"_kept_{compute.__name__}"

    @functools.wraps(compute)
    def get(self):
        found = self.__dict__.get(name)
        if found is None:
            found = compute(self)
            if is_concrete(found):
                self.__dict__[name] = found
        return found

    return property(get)


def as_float64(tree: T) -> T:
    """Every floating leaf as NumPy float64 (strong type: one compilation serves all values)."""

    def convert(leaf):
        array = np.asarray(leaf)
        return array.astype(np.float64) if array.dtype.kind in "fiu" else array

    return jax.tree.map(convert, tree)


def as_compiled() -> Any:
    """NumPy without warnings, as compiled code has none: what is not finite shows in a status."""
    return np.errstate(over="ignore", invalid="ignore", divide="ignore")


# Half the time to compile, and programs that run as fast here.
_WISHES: dict[str, bool | int] = {
    "xla_cpu_use_fusion_emitters": False,
    "xla_backend_optimization_level": 1,
}


@functools.cache
def _options() -> dict[str, bool | int]:
    """Those options of the compiler that the installed JAX knows."""
    known = {}
    for name, value in _WISHES.items():
        with contextlib.suppress(jax.errors.JaxRuntimeError, ValueError):
            jax.jit(lambda: 0, compiler_options={name: value}).lower().compile()
            known[name] = value
    return known


class Compiled:
    """A function for the host to call and for JAX to trace.

    Attributes
    ----------
    traced : the function as part of what is being traced
    whole : the function compiled by itself, with options that JAX allows only there
    """

    def __init__(self, fun: Callable[..., Any], static: tuple[str, ...] = ()):
        fun = promoting(fun)
        functools.update_wrapper(self, fun)
        self.traced = jax.jit(fun, static_argnames=static)
        self._fun, self._static = fun, static

    @functools.cached_property
    def whole(self) -> Any:
        """Made when it is first asked for, since which options there are is known then."""
        return jax.jit(self._fun, static_argnames=self._static, compiler_options=_options())

    def __call__(self, *args: Any, **static: Any) -> Any:
        """The function compiled by itself, or as part of what is being traced."""
        return (self.traced if is_transformed(*args) else self.whole)(*args, **static)


def promoting(fun: F) -> F:
    """The function, with NumPy's promotion of dtypes inside, whichever the caller has set."""

    @functools.wraps(fun)
    def promoted(*args: Any, **static: Any) -> Any:
        with jax.numpy_dtype_promotion("standard"):
            return fun(*args, **static)

    return promoted  # type: ignore[return-value]


def compiled(*static: str) -> Callable[[Callable[..., Any]], Compiled]:
    """Decorate a function as :class:`Compiled`, given its static arguments' names."""
    return lambda fun: Compiled(fun, static)


def in_float64(name: str, fun: Compiled, *args: Any, **static: Any) -> Any:
    """Call ``fun(*args, **static)`` in float64.

    On the host the result comes back as NumPy arrays.  Inside a transformation
    it stays traced.

    Raises
    ------
    TypeError
        Inside a transformation while JAX's 64-bit flag is off.
    RuntimeError
        In a process that was forked from one that had used JAX.
    """
    if is_transformed(*args):
        check_float64(name)
        return fun.traced(*args, **static)
    _check_threads()
    # What depends on nothing that is traced is a constant inside a transformation.
    ambient = contextlib.nullcontext() if _outside() else _evaluating_inside()
    with ambient, jax.enable_x64(True), whatever_is_watched():
        return jax.tree.map(np.asarray, fun.whole(*as_float64(args), **static))


_inside: list[bool] = []  # calls from the host under way within a trace, which JAX does not tell


@contextlib.contextmanager
def _evaluating_inside() -> Iterator[None]:
    _inside.append(True)
    try:
        with jax.ensure_compile_time_eval():
            yield
    finally:
        _inside.pop()


@contextlib.contextmanager
def whatever_is_watched() -> Iterator[None]:
    """Compiled, and with NaN told by a status, whatever the caller has JAX do to find mistakes.

    Steps one by one take minutes for a squash, and shapes that depend on values do not run so.
    """
    with contextlib.ExitStack() as stack:
        for name in ("disable_jit", "debug_nans", "debug_infs"):
            if getattr(jax.config, f"jax_{name}"):
                stack.enter_context(getattr(jax, name)(False))
        yield


def _outside() -> bool:
    """Whether nothing is being traced around this call, not even what it does not depend on."""
    return trace_state_clean() and not _inside


_without_threads: list[bool] = []


def _after_fork() -> None:
    if backends_are_initialized():
        _without_threads.append(True)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_after_fork)


def _check_threads() -> None:
    """Raise where JAX would wait for ever for threads that a fork has not taken along."""
    if _without_threads:
        raise RuntimeError(
            "this process was forked from one that had used JAX, which cannot go on here: start "
            'processes by multiprocessing.get_context("spawn"), or fork before JAX is used'
        )


def check_float64(name: str) -> None:
    """Raise unless JAX's 64-bit flag is on, inside a transformation where the caller owns it."""
    if not jax.config.jax_enable_x64:  # type: ignore[attr-defined]
        raise TypeError(
            f"jaxclay.{name} was called inside jit, grad, vmap or scan while JAX computes in "
            "float32, which cannot resolve a contour. Switch float64 on first: "
            'jax.config.update("jax_enable_x64", True), or wrap the outermost call in '
            "`with jax.enable_x64(True):`."
        )


recent_compilations: list[float] = []  # seconds of each since mappings were last counted


def _count(event: str, duration_secs: float, **_: Any) -> None:
    if event == "/jax/core/compile/backend_compile_duration":
        recent_compilations.append(duration_secs)
        let_go()


jax.monitoring.register_event_duration_secs_listener(_count)


def let_go() -> None:
    """Let go of all that is compiled where the kernel's limit of mappings comes near.

    JAX keeps every executable, one takes hundreds of mappings, and XLA crashes without them.
    For everything that the process compiles, the caller's own functions too.  Mappings are counted,
    which takes milliseconds, only after some compilations, and never inside a trace, which needs
    what has been compiled.
    """
    if len(recent_compilations) < LOOK_AFTER or not _outside():
        return
    recent_compilations.clear()
    maps = Path("/proc/self/maps")
    if maps.exists() and len(maps.read_text().splitlines()) > MOST_MAPPINGS:
        jax.clear_caches()
