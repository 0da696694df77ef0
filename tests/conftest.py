from pathlib import Path

import jax
import pytest

_BOTTLES = Path(__file__).resolve().parents[2] / "shared" / "profiles"


@pytest.fixture(scope="session")
def bottles() -> list[Path]:
    """Digitised contours of real bottles, which are not part of the repository."""
    files = sorted(_BOTTLES.glob("*.csv"))
    if not files:
        pytest.skip("the bottle profiles are not beside this checkout (../shared/profiles)")
    return files


@pytest.fixture(scope="module", autouse=True)
def room_for_executables():
    """Let go of what is compiled before the kernel's limit of mappings a process (65,530).

    JAX keeps every executable, one takes hundreds of mappings, and XLA crashes without them.
    """
    yield
    maps = Path("/proc/self/maps")
    if maps.exists() and len(maps.read_text().splitlines()) > 20_000:
        jax.clear_caches()
