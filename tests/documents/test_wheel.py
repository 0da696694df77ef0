"""The package without its checkout and without extras; what has to be installed is said."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
COMMANDS = {
    "studio": "studio",
    "compare": "sweep",
    "compare --peers": "sweep",
    "atlas": "sweep",
    "sweep paper": "sweep",
    "report out": "sweep",
    "agree agreement": "sweep",
    "deform bowl --squash 0:0.1:0.2 --out a.csv --plot a.png": "plot",
}
CALLS = {
    "jaxclay.studio.Studio": "studio",
    "jaxclay.plots.contour": "plot",
    "jaxclay.compare.load('out')": "sweep",
    "jaxclay.experiments.run('paper', 'out')": "sweep",
    "jaxclay.experiments.load('out')": "sweep",
    "jaxclay.experiments.load_curves('out')": "sweep",
    "jaxclay.experiments.peers.prepare('ipopt', None)": "peers",
}
"""What needs an extra, and which."""

TRY_ALL = """
import importlib, sys, warnings
import jaxclay
from jaxclay.cli.main import main
warnings.simplefilter("ignore")
for name in ("compare", "experiments.peers"):
    importlib.import_module(f"jaxclay.{name}")
for command in %r:
    print(main(command.split()), file=sys.stderr)
for call in %r:
    try:
        eval(call)
    except ImportError as error:
        print(error, file=sys.stderr)
"""


@pytest.fixture(scope="module")
def environment(tmp_path_factory):
    """The folder of the commands of an environment with the wheel and what it needs alone."""
    folder = tmp_path_factory.mktemp("wheel")
    shutil.copytree(ROOT / "jaxclay", folder / "jaxclay")
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    build = "from setuptools import build_meta; build_meta.build_wheel('.')"
    subprocess.run(
        [sys.executable, "-c", build], cwd=folder, check=True, capture_output=True, timeout=300
    )
    (wheel,) = folder.glob("*.whl")
    subprocess.run([sys.executable, "-m", "venv", folder / "env"], check=True, timeout=300)
    install = [folder / "env" / "bin" / "pip", "install", "--quiet", wheel]
    subprocess.run([*install, "--constraint", ROOT / "constraints.txt"], check=True, timeout=550)
    return folder / "env" / "bin"


@pytest.mark.slow
def test_a_wheel_alone_squashes(environment, tmp_path):
    squash = ["deform", "bowl", "--squash", "0:0.1:0.2", "--slices", "16"]
    done = subprocess.run(
        [environment / "jaxclay", *squash, "--out", "a.csv", "--svg", "a.svg"],
        cwd=tmp_path, capture_output=True, text=True, check=True, timeout=300,
    )  # fmt: skip
    assert "converged" in done.stdout
    assert (tmp_path / "a.csv").exists()
    assert (tmp_path / "a.svg").exists()


@pytest.mark.slow
def test_what_needs_an_extra_says_which(environment, tmp_path):
    code = TRY_ALL % (list(COMMANDS), list(CALLS))
    done = subprocess.run(
        [environment / "python", "-c", code],
        cwd=tmp_path, capture_output=True, text=True, check=True, timeout=300,
    )  # fmt: skip
    lines = done.stderr.splitlines()
    assert lines[1 : 2 * len(COMMANDS) : 2] == ["2"] * len(COMMANDS)
    told = lines[: 2 * len(COMMANDS) : 2] + lines[2 * len(COMMANDS) :]
    for line, extra in zip(told, [*COMMANDS.values(), *CALLS.values()], strict=True):
        assert f"pip install '.[{extra}]' in a clone" in line


def test_lines_to_install_name_what_there_is():
    """A clone has extras; the package itself is on no index."""
    texts = [*ROOT.glob("*.md"), *ROOT.glob("notebooks/*.ipynb"), *ROOT.glob("jaxclay/**/*.py")]
    packages = {re.split("[><=]", wanted)[0] for wanted in PROJECT["dependencies"]}
    lines = [line for path in texts for line in path.read_text(encoding="utf-8").splitlines()]
    asked = [found for line in lines for found in re.findall(r"pip install ([^\s`\"]+)", line)]
    assert len(asked) > 3
    for wanted in asked:
        extra = re.fullmatch(r"'\.\[(\w+|\{extra\})\]'\)?", wanted)
        if extra and extra[1] != "{extra}":
            assert extra[1] in PROJECT["optional-dependencies"]
        assert extra or wanted.rstrip(",") in packages, wanted
