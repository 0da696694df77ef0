"""What a page may ask: all that is wrong is refused in words, and the piece is kept."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxclay.clay.clay import Clay
from jaxclay.files.piece import piece_of_json
from jaxclay.studio.messages import Desk
from jaxclay.studio.modeller import Modeller


def points(*pairs):
    return np.array(pairs, "<f4").tobytes()


class Page:
    """A view that numbers its messages."""

    def __init__(self, desk, view="a"):
        self.desk, self.view, self.id = desk, view, 0

    def ask(self, kind, /, *buffers, **more):
        self.id += 1
        message = {"type": kind, "view": self.view, "id": self.id, **more}
        return self.desk.answer(message, buffers)

    def begin(self, *pairs, **more):
        given = {"side": "right", "size": 0.3, "face": 0.12, "kind": "press"} | more
        return self.ask("begin", points(*pairs), **given)

    def refusal(self, kind, /, *buffers, **more):
        ((content, _),) = self.ask(kind, *buffers, **more)
        assert content["type"] == "refused", content
        return content["message"]


@pytest.fixture
def page(ready):
    return Page(Desk(Modeller(Clay.cylinder(0.36)), ready))


def test_a_stroke_by_messages_is_that_of_the_modeller(page):
    (begun, _), *_ = page.begin((0.6, 0.4))
    assert (begun["type"], begun["id"], begun["view"]) == ("shape", 1, "a")
    ((told, buffers),) = page.ask("move", points((0.6, 0.35), (0.6, 0.3)))
    contour = np.frombuffer(buffers[0], "<f4").reshape(-1, 2)
    assert told["certified"]
    assert 10 < len(contour) <= 256
    radius = np.interp(0.6, contour[:, 1], contour[:, 0])
    assert radius == pytest.approx(0.3, abs=1e-3)
    (done, _), (kept, _) = page.ask("end")
    assert done["undo"] == 1
    assert piece_of_json(kept["text"]).clay.height == page.desk.modeller.clay.height
    assert page.desk.modeller.piece.strokes[0].path[1] == pytest.approx((0.6, 0.35))


def test_two_views_share_the_piece_but_not_a_stroke(page):
    other = Page(page.desk, "b")
    page.begin((0.6, 0.4), (0.6, 0.34))
    assert "another view" in other.refusal("move", points((0.5, 0.3)))
    assert "another view" in other.refusal("undo")
    assert "another view" in Page(page.desk, "c").begin((0.6, 0.4))[0][0]["message"]
    ((told, _),) = page.desk.left("a")  # the tab is closed: its stroke is done
    assert told["undo"] == 1
    assert other.ask("undo")[0][0]["undo"] == 0


def test_nothing_begins_before_the_solver_is_ready():
    from jaxclay.studio.solving import Compilations

    page = Page(Desk(Modeller(Clay.cylinder(0.36)), Compilations()))
    (content, _), *_ = page.begin((0.6, 0.4))
    assert "still preparing" in content["message"]
    assert page.ask("hello")[0][0]["ready"] is False


def test_messages_out_of_order_are_refused(page):
    page.begin((0.6, 0.4))
    page.id = 0
    assert "out of order" in page.refusal("move", points((0.6, 0.3)))


@pytest.mark.parametrize(
    ("kind", "buffers", "more", "reason"),
    [
        ("explode", (), {}, "no message of type 'explode'"),
        ("move", (), {}, "no stroke is under way"),
        ("rest", (), {}, "no stroke is under way"),
        ("end", (), {}, "no stroke is under way"),
        ("begin", (), {}, "size must be a number"),
        ("begin", (), {"size": float("nan"), "face": 0.1}, "size must be"),
        ("begin", (), {"size": 1e9, "face": 0.1}, "size must be"),
        ("begin", (), {"size": True, "face": 0.1}, "size must be"),
        ("start", (), {"name": "urn"}, "no shape 'urn'"),
        ("start", (), {"name": ["cone"]}, "must have a name"),
        ("open", (), {"text": "{"}, "damaged or cut off"),
        ("open", (), {"text": "[" * 100_000}, "too deep"),
        ("open", (), {"text": '{"version": 2}'}, "newer jaxclay"),
        ("open", (), {"text": "x" * (9 * 2**20)}, "at most"),
        ("profile", (), {}, "a profile is one file"),
        ("profile", (b"height,radius\n0,1\n",), {}, "the file"),
        ("profile", (b"height,radius\n0,1\n1,nan\n",), {}, "the file"),
        ("profile", (b"\0" * 1000,), {}, "the file"),
        ("target", (b"a,b\n",), {}, "the file"),
        ("export", (), {"kind": "exe", "millimetres": 1}, "no export 'exe'"),
        ("export", (), {"kind": "stl", "millimetres": -1}, "millimetres must be"),
        ("export", (), {"kind": "stl", "millimetres": 100, "wall": 90.0}, "fills the piece"),
    ],
)
def test_what_is_wrong_is_refused_in_words(page, kind, buffers, more, reason):
    before = page.desk.modeller.clay
    message = page.refusal(kind, *buffers, **more)
    assert reason in message
    assert message
    assert "fault inside" not in message
    assert page.desk.modeller.clay is before


@pytest.mark.parametrize(
    "buffer",
    [b"", b"1234567", points((0.5, np.nan)), points((np.inf, 0.3)), b"\0" * 8 * 5000],
    ids=["none", "odd", "nan", "inf", "huge"],
)
def test_places_of_the_tool_are_checked(page, buffer):
    given = {"side": "right", "size": 0.3, "face": 0.12, "kind": "press"}
    message = page.refusal("begin", buffer, **given)
    assert any(words in message for words in ("pair of float32", "pairs of float32", "finite"))
    assert not page.desk.modeller.drawing


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=6), inner, max_size=3)
    ),
    max_leaves=8,
)
KINDS = ["begin", "move", "rest", "end", "cancel", "undo", "redo", "reset", "start", "open",
         "profile", "target", "export", "replay", "hello", "save"]  # fmt: skip


@settings(max_examples=120, deadline=None)
@given(
    message=JSON
    | st.fixed_dictionaries(
        {"type": st.sampled_from(KINDS)},
        optional=dict.fromkeys(
            ("view", "id", "size", "face", "side", "kind", "name", "text"), JSON
        ),
    ),
    buffers=st.lists(st.binary(max_size=24), max_size=2),
)
def test_any_garbage_is_answered_and_costs_nothing(ready, message, buffers):
    desk = Desk(Modeller(Clay.cylinder(0.36)), ready)
    for content, sent in desk.answer(message, buffers):
        assert "fault inside" not in content.get("message", "")
        json.dumps({k: v for k, v in content.items() if k not in ("view", "id")}, allow_nan=False)
        assert all(isinstance(buffer, bytes) for buffer in sent)
    assert float(desk.modeller.clay.volume) == pytest.approx(np.pi * 0.36**2)


def test_a_piece_is_saved_opened_and_replayed(page):
    page.begin((0.6, 0.4), (0.6, 0.3))
    page.ask("end")
    ((saved, buffers),) = page.ask("save")
    assert saved["name"] == "piece.json"
    shaped = page.desk.modeller.clay
    page.ask("reset")
    page.ask("open", text=buffers[0].decode())
    np.testing.assert_array_equal(page.desk.modeller.clay.heights, shaped.heights)
    ((told, frames),) = page.ask("replay")
    assert told["exact"] is True
    assert len(frames) == 2


def test_a_target_is_drawn_and_matched(page):
    rows = b"height;radius\n0;0,4\n1;0,4\n"
    (_, buffers), (shape, _) = page.ask("target", rows)
    assert np.frombuffer(buffers[0], "<f4").reshape(-1, 2)[:, 0].max() == pytest.approx(0.4)
    assert shape["match"] == pytest.approx(0.1)
    assert page.ask("target")[0] == ({"type": "target", "view": "a", "id": 2}, [])


def test_a_profile_of_ones_own_becomes_the_piece_at_its_own_height(page):
    rows = "Höhe;Durchmesser (mm)\n10;60\n110;80\n".encode("latin-1")
    rows = rows.replace(b"H\xf6he", b"height (mm)")
    (shape, _), _, (said, _) = page.ask("profile", rows)
    assert shape["height"] == pytest.approx(100)
    assert shape["millimetres"] == 1.0
    assert "diameter" in said["message"]
    piece = page.desk.modeller.piece
    assert (piece.base, piece.length_unit) == (10.0, "mm")
    ((_, (table,)),) = page.ask("export", kind="csv", millimetres=1.0)
    assert b"110" in table


def test_a_stroke_that_its_view_has_abandoned_does_not_lock_the_piece(page, monkeypatch):
    other = Page(page.desk, "b")
    page.begin((0.6, 0.4), (0.6, 0.34))
    monkeypatch.setattr("jaxclay.studio.messages.ABANDONED", 0.0)
    assert "once more" in other.refusal("undo")
    assert other.ask("undo")[0][0]["strokes"] == 0


def test_a_piece_of_absurd_size_is_refused(page):
    from jaxclay.files.piece import Piece, piece_to_json

    clay = Clay(np.arange(5) * 1e6, np.full(4, 1e6), 1.0, 1.0)
    assert "times the unit" in page.refusal("open", text=piece_to_json(Piece(clay)))
