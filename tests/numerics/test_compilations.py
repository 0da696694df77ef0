"""What is compiled: kept on disk, and let go of where a process has too much of it."""

import os
import subprocess
import sys
import timeit
from pathlib import Path

import jax
import pytest

import jaxclay
from jaxclay.numerics import host

ROOT = Path(jaxclay.__file__).parents[1]
VARIABLES = ("JAX_COMPILATION_CACHE_DIR", "XDG_CACHE_HOME", "JAX_ENABLE_COMPILATION_CACHE")


def python(code, **variables):
    """What a fresh process prints, which may warn of nothing."""
    clean = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True, text=True, check=False, cwd=ROOT, timeout=300,
        env=clean | variables,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Error" not in done.stderr, done.stderr
    return done.stdout.split()


CLOSURES = """
import jax.numpy as jnp, numpy as np
from pathlib import Path
from jaxclay.numerics import host
from jaxclay.numerics.banded_newton import minimize_banded

def mappings():
    return len(Path("/proc/self/maps").read_text().splitlines())

start = mappings()
host.MOST_MAPPINGS, most = start + 1500, 0
for i in range(60):
    result = minimize_banded(lambda x: jnp.sum((x - i) ** 4 + x**2), np.ones(3), 1)
    assert result.converged
    most = max(most, mappings())
print(most - start)
"""


HELD = """
import jax, jax.numpy as jnp
from pathlib import Path
import jaxclay
from jaxclay.numerics import host

def mappings():
    return len(Path("/proc/self/maps").read_text().splitlines())

start = mappings()
host.MOST_MAPPINGS, held, most = start + 100, [], 0
for i in range(80):
    held.append(jax.jit(lambda x, i=i: jnp.sum(jnp.sin(x) ** i)))
    held[-1](jnp.ones(i + 1))
    most = max(most, mappings())
assert float(held[0](jnp.ones(1))) == 1.0
print(most - start)
"""


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="mappings are Linux's")
@pytest.mark.slow
def test_functions_of_many_shapes_that_a_program_keeps_do_not_fill_it():
    (most,) = python(HELD)
    assert 100 < int(most) < 450  # without letting go: 740


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="mappings are Linux's")
@pytest.mark.slow
def test_many_fresh_closures_do_not_fill_a_process():
    (most,) = python(CLOSURES)
    assert 1500 < int(most) < 5000  # without letting go: 60 closures take 6,000 and more


def test_letting_go_costs_a_warm_call_nothing():
    host.let_go()
    host.recent_compilations.clear()
    assert min(timeit.repeat(host.let_go, number=1000, repeat=5)) / 1000 < 2e-6


def test_nothing_is_let_go_inside_a_trace(monkeypatch):
    cleared = []
    monkeypatch.setattr(jax, "clear_caches", lambda: cleared.append(True))
    monkeypatch.setattr(host, "MOST_MAPPINGS", 0)
    clay, squash = jaxclay.Clay.cylinder(slices=8), jaxclay.Squash(0.0, 0.5, 0.4)

    def energy(mu):
        host.recent_compilations.extend([1.0] * host.LOOK_AFTER)
        return jaxclay.deform(clay, squash, jaxclay.Material(mu=mu), scheme="paper").energy

    with jax.enable_x64(True):
        jax.jit(energy).trace(1.0)
        jax.jit(lambda scale: scale * energy(1.0)).trace(1.0)  # nothing of it is traced
    assert not cleared
    jax.jit(lambda x: 2.5 * x)(1.0)  # compiled, outside of any trace
    assert cleared or not Path("/proc/self/maps").exists()


SOLVE = """
import jax, numpy as np, jaxclay
seen = []
jax.monitoring.register_event_listener(lambda name, **_: seen.append(name))
{before}
kept = jaxclay.keep_compilations({folder})
jaxclay.deform(jaxclay.Clay.cylinder(slices=8), jaxclay.Squash(0, 0.5, 0.4), jaxclay.Material(),
               slices=8)
print(kept, *(sum(f"cache_{{what}}" in name for name in seen) for what in ("hits", "misses")))
"""


def solve(folder=None, before="", **variables):
    code = SOLVE.format(folder="" if folder is None else repr(str(folder)), before=before)
    kept, hits, misses = python(code, **variables)
    return kept, int(hits), int(misses)


def test_a_second_process_compiles_nothing(tmp_path):
    folder, misses = tmp_path / "jaxclay" / "compilations", 0
    kept, hits, misses = solve(XDG_CACHE_HOME=str(tmp_path))
    assert kept == str(folder)
    assert hits == 0
    assert misses >= 1
    assert folder.stat().st_mode & 0o077 == 0  # what lies there is run
    again = solve(XDG_CACHE_HOME=str(tmp_path))
    assert again == (kept, misses, 0)


def test_a_folder_can_be_named_even_after_something_was_compiled(tmp_path):
    before = "jaxclay.keep_compilations({!r}); jax.jit(lambda x: x + 1)(1.0)"
    kept, _, misses = solve(tmp_path / "b", before.format(str(tmp_path / "a")), HOME="/dev/null")
    assert kept == str(tmp_path / "b")
    assert misses >= 1
    assert len(list((tmp_path / "b").glob("*-cache"))) >= 1
    assert len(list((tmp_path / "a").glob("*-cache"))) >= 1


def test_a_folder_that_jax_was_given_is_left_alone(tmp_path):
    given, home = tmp_path / "given", tmp_path / "home"
    kept, _, misses = solve(JAX_COMPILATION_CACHE_DIR=str(given), XDG_CACHE_HOME=str(home))
    assert kept == str(given)
    assert misses >= 1
    assert list(given.glob("*-cache"))
    assert not home.exists()


@pytest.mark.parametrize("home", ["/dev/null", "/proc/nobody"])
def test_a_home_that_cannot_be_written_is_no_error(home):
    assert solve(HOME=home)[:2] == ("None", 0)


def test_a_named_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        jaxclay.keep_compilations(tmp_path / "file" / "folder")


def test_notebooks_keep_compilations_and_scripts_do_not(tmp_path):
    code = "import jax, jaxclay; print(jax.config.jax_compilation_cache_dir)"
    inside = "import builtins; builtins.__IPYTHON__ = True; " + code
    variables = {"XDG_CACHE_HOME": str(tmp_path)}
    assert python(code, **variables) == ["None"]
    assert python(inside, **variables) == [str(tmp_path / "jaxclay" / "compilations")]
