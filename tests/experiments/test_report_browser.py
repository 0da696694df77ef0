"""A report as people read it: opened without a network, sorted and filtered."""

import numpy as np
import pytest
from browser import offline_page

pd = pytest.importorskip("pandas")
pytest.importorskip("pydantic")
pytest.importorskip("matplotlib").use("Agg")

from jaxclay.cli.main import main  # noqa: E402
from jaxclay.experiments import run  # noqa: E402

SMALL = """\
kind = "throughput"
slices = [8, 16]
[[scenes]]
cylinders = { radius = [0.4, 0.5, 0.6] }
squash = { bottom = 0.0, height = [0.4, 0.1], ratio = 0.8 }
[[methods]]
name = "greedy"
[[methods]]
name = "newton"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    base = tmp_path_factory.mktemp("browser")
    (base / "small.toml").write_text(SMALL)
    run(base / "small.toml", base / "out")
    assert main(["report", str(base / "out")]) == 0
    return base / "out"


@pytest.fixture(scope="module")
def page(folder):
    with offline_page(folder / "report.html") as opened:
        yield opened


@pytest.fixture(scope="module")
def table(folder):
    return pd.read_parquet(folder / "results.parquet")


@pytest.fixture(scope="module")
def places(page):
    """The number of each column of the page's rows."""
    return {name: i for i, name in enumerate(page.locator("#rows th").all_inner_texts())}


def column(page, i):
    """The cells of a column, of the rows that are shown, from top to bottom."""
    lines = "rows => rows.filter(row => !row.hidden)"
    return page.locator("#rows tbody tr").evaluate_all(
        f"(rows, i) => ({lines})(rows).map(row => row.cells[i].textContent)", i
    )


def test_charts_are_drawn_and_all_rows_are_there(page, table):
    boxes = [figure.bounding_box() for figure in page.locator("figure svg").all()]
    assert boxes
    assert all(box["width"] > 100 and box["height"] > 100 for box in boxes)
    assert page.locator("#rows tbody tr").count() == len(table)
    assert page.locator("#count").inner_text() == f"{len(table)} rows"


@pytest.mark.parametrize(("name", "source"), [("gap / E_free", "gap_relative"), ("solve s", None)])
def test_a_click_sorts_by_numbers_and_another_turns_round(page, table, places, name, source):
    values = table[source or "solve_s"].dropna().to_numpy()
    head = page.locator("#rows th").nth(places[name])
    for direction, wanted in (("ascending", np.sort(values)), ("descending", -np.sort(-values))):
        head.click()
        assert head.get_attribute("aria-sort") == direction
        shown = pd.to_numeric(pd.Series(column(page, places[name])), errors="coerce")
        known = shown.dropna()
        np.testing.assert_allclose(known, wanted, rtol=0.06)  # two digits are shown
        assert list(known.index) == list(range(len(values)))  # what is missing comes last


def test_words_sort_as_words(page, table, places):
    page.locator("#rows th").nth(places["status"]).click()
    assert column(page, places["status"]) == sorted(table.status)


@pytest.mark.parametrize("words", ["greedy stalled", "NEWTON converged", "skipped", "nothing such"])
def test_words_in_the_field_leave_the_rows_that_hold_all_of_them(page, table, places, words):
    texts = (table.method + " " + table.status).str.lower()
    wanted = [all(word in text for word in words.lower().split()) for text in texts]
    page.locator("#filter").fill(words)
    shown = zip(column(page, places["method"]), column(page, places["status"]), strict=True)
    kept = table[wanted]
    assert sorted(shown) == sorted(zip(kept.method, kept.status, strict=True))
    assert page.locator("#count").inner_text() == f"{sum(wanted)} of {len(table)} rows"
    page.locator("#filter").fill("")
    assert len(column(page, places["method"])) == len(table)
