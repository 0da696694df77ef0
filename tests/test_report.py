"""What a sweep's report says, against figures computed another way."""

import re

import numpy as np
import pytest

pd = pytest.importorskip("pandas")
pytest.importorskip("pydantic")
pytest.importorskip("matplotlib").use("Agg")

from jaxclay.cli import main  # noqa: E402
from jaxclay.compare import load, sweep  # noqa: E402
from jaxclay.sweep.charts import prepared  # noqa: E402
from jaxclay.sweep.statistics import (  # noqa: E402
    exponent,
    ladder,
    performance_profile,
    shifted_geometric_mean,
    times_to_solve,
)

SCENES = """
[[scenes]]
cylinders = { radius = [0.4, 0.5, 0.6] }
squash = { bottom = 0.0, height = [0.4, 0.1], ratio = 0.8 }
"""
TIMING = (
    'kind = "timing"\nslices = [8, 16]\nrepeats = 1\n'
    + SCENES
    + """
[[methods]]
name = "greedy"
settings = { step = [1e-2, 1e-3] }
[[methods]]
name = "greedy-refined"
stops = [1, 2, 4]
"""
)
THROUGHPUT = 'kind = "throughput"\nslices = 8\n' + SCENES + '[[methods]]\nname = "greedy"\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Runs of both kinds in one folder, and their report."""
    base = tmp_path_factory.mktemp("report")
    for name, text in (("timing", TIMING), ("throughput", THROUGHPUT)):
        (base / f"{name}.toml").write_text(text)
        sweep(base / f"{name}.toml", base / "out")
    assert main(["report", str(base / "out")]) == 0
    return base / "out"


@pytest.fixture(scope="module")
def page(folder):
    return (folder / "report.html").read_text(encoding="utf-8")


def test_the_page_needs_no_network_and_has_a_picture_beside_each_chart(folder, page):
    loads = re.findall(r"""(?:src|href)=["']?(?!#)[^"' >]+|url\((?!#)[^)]*\)|@import""", page)
    assert loads == []
    pictures = {path.stem for path in folder.glob("*.png")}
    assert pictures == {
        "timing-work-precision",
        "timing-energy",
        "timing-profile",
        "timing-scaling",
        "timing-failures",
        "throughput-errors",
        "throughput-failures",
    }
    assert page.count("<figure>") == page.count("<svg") == len(pictures)


def test_the_two_kinds_are_apart(page):
    before, timing, throughput = re.split(r"<h2>(?:Timing|Throughput)</h2>", page)
    assert "Work and precision" not in before + throughput
    assert "median ms" in timing
    assert "median ms" not in throughput


def test_the_page_says_what_ran_on_what_and_what_was_skipped(folder, page):
    table = load(folder)
    for name in ("jaxclay", "jax", "numpy", "python", "host", "processor", "device"):
        assert str(table[name].iloc[0]) in page.split("<h2>What ran on what</h2>")[1]
    assert (table.status == "skipped").any()
    assert "imposes no radius" in page


def test_medians_are_those_of_the_table(folder, page):
    table = load(folder)
    rows = table[
        (table.kind == "timing") & (table.slices == 8) & (table.method == "greedy-refined")
    ]
    rows = rows[rows.status != "skipped"]
    head, *lines = re.search(r"<table><tr>(<th class=l>units.*?)</table>", page)[1].split("<tr>")
    names = re.findall(r"<th class=l>(.*?)</th>", head)
    cells = [re.findall(r"<td class=l>(.*?)</td>", line) for line in lines]
    shown = pd.DataFrame(cells, columns=names).set_index(["slices", "method"])
    line = shown.loc[("8", "greedy-refined")]
    assert float(line["gap / E_free"]) == pytest.approx(rows.gap_relative.median(), rel=0.06)
    assert float(line["median ms"]) == pytest.approx(rows.solve_s.median() * 1e3, rel=0.01)
    assert "newton for greedy, greedy-refined" in page
    assert "uncertified" not in names  # nothing to say there


def test_where_no_minimum_is_certified_the_row_says_so(folder, monkeypatch, tmp_path):
    """A referee that the certificate never accepts."""
    from jaxclay.sweep import solving

    monkeypatch.setattr(solving, "certified_minima", lambda wanted, method: [None] * len(wanted))
    path = tmp_path / "one.toml"
    path.write_text(
        THROUGHPUT.replace(
            "cylinders = { radius = [0.4, 0.5, 0.6] }", "cylinders = { radius = 0.7 }"
        )
    )
    table = sweep(path, tmp_path / "out")
    assert set(table.reference) == {"none certified"}
    assert table[["gap", "gap_relative", "contour_error", "energy_minimum"]].isna().all(axis=None)
    assert main(["report", str(tmp_path / "out")]) == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "<td class=l>none certified</td>" in page
    assert not (tmp_path / "out" / "throughput-errors.png").exists()


def test_problems_are_scenes_on_a_grid(folder):
    rows = prepared(load(folder))
    timing = rows[rows.kind == "timing"]
    assert timing.problem.nunique() == 2 * timing.recipe.nunique() == 12


def test_performance_profiles_count_what_nobody_solves():
    times = pd.DataFrame({"a": [1.0, 4.0, np.nan, np.nan], "b": [2.0, 1.0, 3.0, np.nan]})
    profile = performance_profile(times)
    for name, wanted in {"a": {1: 0.25, 3.9: 0.25, 4: 0.5}, "b": {1: 0.5, 2: 0.75}}.items():
        factors, shares = profile[name]
        for factor, share in wanted.items():
            assert shares[np.searchsorted(factors, factor, side="right") - 1] == share


def test_times_to_solve_are_of_the_quickest_setting_that_is_good_enough():
    rows = pd.DataFrame(
        [
            ("p", "newton", 1.0, 1e-2),
            ("p", "newton", 2.0, 1e-6),
            ("p", "newton", 3.0, -1e-7),
            ("q", "newton", 1.0, 1.0),
        ],
        columns=["problem", "series", "solve_s", "gap_relative"],
    )
    found = times_to_solve(rows, "gap_relative", 1e-5, "problem")
    assert found.loc["p", "newton"] == 2.0
    assert np.isnan(found.loc["q", "newton"])


def test_exponents_and_shifted_means():
    slices = np.array([16, 32, 64, 128])
    assert exponent(slices, 3e-5 * slices**1.7) == pytest.approx(1.7)
    assert np.isnan(exponent([64, 64], [1.0, 2.0]))
    times = [0.0, 1e-3, 1.0]
    product = (1e-3 * 2e-3 * 1.001) ** (1 / 3) - 1e-3
    assert shifted_geometric_mean([*times, np.nan], 1e-3) == pytest.approx(product)


def test_a_ladders_band_holds_the_middle_of_the_scenes():
    errors = np.linspace(0, 1, 101)
    rows = pd.DataFrame({"settings": "loose", "solve_s": 0.5, "gap_relative": -errors})
    rungs = ladder(rows, "gap_relative", ["settings"])
    assert (rungs.low[0], rungs.median[0], rungs.high[0]) == pytest.approx((0.1, 0.5, 0.9))
