"""What a sweep's report says, against figures computed another way."""

import re
import shutil

import numpy as np
import pytest

pd = pytest.importorskip("pandas")
pytest.importorskip("pydantic")
pytest.importorskip("matplotlib").use("Agg")

import matplotlib.pyplot as plt  # noqa: E402
import pyarrow.compute as pc  # noqa: E402
import pyarrow.parquet as pq  # noqa: E402

from jaxclay.cli.main import main  # noqa: E402
from jaxclay.experiments import (  # noqa: E402
    load,
    load_curves,
    report,
    run,
)
from jaxclay.experiments.charts.shared import prepared  # noqa: E402
from jaxclay.experiments.charts.standard import timing_charts  # noqa: E402

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
        run(base / f"{name}.toml", base / "out")
    assert main(["report", str(base / "out")]) == 0
    return base / "out"


@pytest.fixture(scope="module")
def page(folder):
    return html(folder)


@pytest.fixture
def copy(folder, tmp_path):
    """The results alone in another folder."""
    shutil.copytree(folder / "results", tmp_path / "results")
    return tmp_path


def html(folder):
    return (folder / "report.html").read_text(encoding="utf-8")


def summaries(page):
    """The first summary on the page."""
    head, *lines = re.search(r'<table class="summary">(.*?)</table>', page, re.DOTALL)[1].split(
        "</tr>"
    )
    names = re.findall(r"<th.*?>(.*?)</th>", head)
    cells = [re.findall(r"<td.*?>(.*?)</td>", line) for line in lines]
    return pd.DataFrame([c for c in cells if c], columns=names).set_index("method")


def test_the_page_needs_no_network_and_has_a_picture_beside_each_chart(folder, page):
    loads = re.findall(r"""(?:src|href)=["']?(?!#)[^"' >]+|url\((?!#)[^)]*\)|@import""", page)
    assert loads == []
    pictures = {path.stem for path in (folder / "charts").glob("*.png")}
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
    assert "median ms" in timing.split("</table>")[0]
    assert "median ms" not in throughput.split("</table>")[0]


def test_the_page_says_what_ran_on_what_and_what_was_skipped(folder, page):
    table = load(folder)
    for name in ("jaxclay", "jax", "numpy", "python", "host", "processor", "device"):
        assert str(table[name].iloc[0]) in page.split("<h2>What ran on what</h2>")[1]
    assert (table.status == "skipped").any()
    assert "imposes no radius" in page


def test_the_summary_is_that_of_the_table(folder, page):
    table = load(folder)
    rows = table[(table.kind == "timing") & (table.method == "greedy-refined")]
    tried = rows[rows.status != "skipped"]
    line = summaries(page).loc["greedy-refined"]
    assert line["tasks"] == str(len(rows))
    assert float(line["median gap / E_free"]) == pytest.approx(
        tried.gap_relative.abs().median(), rel=0.06
    )
    assert float(line["median ms"]) == pytest.approx(tried.solve_s.median() * 1e3, rel=0.01)
    assert "newton for greedy, greedy-refined" in page


def test_times_of_each_machine_and_version_are_apart(copy, monkeypatch):
    table = load(copy)
    table["host"] = np.where(table.radius < 0.5, "cave", "attic & loft")
    table["jax"] = np.where(table.radius < 0.5, "1.0", "2.0")
    monkeypatch.setattr(report, "table", lambda folder: table)
    names = {path.name for path in report.write(copy)}
    assert {"timing-1-scaling.png", "timing-2-scaling.png", "throughput-errors.png"} <= names
    _, first, second, *rest = re.split("<h2>(?=Ti|Th|E)", html(copy))
    assert first.startswith("Timing on attic &amp; loft with jax 2.0<")
    assert second.startswith("Timing on cave with jax 1.0<")
    assert [part.split("<")[0] for part in rest] == ["Throughput", "Every row"]
    rows = table[(table.kind == "timing") & (table.host == "cave")]
    rows = rows[(rows.method == "greedy-refined")]
    line = summaries(second).loc["greedy-refined"]
    assert line["tasks"] == str(len(rows))
    tried = rows[rows.status != "skipped"]
    assert float(line["median ms"]) == pytest.approx(tried.solve_s.median() * 1e3, rel=0.01)


def test_experiments_that_are_pooled_are_named(copy, monkeypatch):
    monkeypatch.setattr(report, "all_charts", lambda *_: [])
    report.write(copy)
    assert "pooled" not in html(copy)
    (copy / "experiments").mkdir()
    for names in (["first-12ab"], ["first-12ab", "second-34cd"]):
        (copy / "experiments" / f"{names[-1]}.toml").touch()
        report.write(copy)
        summary, _, ran = html(copy).partition("<h2>What ran on what</h2>")
        assert ", ".join(names) in ran
        pooled = "2 experiments are pooled here: first-12ab, second-34cd" in summary
        assert pooled == (len(names) > 1)


def test_types_do_not_depend_on_what_was_skipped(folder, copy):
    for path in (copy / "results").iterdir():
        pq.write_table(pq.read_table(path).filter(pc.field("status") != "skipped"), path)
    whole, tried = load(folder), load(copy)
    assert len(tried) < len(whole)
    assert (whole.dtypes == tried.dtypes).all()
    kinds = whole[["iterations", "unknowns", "floored", "positive"]].dtypes
    assert [*map(str, kinds)] == ["Int64", "Int64", "boolean", "boolean"]


def test_no_profile_of_a_method_alone(folder):
    rows = prepared(load(folder))
    rows = rows[rows.kind == "timing"]
    spline = rows.family == "greedy"
    alone = rows.assign(
        scheme=rows.scheme.mask(spline, "spline"), family=rows.family.mask(spline, "spline")
    )
    traces = load_curves(folder)
    assert "profile" in [name for name, *_ in timing_charts(rows, traces)]
    assert "profile" not in [name for name, *_ in timing_charts(alone, traces)]
    plt.close("all")


def test_where_no_minimum_is_certified_the_row_says_so(folder, monkeypatch, tmp_path):
    """A reference_method that the certificate never accepts."""
    from jaxclay.experiments.solving import solve as solving

    monkeypatch.setattr(solving, "certified_minima", lambda wanted, method: [None] * len(wanted))
    path = tmp_path / "one.toml"
    path.write_text(
        THROUGHPUT.replace(
            "cylinders = { radius = [0.4, 0.5, 0.6] }", "cylinders = { radius = 0.7 }"
        )
    )
    table = run(path, tmp_path / "out")
    assert set(table.reference) == {"none certified"}
    assert table[["gap", "gap_relative", "contour_error", "energy_minimum"]].isna().all(axis=None)
    assert main(["report", str(tmp_path / "out")]) == 0
    page = html(tmp_path / "out")
    assert "none certified" in page
    assert not (tmp_path / "out" / "charts" / "throughput-errors.png").exists()


def test_problems_are_scenes_on_a_grid(folder):
    rows = prepared(load(folder))
    timing = rows[rows.kind == "timing"]
    assert timing.problem.nunique() == 2 * timing.specification.nunique() == 12
