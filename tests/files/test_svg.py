"""The outline in millimetres: what a drawing program sees is the clay."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import oracles
import pytest

import jaxclay
from jaxclay import Clay, save_svg


def teapot():
    return jaxclay.load_profile("teapot", 64)


def function(clay, count=40_000):
    """Points (radius, height) of the function through the clay's heights, from axis to axis."""
    u = np.linspace(0, 1, count)
    y, X = clay.height_at(u), clay.r0 / np.sqrt(clay.interpolant.slope(u))
    points = np.stack([X, y], axis=1)
    return np.concatenate([[[0, 0]], points, [[0, clay.height]]])


def read(path):
    """Width and height in mm, the numbers of the viewBox, the path's subcurves as points (k, 2)."""
    root = ET.parse(path).getroot()
    name = "{http://www.w3.org/2000/svg}"
    size = [float(root.get(key, "").removesuffix("mm")) for key in ("width", "height")]
    box = [float(word) for word in root.get("viewBox", "").split()]
    (drawn,) = root.findall(f"{name}path")
    (desc,) = root.findall(f"{name}desc")
    words = re.findall(r"[MCLZ]|-?[\d.]+,-?[\d.]+", drawn.get("d", ""))
    assert words[0] == "M"
    assert words[-1] == "Z"
    curves, at, command, waiting = [], np.zeros(2), "M", []
    for word in words[:-1]:
        if word in "MCL":
            command = word
            continue
        waiting.append(np.array(word.split(","), float))
        if len(waiting) == {"M": 1, "L": 1, "C": 3}[command]:
            if command != "M":
                curves.append(np.array([at, *waiting]))
            at, waiting = waiting[-1], []
    curves.append(np.array([at, curves[0][0]]))  # Z
    return size, box, curves, desc.text


def points_on(curve, count=80):
    """Bernstein's sum, written out."""
    s = np.linspace(0, 1, count)[:, None]
    if len(curve) == 2:
        return (1 - s) * curve[0] + s * curve[1]
    a, b, c, d = curve
    return (1 - s) ** 3 * a + 3 * s * (1 - s) ** 2 * b + 3 * s**2 * (1 - s) * c + s**3 * d


def right_half(curves, height):
    """Points (radius, height) of the outline's right half, from axis to axis, y up."""
    points = np.concatenate([points_on(curve) for curve in curves])
    points = points[: len(points) // 2][points[: len(points) // 2, 0] >= 0]
    points = points * [1, -1] + [0, height]
    return np.concatenate([[[0, points[0, 1]]], points, [[0, points[-1, 1]]]])


@pytest.mark.parametrize("tolerance", [1.0, 0.1, 0.001])
def test_the_path_lies_within_the_tolerance_of_the_contour(tmp_path, tolerance):
    clay, scale = teapot(), 40.0
    save_svg(clay, tmp_path / "a.svg", millimetres=scale, tolerance=tolerance)
    (width, height), box, curves, desc = read(tmp_path / "a.svg")
    contour = function(clay) * scale
    outline = right_half(curves, height)
    dense = oracles.hausdorff(outline, contour, points=4000)
    assert dense <= tolerance + 0.03  # its points lie 0.05 mm apart
    side = outline[(outline[:, 1] > 0) & (outline[:, 1] < height - 0.01)]
    Y_u, Y_uu, _ = clay.interpolant.derivatives(clay.material_at(side[:, 1] / scale))
    radius = clay.r0 / np.sqrt(Y_u)
    slant = np.hypot(1, radius * Y_uu / (2 * Y_u**2))  # of horizontal to shortest distance
    off = (np.abs(radius * scale - side[:, 0]) / slant).max()
    assert off <= tolerance * 1.02
    (stated,) = re.findall(r"at most (\S+) mm from the contour", desc)
    assert off <= float(stated) * 1.05
    assert width == pytest.approx(2 * scale * contour[:, 0].max() / scale, rel=1e-6)
    assert height == pytest.approx(scale * clay.height, rel=1e-8)
    np.testing.assert_allclose(box, [-width / 2, 0, width, height], rtol=1e-6, atol=1e-6)


def test_the_outline_is_closed_and_its_own_mirror_image(tmp_path):
    save_svg(teapot(), tmp_path / "a.svg", 40.0, 0.05)
    _, _, curves, _ = read(tmp_path / "a.svg")
    for before, after in zip(curves, curves[1:] + curves[:1], strict=True):
        np.testing.assert_array_equal(before[-1], after[0])
    drawn = np.concatenate([curve for curve in curves if len(curve) == 4])
    np.testing.assert_allclose(drawn[::-1] * [-1, 1], drawn, atol=1e-3)


def test_few_curves_do(tmp_path):
    counts = []
    for tolerance in (1.0, 0.1, 0.01, 0.001):
        save_svg(teapot(), tmp_path / "a.svg", 40.0, tolerance)
        counts.append(sum(len(curve) == 4 for curve in read(tmp_path / "a.svg")[2]) // 2)
    assert counts == sorted(counts)
    assert counts[1] <= 4
    assert counts[3] <= 24
    save_svg(Clay.cylinder(0.5, 1.0), tmp_path / "a.svg", 100.0, 0.01)
    (width, height), _, curves, _ = read(tmp_path / "a.svg")
    assert [len(curve) for curve in curves] == [4, 2, 4, 2]
    assert (width, height) == (100.0, 100.0)
    np.testing.assert_allclose(curves[0][:, 0], 50, rtol=1e-12)


def test_corners_and_jumps_stay_sharp(tmp_path):
    heights = np.array([0, 0.25, 0.5, 1.5, 2.5])
    edges = [(0.5, 0.5), (0.5, 0.25)]  # r0 / sqrt(Y_u) below and above
    clay = Clay(heights, np.diff(heights), 0.5, 1.0, edges=np.array(edges))
    save_svg(clay, tmp_path / "a.svg", 10.0, 0.01)
    _, _, curves, _ = read(tmp_path / "a.svg")
    corners = [tuple(curve[0]) for curve in curves]
    up = [(5.0, 25.0), (5.0, 20.0), (2.5, 20.0), (2.5, 0.0)]
    assert corners == up + [(-x, y) for x, y in up[::-1]]


def test_slices_are_drawn_as_the_function_through_them(tmp_path):
    clay = jaxclay.load_profile("bowl")
    save_svg(clay, tmp_path / "slices.svg")
    (_, height), _, curves, _ = read(tmp_path / "slices.svg")
    assert height == pytest.approx(60, rel=1e-12)
    contour = function(clay) * 100
    assert oracles.hausdorff(right_half(curves, height), contour, points=3000) < 0.05


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"millimetres": 0.0}, "millimetres must be positive and finite, got 0"),
        ({"millimetres": -3.0}, "millimetres must be positive and finite, got -3"),
        ({"tolerance": 0.0}, "tolerance must be positive and finite, got 0"),
        ({"tolerance": float("nan")}, "tolerance must be positive and finite, got nan"),
        ({"tolerance": 1e-12}, "tolerance is 1e-12 mm, but .* 100 mm tall to about 1e-07 mm"),
    ],
)
def test_bad_measures_are_named_and_nothing_is_written(tmp_path, arguments, message):
    with pytest.raises(ValueError, match=message):
        save_svg(Clay.cylinder(), tmp_path / "a.svg", **arguments)
    assert not list(tmp_path.iterdir())


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        save_svg(Clay.cylinder(), tmp_path / "nowhere" / "a.svg")
