"""The modeller without a browser: strokes in, certified shapes out, undo, pieces, replay."""

import dataclasses

import numpy as np
import pytest

import jaxclay
from jaxclay.clay.clay import Clay
from jaxclay.files.piece import Piece, piece_of_json, piece_to_json
from jaxclay.files.stroke import Solver, Stroke
from jaxclay.solve.certified_newton import program
from jaxclay.studio import drawing
from jaxclay.studio import modeller as modelling
from jaxclay.studio.modeller import Modeller, replay
from jaxclay.studio.solving import MOVING
from jaxclay.studio.starts import STARTS
from jaxclay.studio.tool import STEP

DRAG = [(0.7, 0.42), (0.7, 0.3), (0.45, 0.3), (0.45, 0.45)]


def stroke(path=DRAG, kind="press", **more):
    return Stroke("right", 0.3, 0.12, path, kind, **more)


@pytest.fixture
def modeller(ready):
    return Modeller(Clay.cylinder(0.36))


@pytest.fixture(scope="module")
def drawn(ready):
    """Two strokes, the second of another tool and smoothing."""
    modeller = Modeller(Clay.cylinder(0.36))
    modeller.draw(stroke())
    modeller.draw(stroke([(0.8, 0.38), (0.3, 0.34)], "smooth"))
    return modeller


def test_a_stroke_presses_the_clay_and_keeps_its_volume(modeller):
    before = modeller.clay
    reading = modeller.draw(stroke([(0.6, 0.4), (0.6, 0.3)]))
    assert reading.certified
    assert modeller.clay.r0 == before.r0
    points = np.linspace(0.56, 0.64, 20)
    np.testing.assert_allclose(modeller.clay.radius_at(points), 0.3, atol=1e-3)
    assert modeller.clay.radii.max() > 0.38  # what was pressed away lies beside the band
    assert reading.error < 1e-4
    low, high = reading.zone
    assert low < 0.54 < 0.66 < high
    assert reading.terms.total > 0


def sampled(rate):
    """In, down and out again within a second, by so many events a second."""
    times = np.arange(0, 1 + 1e-9, 1 / rate)
    corners = np.array(DRAG)
    return [tuple(np.interp(t, [0, 0.3, 0.8, 1], corners[:, i]) for i in (0, 1)) for t in times]


def test_the_result_does_not_depend_on_how_often_the_pointer_was_sampled(ready):
    clays = []
    for rate in (10, 200):
        modeller = Modeller(Clay.cylinder(0.36))
        first, *others = sampled(rate)
        modeller.begin(stroke([first]))
        for i, point in enumerate(others):
            modeller.move([point])
            if i % 70 == 3:
                modeller.rest()
        modeller.end()
        clays.append(modeller.clay)
    assert jaxclay.contour_error(*clays) < 1e-6
    assert jaxclay.contour_error(clays[0], Clay.cylinder(0.36)) > 0.03


def test_working_ahead_changes_nothing_but_who_waits(ready):
    """Whether steps are done while nobody asks or when they are needed."""
    shapes = []
    for ahead in (False, True):
        modeller = Modeller(Clay.cylinder(0.36))
        first, *others = sampled(60)
        modeller.begin(stroke([first]))
        for point in others:
            reading = modeller.move([point])
            assert reading.certified
            if ahead:
                modeller.work_ahead()
        exact = modeller.rest().clay
        shapes.append((modeller.end().clay, exact))
        modeller.work_ahead()
    for one, other in zip(*shapes, strict=True):
        np.testing.assert_array_equal(one.heights, other.heights)


def test_what_is_shown_is_near_to_what_stays_and_within_the_tolerance(ready, monkeypatch):
    """Of the same clay and squash; with the tool in clay a step behind it is much the same."""
    follow, given = drawing.follow, []

    def kept(*arguments):
        given[:] = [arguments[1:4], follow(*arguments)]
        return given[1]

    monkeypatch.setattr(drawing, "follow", kept)
    modeller = Modeller(Clay.cylinder(0.36))
    first, *others = sampled(60)
    modeller.begin(stroke([first]))
    for i, point in enumerate(others):
        given.clear()
        shown = modeller.move([point]).clay
        if given and i % 4 == 0:
            exact = jaxclay.deform(*given[0], tolerance=2e-5).clay
            assert jaxclay.contour_error(given[1].clay, exact) < MOVING
        modeller.work_ahead()
        assert jaxclay.contour_error(shown, modeller.move([]).clay) < 2 * STEP


