"""Pictures: what is drawn is the clay, on the Axes that were given."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

import jaxclay

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")
plt = pytest.importorskip("matplotlib.pyplot")

from jaxclay.files import plots  # noqa: E402


@pytest.fixture(scope="module")
def solution():
    clay = jaxclay.Clay.cylinder(slices=64)
    material = jaxclay.Material.from_snake_units()
    return jaxclay.deform(clay, jaxclay.Squash(0.0, 0.3, 0.4), material, scheme="paper")


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    plt.close("all")


@pytest.mark.parametrize("draw", ["contour", "solution", "heights"])
def test_functions_take_and_return_axes(solution, draw):
    what = solution.clay if draw == "contour" else solution
    given = plt.subplots()[1]
    assert getattr(plots, draw)(what, given) is given
    made = getattr(plots, draw)(what)
    assert made.get_xlabel()
    assert made.get_ylabel()


def test_the_silhouette_is_the_clays(solution):
    line = plots.contour(solution.clay).lines[0]
    x, y = line.get_xdata(), line.get_ydata()
    assert np.isclose(x.max(), solution.clay.radii.max())
    assert np.isclose(x.min(), -solution.clay.radii.max())
    assert np.isclose(y.max(), solution.clay.height)
    assert y.min() == 0


def test_labels_that_were_set_stay(solution):
    ax = plt.subplots()[1]
    ax.set_xlabel("radius (mm)")
    assert plots.contour(solution.clay, ax).get_xlabel() == "radius (mm)"


def test_solution_shows_before_rough_and_minimum(solution):
    labels = [line.get_label() for line in plots.solution(solution).lines]
    assert labels == ["before", "rough shape (E_move)", "newton (E_total)"]


def test_notebooks_show_an_svg_and_the_figures_that_matter(solution):
    for shown, words in (
        (solution.clay, ["height", "volume", "slices", "64"]),
        (solution, ["converged", "case", "E_total", "0.0737"]),
    ):
        html = shown._repr_html_()
        svg = ET.fromstring(html[html.index("<svg") : html.index("</svg>") + 6])
        assert len(list(svg)) >= 1
        assert float(svg.get("width", "0")) < 300
        for word in words:
            assert word in html
