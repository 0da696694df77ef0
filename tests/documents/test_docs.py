"""The reference: every public name says what it is, and the pages build without a warning."""

import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import jaxclay
from jaxclay import experiments

ROOT = Path(__file__).parents[2]
NAMES = {
    f"{module.__name__}.{name}": value
    for module in (jaxclay, experiments)
    for name, value in vars(module).items()
    if not name.startswith("_") and (inspect.isclass(value) or inspect.isfunction(value))
    if value.__module__.startswith("jaxclay")
}

# What is the paper's says which equation it is; the rest is ours.
OURS = {
    "Certificate", "Status", "area_error", "keep_compilations", "load", "load_curves",
    "load_profile", "run", "save_profile", "save_svg",
}  # fmt: skip


@pytest.mark.parametrize("name", [name for name in NAMES if name.split(".")[-1] not in OURS])
def test_what_is_the_papers_names_its_equation(name):
    assert re.search(r"\beqs?\. \d", inspect.getdoc(NAMES[name]) or "")


@pytest.mark.parametrize("name", NAMES)
def test_every_public_name_is_documented(name):
    value = NAMES[name]
    text = inspect.getdoc(value)
    assert text is not None
    assert len(text) > 15
    if inspect.isfunction(value) and len(inspect.signature(value).parameters) > 2:
        assert "Parameters\n" in text
    if inspect.isfunction(value) and "raise " in inspect.getsource(value):
        assert "Raises\n" in text


def test_public_names_are_those_of_the_package():
    assert {"jaxclay.deform", "jaxclay.Clay", "jaxclay.experiments.load"} <= set(NAMES)
    assert len(NAMES) > 25


@pytest.mark.slow
def test_the_pages_build_without_a_warning(tmp_path):
    pytest.importorskip("pdoc")
    command = [sys.executable, str(ROOT / "scripts" / "docs_pages.py"), str(tmp_path)]
    built = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert built.returncode == 0, built.stderr
    assert built.stderr == ""
    page = (tmp_path / "jaxclay" / "experiments.html").read_text(encoding="utf-8")
    assert "load_curves" in page
