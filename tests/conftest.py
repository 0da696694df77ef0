from pathlib import Path

import pytest
from sweeps import compiled_once, experiment, whole  # noqa: F401 (fixtures)

from jaxclay._host import let_go

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
    """Let go of what is compiled before a process has too many mappings."""
    yield
    let_go()
