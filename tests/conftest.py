import contextlib
import ctypes
import gc
import mmap
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

import jax
import pytest
import shapes  # noqa: F401 (before the package)
from sweeps import experiment, read, whole  # noqa: F401 (fixtures)

MOST_BYTES = 3 * 2**29
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
def little_memory():
    """Give memory back, what is compiled too before it fills it: a compilation is kept on disk."""
    yield
    _trim()
    if _resident() > MOST_BYTES:
        jax.clear_caches()
        gc.collect()
        _trim()


def _trim() -> None:
    """Give back what compiling has taken and freed, where there is glibc: workers held 5 GB."""
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL("libc.so.6").malloc_trim(0)


def _resident() -> int:
    """Bytes of memory that this process holds, 0 where nobody tells."""
    status = Path("/proc/self/statm")
    return int(status.read_text().split()[1]) * mmap.PAGESIZE if status.exists() else 0
