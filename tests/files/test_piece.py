"""The form of a piece: what it keeps, bit for bit, and what it refuses, in one line."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import piece as clay_of

from jaxclay import Clay, Material
from jaxclay.files.piece import Piece, load_piece, piece_of_json, piece_to_json, save_piece
from jaxclay.files.stroke import Stroke

CLAY = ("heights", "thickness", "material", "edges", "r0", "unit")
CONSTANTS = ("k", "mu", "alpha", "beta", "floor")
PRESS = Stroke("right", 20, 12.5, ((70, 45), (71, 44.5)))
SMOOTH = Stroke("left", 8, 8, ((80, 0),), "smooth", Material(mu=0.1))
PIECE = Piece(
    Clay.cylinder(40, 90, slices=8), Material(mu=0.3), Clay.cylinder(41, 90, slices=4),
    (PRESS, SMOOTH), base=60.0, length_unit="mm",
)  # fmt: skip


def same(a, b):
    for mine, other in ((a.clay, b.clay), (a.start, b.start)):
        for name in CLAY:
            np.testing.assert_array_equal(getattr(mine, name), getattr(other, name), err_msg=name)
    assert all(getattr(a.material, name) == getattr(b.material, name) for name in CONSTANTS)
    assert (a.strokes, a.base, a.length_unit) == (b.strokes, b.base, b.length_unit)


lengths = st.floats(1e-6, 1e6)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10**6), slices=st.integers(3, 40),
    base=st.one_of(st.just(0.0), st.floats(-1e3, 1e3)),
    path=st.lists(st.tuples(st.floats(-1e9, 1e9), st.floats(0, 1e9)), min_size=1, max_size=4),
    size=lengths, mu=st.floats(0, 1e9),
)  # fmt: skip
def test_every_bit_comes_back(seed, slices, base, path, size, mu):
    rng = np.random.default_rng(seed)
    clay = clay_of(rng.uniform(0.3, 3, slices), r0=rng.uniform(0.1, 10))
    stroke = Stroke("left", size, size * rng.uniform(), tuple(path), "press", Material(mu=mu))
    before = Piece(clay, Material(mu=mu), strokes=(stroke,), base=base, length_unit="cm")
    after = piece_of_json(piece_to_json(before))
    same(before, after)
    assert piece_to_json(after) == piece_to_json(before)
    # The clay itself moves by no more than the rounding of heights over the base.
    rounding = np.finfo(float).eps * (abs(base) + float(clay.height))
    np.testing.assert_allclose(after.clay.heights, clay.heights, rtol=0, atol=rounding)
    np.testing.assert_array_equal(after.clay.thickness, clay.thickness)


def test_edges_and_jumps_come_back(tmp_path):
    nodes = np.linspace(0, 1, 9)
    edges = [[0.25, 0.5], [0.25, 0.7], [0.5, 0.6]]
    clay = Clay(np.arange(9.0), np.ones(8), 1.3, 8.0, nodes, edges)
    save_piece(tmp_path / "a.json", Piece(clay))
    after = load_piece(tmp_path / "a.json")
    same(Piece(clay), after)
    assert after.strokes == ()


def test_the_form_is_the_documented_one():
    raw = json.loads(piece_to_json(PIECE))
    assert raw["version"] == 1
    assert set(raw) == {
        "version", "unit", "length_unit", "r0", "nodes", "heights", "thickness", "edges",
        "material", "start", "strokes",
    }  # fmt: skip
    assert raw["heights"] == [60 + 90 * i / 8 for i in range(9)]  # the file's own heights
    assert set(raw["start"]) == {"r0", "nodes", "heights", "thickness", "edges"}
    assert raw["strokes"][0] == {
        "side": "right", "size": 20.0, "face": 12.5, "path": [[70.0, 45.0], [71.0, 44.5]],
        "kind": "press", "material": None, "solver": None,
    }  # fmt: skip


def test_a_form_without_thickness_is_read_from_its_heights():
    raw = json.loads(piece_to_json(PIECE))
    for shape in (raw, raw["start"]):
        del shape["thickness"]
    del raw["length_unit"]
    found = piece_of_json(json.dumps(raw))
    np.testing.assert_allclose(found.clay.thickness, PIECE.clay.thickness, rtol=1e-13)
    assert found.length_unit is None


def changed(*keys, to):
    raw = json.loads(piece_to_json(PIECE))
    place = raw
    for key in keys[:-1]:
        place = place[key]
    if to is None:
        del place[keys[-1]]
    else:
        place[keys[-1]] = to
    return json.dumps(raw)


GOOD = piece_to_json(PIECE)
BAD = {
    "empty": ("", "damaged or cut off"),
    "cut off": (GOOD[: len(GOOD) // 2], "damaged or cut off.*line 1, column"),
    "a profile": ("height,radius\n0,1\n1,1\n", "damaged or cut off"),
    "a list": ("[]", "must be an object"),
    "nothing in it": ("{}", "version must be 1, got None"),
    "newer": (changed("version", to=2), "version 2.* reads version 1.*newer"),
    "version as text": (changed("version", to="1"), "version must be 1, got '1'"),
    "version true": (changed("version", to=True), "version must be 1, got True"),
    "version of many digits": ('{"version": ' + "9" * 6000 + "}", "version must be 1, got inf"),
    "nested": ("[" * 200_000, "too deep"),
    "nested objects": ('{"a":' * 100_000, "too deep"),
    "twice": (GOOD.replace('"unit"', '"unit": 1, "unit"', 1), "'unit' is there twice"),
    "missing": (changed("r0", to=None), "no key 'r0'"),
    "unknown": (changed("colour", to="red"), "unknown key 'colour'"),
    "unknown in start": (changed("start", "unit", to=2.0), "start has an unknown key 'unit'"),
    "not a number": (GOOD.replace("90.0", "NaN"), "NaN is no number"),
    "infinite": (GOOD.replace("90.0", "Infinity"), "Infinity is no number"),
    "beyond float64": (GOOD.replace('"unit": 90.0', '"unit": 1e999'), "unit must be a finite"),
    "unit": (changed("unit", to=-1.0), "unit must be positive"),
    "text for a number": (changed("heights", 3, to="60"), r"heights\[3\] must be a finite .*'60'"),
    "true for a number": (changed("nodes", 1, to=True), r"nodes\[1\] must be a finite .*True"),
    "no list": (changed("heights", to=3), "heights must be a list"),
    "large": (changed("nodes", to=[0] * 200_000), "nodes must be a list of at most 131072"),
    "falling": (changed("heights", 3, to=0.0), r"heights must increase.*heights\[3\] = 0"),
    "one fewer": (changed("start", "heights", 2, to=None), "start.heights must be 5.*got 4"),
    "nodes": (changed("nodes", 8, to=0.99), "nodes must run from 0 to 1"),
    "thickness": (changed("thickness", 3, to=2.0), "the piece is no clay: thickness"),
    "edges": (changed("edges", to=[[0.5]]), r"edges\[0\] must be two numbers"),
    "edge off nodes": (changed("start", "edges", to=[[0.3, 1.0]]), "start is no clay: an edge"),
    "start elsewhere": (changed("start", "heights", 0, to=59.0), "start is no clay"),
    "constant": (changed("material", "mu", to=-1.0), "material: mu must be"),
    "length unit": (changed("length_unit", to="furlong"), "length_unit must be one of mm"),
    "length unit's type": (changed("length_unit", to=[1]), "length_unit must be a text"),
    "no strokes": (changed("strokes", to=None), "no key 'strokes'"),
    "stroke": (changed("strokes", 1, to=[]), r"strokes\[1\] must be an object"),
    "side": (changed("strokes", 0, "side", to=["right"]), r"strokes\[0\]: side must be one of"),
    "kind": (changed("strokes", 0, "kind", to="cut"), r"strokes\[0\]: kind .*'cut'"),
    "size": (changed("strokes", 0, "size", to=0), r"strokes\[0\]: size must be positive"),
    "face": (changed("strokes", 0, "face", to=21), r"strokes\[0\]: face .* 20, got 21"),
    "no way": (changed("strokes", 0, "path", to=[]), r"strokes\[0\]: path must have"),
    "point": (changed("strokes", 0, "path", 1, to=[1, -2]), r"strokes\[0\]: path\[1\] .*1, -2"),
}


@pytest.mark.parametrize(("text", "message"), BAD.values(), ids=BAD)
def test_what_is_no_piece_is_refused_in_one_line(tmp_path, text, message):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as error:
        load_piece(path)
    assert type(error.value) is ValueError
    assert str(error.value).startswith(f"{path}: ")
    assert len(str(error.value).splitlines()) == 1
    assert len(str(error.value)) < 300 + len(str(path))


def test_bytes_that_are_no_text_are_refused(tmp_path):
    path = tmp_path / "a.json"
    path.write_bytes(b"\x89PNG\r\n\xff\xfe")
    with pytest.raises(ValueError, match=r"a\.json.*utf-8"):
        load_piece(path)


def test_a_failed_write_leaves_the_old_piece(tmp_path, monkeypatch):
    path = tmp_path / "a.json"
    save_piece(path, PIECE)
    monkeypatch.setattr("jaxclay.files.piece.json.dumps", lambda *_, **__: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        save_piece(path, Piece(Clay.cylinder()))
    assert path.read_text() == GOOD + "\n"
    assert [file.name for file in tmp_path.iterdir()] == ["a.json"]


def test_a_base_that_swallows_the_heights_is_refused():
    with pytest.raises(ValueError, match="lost in rounding"):
        Piece(Clay.cylinder(), base=1e17)
    with pytest.raises(ValueError, match="base must be finite"):
        Piece(Clay.cylinder(), base=float("nan"))
    with pytest.raises(ValueError, match="start must be of the piece's unit"):
        Piece(Clay.cylinder(), start=Clay.cylinder(height=2))
