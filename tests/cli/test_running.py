"""Ways to run the command, what is printed to be pasted, and what a source distribution holds."""

import shlex
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

import jaxclay

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("module", ["jaxclay", "jaxclay.cli"])
def test_modules_run_the_command(module):
    found = subprocess.run(
        [sys.executable, "-m", module, "--version"],
        capture_output=True, text=True, check=True, timeout=300,
    )  # fmt: skip
    assert found.stdout.strip() == jaxclay.__version__


def test_printed_commands_can_be_pasted(tmp_path, whole, experiment, capsys):
    pytest.importorskip("pydantic")
    from jaxclay.cli.main import main

    out = tmp_path / "Gefäße und mehr"
    whole.rename(out)
    assert main(["sweep", str(experiment), "--out", str(out), "--quiet"]) == 0
    pasted = capsys.readouterr().out.splitlines()[-1].split("; ")[-1]
    assert shlex.split(pasted) == ["jaxclay", "report", str(out)]
    out.rename(whole)
    out.mkdir()
    assert main(["report", str(out)]) == 2
    pasted = capsys.readouterr().err.split("make some with ")[1]
    assert shlex.split(pasted)[-1] == str(out)


def test_a_source_distribution_holds_all_tests_and_their_helpers(tmp_path):
    version = pytest.importorskip("setuptools").__version__
    if int(version.split(".")[0]) < 77:
        pytest.skip(f"setuptools {version} does not know this project's licence field")
    if not (ROOT / ".git").exists():
        pytest.skip("no checkout to make it of")
    build = "from setuptools import build_meta; import sys; build_meta.build_sdist(sys.argv[1])"
    names = subprocess.check_output(["git", "ls-files"], cwd=ROOT, text=True).splitlines()
    source = tmp_path / "source"
    for name in names:
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_bytes((ROOT / name).read_bytes())
    subprocess.run(
        [sys.executable, "-c", build, str(tmp_path)], cwd=source, check=True, timeout=300
    )
    (made,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(made) as archive:
        held = {name.partition("/")[2] for name in archive.getnames()}
    assert {name for name in names if name.startswith(("tests/", "scripts/", "notebooks/"))} <= held
