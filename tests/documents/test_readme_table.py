"""The README's table of methods and schemes says what they do."""

from pathlib import Path

import pytest
from scenes import REFERENCE, SNAKE

import jaxclay
from jaxclay import METHODS, Clay, pose

README = Path(__file__).resolve().parents[2] / "README.md"
HEADER = "| in snake units | paper | slices, equal | slices, placed | spline |"
CLAY = Clay.cylinder(slices=24)
POSED = {
    "paper": {"scheme": "paper"},
    "slices, equal": {"spacing": "equal"},
    "slices, placed": {},
    "spline": {"scheme": "spline", "elements": 8},
}


def rows() -> dict[str, list[str]]:
    lines = README.read_text().split(HEADER)[1].splitlines()[2:]
    table = {}
    for line in lines:
        if not line.startswith("|"):
            break
        name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        table[name.strip("`")] = cells
    return table


def test_every_method_has_its_row():
    assert set(rows()) == set(METHODS)
    for name, cells in rows().items():
        assert len(cells) == len(POSED)
        assert (cells[-1] == "-") == (not METHODS[name].splines)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_each_ends_as_the_table_says(method):
    for cell, how in zip(rows()[method], POSED.values(), strict=True):
        if cell != "-":
            answer = jaxclay.minimize(pose(CLAY, REFERENCE, SNAKE, **how), method)
            assert str(answer.status) == cell, (how, answer.message)
