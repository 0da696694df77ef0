"""Files and pictures of clay that is a function."""

import xml.etree.ElementTree as ET

import numpy as np
import oracles
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_smooth_clay import random_clay

import jaxclay
from jaxclay import Clay, SmoothClay, load_profile, save_profile
from jaxclay.contour import polyline


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6), pieces=st.integers(1, 5), empty=st.integers(0, 2))
def test_a_file_gives_the_same_function_bit_for_bit(tmp_path_factory, seed, pieces, empty):
    path = tmp_path_factory.mktemp("csv") / "piece.csv"
    clay = random_clay(seed, pieces, empty, ratio=2.0)
    save_profile(clay, path)
    again = load_profile(path)
    assert isinstance(again, SmoothClay)
    for name in ("breaks", "control", "r0", "unit"):
        np.testing.assert_array_equal(getattr(again, name), getattr(clay, name))


@pytest.fixture
def saved(tmp_path):
    """A smooth piece of clay and its file."""
    clay = load_profile("amphora").as_function(1e-5).clay
    save_profile(clay, tmp_path / "piece.csv")
    return clay, tmp_path / "piece.csv"


def test_rows_are_points_of_the_contour_for_other_programs(saved):
    clay, path = saved
    skipped = sum(line.startswith("#") for line in path.read_text().splitlines()) + 1
    rows = np.genfromtxt(path, delimiter=",", skip_header=skipped)
    assert 100 < len(rows) < 2000
    np.testing.assert_allclose(clay.radius_at(rows[:, 0]), rows[:, 1], rtol=1e-12)
    half = (rows[1:] + rows[:-1]) / 2
    assert np.abs(clay.radius_at(half[:, 0]) - half[:, 1]).max() < 1e-6 * clay.unit * 2
    assert oracles.hausdorff(rows[:, ::-1], polyline(clay, 1e-6)[1:-1], points=2000) < 1e-3


def test_a_file_can_be_cut_into_slices(saved):
    clay, path = saved
    cut = load_profile(path, slices=48)
    assert isinstance(cut, Clay)
    np.testing.assert_array_equal(cut.heights, clay.sliced(48).clay.heights)
    assert (cut.r0, cut.unit) == (clay.r0, clay.unit)
    # With a least radius the rows are a measured contour like any other.
    measured = load_profile(path, slices=48, minimum_radius=1e-3)
    np.testing.assert_allclose(measured.heights, cut.heights, atol=1e-5)


def edited(path, change):
    lines = path.read_text().splitlines()
    change(lines)
    path.write_text("\n".join(lines) + "\n")
    return path


def drop_rows(lines):
    del lines[-200:-100]


def widen_a_row(lines):
    height, radius = lines[-50].split(",")
    lines[-50] = f"{height},{float(radius) * 1.01!r}"


def lose_a_number(lines):
    i = next(i for i, line in enumerate(lines) if line.startswith("# piece"))
    lines[i] = lines[i].rsplit(" ", 1)[0]


def damage_a_number(lines):
    i = next(i for i, line in enumerate(lines) if line.startswith("# piece"))
    lines[i] = lines[i].rsplit(" ", 1)[0] + " wide"


def lose_a_piece(lines):
    del lines[[line.startswith("# piece") for line in lines].index(True) + 1]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (drop_rows, r"rows are up to .* away from the pieces.*by hand.*# piece"),
        (widen_a_row, r"rows are up to .* away from the pieces.*by hand.*# piece"),
        (lose_a_number, r"line 3: a piece has its first u and 6 heights, not 6 numbers"),
        (damage_a_number, r"line 3: piece 'wide' is not a finite number"),
        (lose_a_piece, r"must be continuous"),
    ],
)
def test_a_file_edited_by_hand_is_refused(saved, change, message):
    path = edited(saved[1], change)
    with pytest.raises(ValueError, match=message) as error:
        load_profile(path)
    assert "piece.csv" in str(error.value)


def test_without_the_comments_the_rows_are_a_measured_contour(saved):
    clay, path = saved

    def drop_comments(lines):
        lines[:] = [line for line in lines if not line.startswith("#")]

    measured = load_profile(edited(path, drop_comments))
    assert isinstance(measured, Clay)
    np.testing.assert_allclose(measured.heights, clay.sliced(64).clay.heights, atol=1e-5)


def test_a_jump_of_the_radius_survives_the_file(tmp_path):
    y = np.arange(6) / 5
    clay = SmoothClay([0, 0.5, 1], [0.5 * y, 0.5 + 2 * y], 0.5, 1.0)
    save_profile(clay, tmp_path / "a.csv")
    again = load_profile(tmp_path / "a.csv")
    np.testing.assert_array_equal(again.control, clay.control)


def test_notebooks_show_a_small_svg_and_the_figures_that_matter(saved):
    html = saved[0]._repr_html_()
    assert len(html) < 20_000
    svg = ET.fromstring(html[html.index("<svg") : html.index("</svg>") + 6])
    assert len(list(svg)) == 1
    for word in ("height", "volume", "pieces", f"{saved[0].pieces}"):
        assert word in html


def test_plots_take_a_function(saved):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    ax = jaxclay.plots.contour(saved[0], fill=True)
    x, y = ax.lines[0].get_xdata(), ax.lines[0].get_ydata()
    right = x > 0
    np.testing.assert_allclose(saved[0].radius_at(y[right]), x[right], rtol=1e-9)
    assert y.max() == saved[0].height
    matplotlib.pyplot.close("all")
