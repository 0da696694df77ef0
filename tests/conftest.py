import contextlib
import os
from pathlib import Path

# As the command line and its workers have it; JAX reads it when it starts, and keys name it.
os.environ.setdefault("NPROC", "1")
# What one test has compiled, the next one, its processes and the next run need not; workers apart,
# since JAX's files are not written in one go.
os.environ.setdefault(
    "JAX_COMPILATION_CACHE_DIR",
    f"{Path(__file__).parents[1]}/.pytest_cache/compilations/"
    + os.environ.get("PYTEST_XDIST_WORKER", "alone"),
)
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_ENTRY_SIZE_BYTES", "-1")

import pytest
import shapes  # noqa: F401 (before the package)
from sweeps import experiment, read, whole  # noqa: F401 (fixtures)

from jaxclay.numerics.host import let_go

_BOTTLES = Path(__file__).resolve().parents[2] / "shared" / "profiles"


@pytest.fixture(scope="session")
def bottles() -> list[Path]:
    """Digitised contours of real bottles, which are not part of the repository."""
    files = sorted(_BOTTLES.glob("*.csv"))
    if not files:
        pytest.skip("the bottle profiles are not beside this checkout (../shared/profiles)")
    return files


@pytest.fixture(scope="session", autouse=True)
def own_lock(tmp_path_factory):
    """Other timing runs on the machine, such as those of other tests, do not stop these."""
    with pytest.MonkeyPatch.context() as patch:
        with contextlib.suppress(ImportError):
            patch.setattr("jaxclay.experiments.machine.LOCKS", tmp_path_factory.mktemp("locks"))
        yield


@pytest.fixture(scope="module", autouse=True)
def few_executables():
    """Let go of what is compiled before a process has too many mappings."""
    yield
    let_go()