def test_a_refused_step_is_told_though_what_is_shown_is_certified(modeller, monkeypatch):
    modeller.begin(stroke([(0.6, 0.38)]))
    modeller.move([(0.6, 0.355)])
    waiting = modeller.move([(0.6, 0.335)])  # a step ends here, and is not done yet
    assert waiting.certified
    with monkeypatch.context() as patch:
        patch.setattr(drawing, "is_certified", lambda *given: False)
        modeller.work_ahead()
    told = modeller.move([(0.6, 0.33)])
    assert told.certified
    assert "not pressed" in told.message
    assert modeller.move([(0.6, 0.325)]).message == ""


@pytest.mark.parametrize(
    "path",
    [[(0.5, 0.2)], [(0.5, 0.2), (0.5, 0.2)], [(0.2, 0.5), (0.8, 0.5)], [(2.0, 0.1), (3.0, 0.1)]],
)
def test_a_tool_that_does_not_move_or_reach_does_nothing(modeller, path):
    before = modeller.clay
    modeller.draw(stroke(path))
    assert modeller.clay is before
    assert modeller.undoable == 0


def test_undo_and_redo_go_by_strokes_and_give_the_exact_contour(drawn):
    shapes = [drawn.clay]
    for _ in range(2):
        shapes.append(drawn.undo().clay)
    assert drawn.undoable == 0
    assert shapes[2].heights.tobytes() == Clay.cylinder(0.36).heights.tobytes()
    assert drawn.redo().clay is shapes[1]
    assert drawn.redo().clay is shapes[0]
    assert drawn.redo().clay is shapes[0]


def test_reset_and_opening_can_be_undone(modeller):
    modeller.draw(stroke())
    worked = modeller.clay
    assert modeller.reset().clay.height == 1.0
    assert modeller.undo().clay is worked
    modeller.open(STARTS["cone"]())
    assert modeller.undo().clay is worked


def test_escape_takes_the_stroke_back(modeller):
    before = modeller.clay
    modeller.begin(stroke(DRAG[:2]))
    assert modeller.move(DRAG[2:3]).clay is not before
    assert modeller.cancel().clay is before
    assert not modeller.drawing
    assert modeller.undoable == 0


def test_a_piece_replays_exactly_from_its_text(drawn):
    piece = piece_of_json(piece_to_json(drawn.piece))
    assert len(piece.strokes) == 2
    again = replay(piece)
    for name in ("heights", "thickness", "material", "edges"):
        np.testing.assert_array_equal(getattr(again.clay, name), getattr(drawn.clay, name))
    opened = Modeller(piece)
    np.testing.assert_array_equal(opened.clay.heights, drawn.clay.heights)
    opened.draw(stroke([(0.3, 0.4), (0.3, 0.33)]))
    assert len(opened.piece.strokes) == 3


def test_smoothing_evens_the_contour_and_keeps_volume_and_far_clay(modeller):
    modeller.draw(stroke([(0.6, 0.4), (0.6, 0.3)]))
    before = modeller.clay

    def roughness(clay):
        y = np.linspace(0.45, 0.75, 300)
        return np.abs(np.diff(clay.radius_at(y), 2)).sum()

    reading = modeller.draw(stroke([(0.5, 0.36), (0.7, 0.36)], "smooth"))
    assert reading.certified
    assert roughness(modeller.clay) < 0.8 * roughness(before)
    assert modeller.clay.r0 == before.r0
    far = np.linspace(0.02, 0.2, 10)
    np.testing.assert_allclose(modeller.clay.radius_at(far), before.radius_at(far), atol=3e-3)


def test_a_refused_solve_keeps_the_clay_and_the_stroke_goes_on(modeller, monkeypatch):
    answers = iter([False, True])
    certified = drawing.is_certified
    monkeypatch.setattr(
        drawing, "is_certified", lambda *given: next(answers, True) and certified(*given)
    )
    before = modeller.clay
    modeller.begin(stroke([(0.6, 0.36)]))
    refused = modeller.move([(0.6, 0.341)])
    assert not refused.certified
    assert "not pressed" in refused.message
    assert refused.clay is before
    assert modeller.move([(0.6, 0.3)]).certified
    assert modeller.end().clay is not before


