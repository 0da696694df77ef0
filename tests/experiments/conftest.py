import jax
import pytest
from jax.experimental.compilation_cache import compilation_cache


@pytest.fixture
def nothing_kept():
    """JAX compiles everything, as where nothing is on disk."""
    before = jax.config.jax_enable_compilation_cache
    jax.clear_caches()
    jax.config.update("jax_enable_compilation_cache", False)
    compilation_cache.reset_cache()
    yield
    jax.config.update("jax_enable_compilation_cache", before)
    compilation_cache.reset_cache()
