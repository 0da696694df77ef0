"""What is compiled once in a session is read from disk afterwards, in all its processes."""

import os

import jax
import pytest

_SETTINGS = {
    "jax_compilation_cache_dir": None,
    "jax_persistent_cache_min_compile_time_secs": 0.0,
    "jax_persistent_cache_min_entry_size_bytes": -1,
}


@pytest.fixture(scope="session", autouse=True)
def compiled_once(tmp_path_factory):
    """Compilations are kept in one folder of the session, by this process and those it starts."""
    base = tmp_path_factory.getbasetemp()
    folder = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    settings = _SETTINGS | {"jax_compilation_cache_dir": str(folder / "compilations")}
    before = {name: getattr(jax.config, name) for name in settings}
    with pytest.MonkeyPatch.context() as patch:
        for name, value in settings.items():
            patch.setenv(name.upper(), str(value))
            jax.config.update(name, value)
        yield
    for name, value in before.items():
        jax.config.update(name, value)


@pytest.fixture
def nothing_kept():
    """JAX compiles everything, as where nothing is on disk."""
    from jax.experimental.compilation_cache import compilation_cache

    for kept in (False, True):
        jax.config.update("jax_enable_compilation_cache", kept)
        compilation_cache.reset_cache()
        if not kept:
            jax.clear_caches()
            yield