def test_nothing_is_compiled_by_strokes_once_all_is_ready(ready):
    before = program.whole._cache_size()
    for name in ("cone", "teapot"):
        modeller = Modeller(STARTS[name](), jaxclay.Material.from_snake_units(mu=0.5, alpha=20))
        unit = float(modeller.clay.unit)
        path = [(0.5 * unit, unit), (0.5 * unit, 0.3 * unit), (0.8 * unit, 0.3 * unit)]
        modeller.draw(Stroke("left", 0.3 * unit, 0.1 * unit, path))
        modeller.draw(Stroke("left", 0.3 * unit, 0.1 * unit, path, "smooth"))
    assert program.whole._cache_size() == before


@pytest.mark.parametrize("scheme", ["slices", pytest.param("paper", marks=pytest.mark.slow)])
def test_slices_of_ones_own_choice(ready, scheme):
    modeller = Modeller(Clay.cylinder(0.36))
    modeller.solver = Solver(scheme=scheme, slices=64)
    reading = modeller.draw(stroke([(0.6, 0.4), (0.6, 0.33)]))
    assert reading.certified
    assert modeller.clay.slices == 64
    assert replay(modeller.piece).clay.heights.tobytes() == modeller.clay.heights.tobytes()


def test_a_cap_on_slices_is_said_where_the_tolerance_is_not_met(ready):
    modeller = Modeller(Clay.cylinder(0.36), jaxclay.Material.from_snake_units())
    modeller.solver = Solver(most=64)
    reading = modeller.draw(stroke([(0.6, 0.4), (0.6, 0.25)]))
    assert reading.certified
    assert "tolerance was not met on 64 slices" in reading.message


def test_what_cannot_be_drawn_is_refused_and_the_piece_kept(modeller):
    before = modeller.clay
    for path in ([(0.5, 0.4)] * 20_001,):
        with pytest.raises(ValueError, match="at most 20000 points"):
            modeller.draw(stroke(path))
    with pytest.raises(ValueError, match="method must be one of newton"):
        modeller.draw(stroke(solver=Solver(method="lattice")))
    with pytest.raises(ValueError, match="no stroke is under way"):
        modeller.move([(0.5, 0.4)])
    modeller.begin(stroke([(0.5, 0.5)]))
    with pytest.raises(ValueError, match="under way"):
        modeller.begin(stroke([(0.5, 0.5)]))
    with pytest.raises(ValueError, match="finite"):
        modeller.move([(float("nan"), 0.2)])
    modeller.cancel()
    assert modeller.clay is before


def test_a_target_is_met_as_far_as_the_areas_agree(modeller):
    assert modeller.match() is None
    modeller.target = Clay.cylinder(0.36)
    assert modeller.match() == 0
    modeller.target = Clay.cylinder(0.4)
    assert modeller.match() == pytest.approx(0.1)


def test_a_material_that_smoothing_moves_by_itself_slumps(modeller):
    assert modeller.slump() < 1e-3
    modeller.material = jaxclay.Material.from_snake_units(mu=0.1, alpha=2000)
    assert modeller.slump() > 0.1


def test_history_is_bounded_and_what_is_left_still_replays(ready, monkeypatch):
    monkeypatch.setattr(modelling, "KEPT", 3)
    modeller = Modeller(Clay.cylinder(0.36))
    for i in range(6):
        height = 0.2 + 0.1 * i
        modeller.draw(stroke([(height, 0.4), (height, 0.345)]))
    assert len(modeller.piece.strokes) <= 3
    assert modeller.undoable == 3
    assert replay(modeller.piece).clay.heights.tobytes() == modeller.clay.heights.tobytes()


def test_random_squashes_leave_r0_and_the_lower_bound_alone(ready):
    """Few of those of scripts/bench studio."""
    rng = np.random.default_rng(4)
    modeller = Modeller(Clay.cylinder(0.36))
    r0 = float(modeller.clay.r0)
    for _ in range(12):
        tall = float(modeller.clay.height)
        height = rng.uniform(0, tall)
        radius = float(modeller.clay.radius_at(height)) * rng.uniform(0.7, 0.97)
        before = modeller.clay
        modeller.draw(stroke([(height, radius + 0.01), (height, radius)]))
        assert float(modeller.clay.r0) == r0
        stretch = np.diff(modeller.clay.heights) / np.diff(before.height_at(modeller.clay.material))
        assert stretch.min() >= 0.05**3


def test_a_piece_of_a_foreign_solver_is_refused_when_replayed(drawn):
    foreign = dataclasses.replace(drawn.piece.strokes[0], solver=Solver(slices=1000))
    piece = dataclasses.replace(drawn.piece, strokes=(foreign,))
    assert isinstance(piece, Piece)
    with pytest.raises(ValueError, match="slices must be one of"):
        replay(piece)
