"""Every packaged experiment, made small and killed in the middle: nothing is lost or done twice."""

import os
import random
import signal
import subprocess
import sys
import time

import pytest

pytest.importorskip("pandas")
pytest.importorskip("pydantic")
tomlkit = pytest.importorskip("tomlkit")

from sweeps import files, wait_for  # noqa: E402

from jaxclay.experiments import load, run  # noqa: E402
from jaxclay.experiments.engine import tasks_of  # noqa: E402
from jaxclay.experiments.entries.reading import (  # noqa: E402
    packaged,
    raw_experiment,
    read_experiment,
)

NAMES = [name for name in packaged() if not name.endswith("-quick")]
SIGNALS = [signal.SIGKILL, signal.SIGINT, signal.SIGPIPE, signal.SIGTERM]
COMMAND = (
    "import sys; from jaxclay.experiments import engine; engine.MOST = 1;"
    "from jaxclay.cli.main import entry; sys.argv[0] = 'jaxclay'; entry()"
)
FEW = {"draws": 2, "continuum": 64, "repeats": 1, "budget": 0.01, "slices": 16, "elements": 2,
       "tolerance": 1e-2, "stops": [1, 2], "displacement": 0.1, "mu": [0.5, 1.0], "alpha": 1.0,
       "beta": 1.0, "degree": 5, "first_answers": False}  # fmt: skip


def small(raw):
    """The same tables with one of everything that makes them long."""
    found = {}
    for key, value in raw.items():
        if key in FEW:
            value = FEW[key]
        elif key in ("names", "units"):
            value = value[:1]
        elif key == "methods":
            value = [small(one) for one in value[:2]]
        elif isinstance(value, dict):
            value = small(value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            kept = value[:1] if key == "scenes" else value
            value = [small(one) for one in kept]
        found[key] = value
    return found


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.slow
def test_a_packaged_experiment_is_killed_and_goes_on(name, tmp_path):
    path, out = tmp_path / f"{name}.toml", tmp_path / "out"
    path.write_text(tomlkit.dumps(small(raw_experiment(name))))
    count = len(tasks_of(read_experiment(path)))
    command = [sys.executable, "-c", COMMAND, "sweep", str(path), "--out", str(out), "--quiet"]
    rng = random.Random(name)
    environment = os.environ | {"TMPDIR": str(tmp_path)}  # where the lock of timing runs lies
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(command, env=environment, **quiet)
    wait_for(out, rng.randint(1, max(1, count // 2)), process)
    time.sleep(rng.uniform(0.0, 0.05))
    how = SIGNALS[NAMES.index(name) % len(SIGNALS)]
    if how is signal.SIGPIPE:  # which Python ignores: what writes into a closed pipe goes on
        process.send_signal(how)
        assert process.wait(timeout=300) == 0
    else:
        process.send_signal(how)
        process.wait(timeout=60)
    before = load(out)
    assert len(before) == before.key.nunique()
    table = run(path, out)
    assert len(table) == table.key.nunique() == count
    kept = table.set_index("key").loc[list(before.key)]
    assert (kept.process != os.getpid()).all()  # what was done has not been done again
    assert len(files(out)) >= len(set(table.finished)) > 0
