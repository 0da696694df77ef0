"""The page for the next person: its diagram is that of the imports, its code runs."""

import re
import sys
from pathlib import Path

import pytest

import jaxclay
from jaxclay.experiments.scenes import NAMED

ROOT = Path(__file__).parents[2]
README = ROOT / "jaxclay" / "README.md"
BLOCKS = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)


def test_the_diagram_is_that_of_the_imports(monkeypatch):
    monkeypatch.setattr(sys, "path", [str(ROOT / "scripts"), *sys.path])
    from house import diagram

    assert diagram() in README.read_text(encoding="utf-8"), "run scripts/house.py"


@pytest.fixture
def printed(capsys):
    """What a block prints; the tables it adds to are as before afterwards."""
    methods, scenes = dict(jaxclay.METHODS), dict(NAMED)

    def run(block):
        exec(compile(block, str(README), "exec"), {"__name__": "block"})
        return capsys.readouterr().out

    yield run
    for table, kept in ((jaxclay.METHODS, methods), (NAMED, scenes)):
        table.clear()
        table.update(kept)


def test_a_minimiser_is_added_in_a_few_lines(printed):
    assert printed(BLOCKS[0]) == "converged\n"


def test_an_energy_term_is_tried_in_a_few_lines(printed):
    converged, before, after = printed(BLOCKS[1]).split()
    assert converged == "True"
    assert float(after) < float(before)


def test_a_scene_is_added_in_a_line(printed):
    assert printed(BLOCKS[2]) == "[64]\n"
