"""JAX's compilations on disk, so that the second process answers at once."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import jax
from jax.experimental.compilation_cache import compilation_cache


def keep_compilations(folder: str | os.PathLike | None = None) -> Path | None:
    """Keep what JAX compiles on disk, small programs too, for this process and later ones.

    The command line does it, and so does ``import jaxclay`` in IPython and notebooks; scripts
    call this first.  It holds for everything that the process compiles from here on.
    ``JAX_ENABLE_COMPILATION_CACHE=0`` in the environment switches it off.

    Parameters
    ----------
    folder : path, optional
        Where.  What lies there is run, so nobody else should be able to write into it.  If not
        given: the folder that JAX has been given already, by its configuration or by
        ``JAX_COMPILATION_CACHE_DIR``; else ``jaxclay/compilations`` in the user's cache,
        ``XDG_CACHE_HOME`` or ``~/.cache``.

    Returns
    -------
    Path or None
        The folder; None, and nothing is kept, where the user's cache cannot be written.

    Raises
    ------
    OSError
        A ``folder`` was named that cannot be written.
    """
    given = jax.config.jax_compilation_cache_dir  # type: ignore[attr-defined]
    if folder is not None:
        place = _writable(Path(folder).absolute())
    elif given:
        place = given
    else:
        try:
            place = _writable(_of_user())
        except (OSError, RuntimeError):  # no home, or one that cannot be written
            return None
    if given and str(place) != given:
        compilation_cache.reset_cache()  # or JAX goes on in the folder it has opened
    jax.config.update("jax_compilation_cache_dir", str(place))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    return Path(place)


def _of_user() -> Path:
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "jaxclay" / "compilations"


def _writable(folder: Path) -> Path:
    """The folder, made if need be, for the user alone."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder):
        return folder
