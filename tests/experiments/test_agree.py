"""``jaxclay agree``: when greedy and gradient count as agreeing, and what is said if not."""

import re

import pandas as pd
import pytest

pytest.importorskip("pydantic")

from jaxclay.cli.main import main
from jaxclay.experiments import run
from jaxclay.experiments.agree import agreement
from jaxclay.experiments.entries.tables import AgreeTable

TEXT = """\
kind = "throughput"
slices = 16
[[scenes]]
names = ["reference", "fig4c"]
units = ["snake", "printed"]
[[methods]]
name = "greedy-refined"
settings = {}
[agree]
energy = 1e-4
contour = 1e-4
"""


@pytest.fixture
def said(tmp_path, capsys):
    """What the command says, and how it ends."""

    def run(text, *more):
        path = tmp_path / "small.toml"
        path.write_text(text)
        code = main(["agree", str(path), "--out", str(tmp_path / "out"), *more])
        return code, capsys.readouterr().out

    return run


def test_the_packaged_population_agrees(tmp_path, capsys):
    assert main(["agree", "agreement", "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert int(re.search(r"(\d+) pairs compared", out)[1]) >= 12
    assert "all agree" in out


def test_only_snake_units_are_compared(said):
    code, out = said(TEXT)
    assert code == 0
    assert "the paper's scheme:\n2 pairs compared" in out


def test_each_scheme_has_its_verdict(said):
    both = TEXT.replace("settings = {}", 'schemes = ["paper", "slices"]')
    code, out = said(both)
    assert code == 0
    first, second = out.split("second-order slices, equal on each side of the band:\n")
    for part in (first.partition("the paper's scheme:\n")[2], second):
        assert part.startswith("2 pairs compared")
        assert "all agree" in part


def test_a_coarse_greedy_disagrees_and_the_command_for_each_reproduces_it(said):
    coarse = TEXT.replace("settings = {}", "settings = { step = 1e-2, smallest_step = 1e-2 }")
    code, out = said(coarse)
    assert code == 1
    assert "2 disagree" in out
    keys = re.findall(r"jaxclay agree \S+small.toml --out \S+ --only (\w+)", out)
    assert len(keys) == 2
    gaps = re.findall(r"(reference|fig4c) .* energy gap (\S+),", out)
    code, again = said(coarse, "--only", keys[0])
    assert code == 1
    assert re.findall(r"(reference|fig4c) .* energy gap (\S+),", again) == gaps[:1]


def test_no_pair_is_no_agreement(said):
    code, out = said(TEXT.replace("settings = {}", "settings = { max_iterations = 1 }"))
    assert code == 1
    assert "2 left out: greedy did not stop by its own rule" in out
    assert "no pair was compared" in out


def test_clay_that_is_all_under_the_tool_agrees(said):
    """E_free is 0 there, and so is the gap."""
    swallowed = "cylinders = { radius = 0.3 }\nsquash = { bottom = 0.0, height = 3.0, ratio = 1.0 }"
    code, out = said(TEXT.replace('names = ["reference", "fig4c"]', swallowed))
    assert code == 0
    assert "largest energy gap 0.0e+00" in out


def test_a_folder_that_was_filled_otherwise_is_judged_as_it_is(tmp_path, capsys):
    """By a timing run, of several methods and units; nothing is solved again."""
    text = TEXT.replace("throughput", "timing").replace("slices", "repeats = 1\nslices")
    steps = "settings = { step = 1e-2, smallest_step = [1e-2, 1e-6] }"
    (tmp_path / "small.toml").write_text(
        text.replace("settings = {}", steps) + '[[methods]]\nname = "greedy"\n'
    )
    out = tmp_path / "out"
    rows = run(tmp_path / "small.toml", out).query(
        "method == 'greedy-refined' and units == 'snake'"
    )
    limits = rows.gap_relative.abs().gt(1e-4) | rows.contour_error.gt(1e-4)
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*.parquet")}
    assert main(["agree", str(out)]) == 1
    said = capsys.readouterr().out
    assert f"{len(rows)} pairs compared: energy within 0.0001" in said
    keys = re.findall(r"jaxclay agree \S+out --only (\w+)", said)
    assert sorted(keys) == sorted(rows.key[limits])
    assert 0 < len(keys) < len(rows)
    (agreed, *_) = rows.key[~limits]
    assert main(["agree", str(out), "--only", agreed]) == 0
    assert main(["agree", str(out), "--profiles", str(tmp_path)]) == 2
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*.parquet")} == before


def test_an_unknown_key_and_no_greedy_are_refused(said, capsys):
    assert said(TEXT, "--only", "abc")[0] == 2
    assert said(TEXT.replace('"greedy-refined"', '"newton"'))[0] == 2


@pytest.mark.parametrize(("gap", "error"), [(-1e-3, 0.0), (float("nan"), 0.0), (0.0, float("nan"))])
def test_an_energy_below_the_minimum_or_no_number_disagrees_too(gap, error):
    row = {
        "status": "stalled", "energy_minimum": 1.0, "gap_relative": gap, "contour_error": error
    }  # fmt: skip
    found = agreement(pd.DataFrame([row]), AgreeTable())
    assert len(found.offenders) == 1
    assert not found.holds
