"""What "slices" refuses, and that no argument is ignored in silence."""

import numpy as np
import pytest
from scenes import MIDDLE, REFERENCE, SNAKE

from jaxclay import Clay, Material, Squash, deform, minimize, pose
from jaxclay.schemes.slices.posing import counted

CYLINDER = Clay.cylinder(slices=4)
BAD_NODES = {
    "out of order": ([0, 0.5, 0.4, 0.8, 1], "must increase"),
    "twice": ([0, 0.4, 0.4, 0.8, 1], "must increase"),
    "below 0": ([-0.1, 0.3, 0.5, 0.8, 1], "between 0 and 1, got -0.1"),
    "above 1": ([0, 0.3, 0.5, 0.8, 1.2], "between 0 and 1, got 1.2"),
    "from elsewhere": ([0.1, 0.3, 0.5, 0.8, 1], "from 0 to 1, got 0.1"),
    "to elsewhere": ([0, 0.3, 0.5, 0.8, 0.9], "from 0 to 1, got 0 to 0.9"),
    "nan": ([0, 0.3, np.nan, 0.8, 1], "nan"),
    "two-dimensional": ([[0, 0.3, 0.5, 0.8, 1]], "shape"),
}


@pytest.mark.parametrize("name", BAD_NODES)
def test_bad_nodes_are_named(name):
    nodes, message = BAD_NODES[name]
    with pytest.raises(ValueError, match=message):
        CYLINDER.resliced(nodes)
    with pytest.raises(ValueError, match=f"material.*{message}"):
        Clay(CYLINDER.heights, CYLINDER.thickness, 0.5, 1.0, nodes)


def test_nodes_and_edges_that_do_not_fit():
    heights, thickness = CYLINDER.heights, CYLINDER.thickness
    for nodes in ([0, 0.3, 0.6, 1], [0, 0.1, 0.2, 0.3, 0.4, 1]):
        with pytest.raises(ValueError, match="material must hold 5 nodes"):
            Clay(heights, thickness, 0.5, 1.0, nodes)
    for edges, message in (
        ([[0.3, 0.4]], "no.* at u = 0.3|none at u"),
        ([[0.5, -0.4]], "radius of an edge must be positive"),
        ([[0.75, 0.4], [0.25, 0.4]], "order"),
        ([0.5, 0.4], "rows"),
    ):
        with pytest.raises(ValueError, match=message):
            Clay(heights, thickness, 0.5, 1.0, edges=edges)
    for few in (2, [0, 0.5, 1], 24.0, "many", True):
        with pytest.raises(ValueError, match=r"slices|nodes"):
            CYLINDER.resliced(few)


@pytest.mark.parametrize(
    ("squash", "least"), [(REFERENCE, 6), (MIDDLE, 10), (Squash(0.4, 2.0, 0.45), 6)]
)
def test_too_few_slices(squash, least):
    for slices in range(3, least):
        for call in (pose, deform):
            with pytest.raises(ValueError, match=f"{slices} slices are too few.*needs {least}"):
                call(Clay.cylinder(), squash, SNAKE, slices=slices)
    assert pose(Clay.cylinder(), squash, SNAKE, slices=least).slices == least
    with pytest.raises(ValueError, match="too few"):
        pose(Clay.cylinder(slices=least - 1), squash, SNAKE)


@pytest.mark.parametrize(
    ("squash", "counts", "message"),
    [
        (MIDDLE, (0, 2, 30), "some clay below the tool, got 0"),
        (MIDDLE, (10, 2, 0), "some clay above the tool, got 0"),
        (REFERENCE, (4, 4, 24), "no clay below the tool, got 4"),
        (Squash(0.4, 2.0, 0.45), (8, 4, 4), "no clay above the tool, got 4"),
        (MIDDLE, (8, 1, 8), "under the tool must be a whole number of at least 2"),
        (MIDDLE, (1, 5, 18), "below the tool must be a whole number of at least 2"),
        (MIDDLE, (8, 4), "below, under, above"),
        (MIDDLE, (8, 4, 4, 4), "below, under, above"),
        (MIDDLE, (-1, 4, 4), "below the tool must be a whole number"),
        (MIDDLE, (8.0, 4, 4), "below the tool must be a whole number"),
        (MIDDLE, (8, True, 4), "under the tool must be a whole number"),
    ],
)
def test_counts_that_do_not_fit(squash, counts, message):
    for call in (pose, deform):
        with pytest.raises(ValueError, match=message):
            call(Clay.cylinder(), squash, SNAKE, slices=counts)


@pytest.mark.parametrize("slices", [128.0, 96.5, "many", True, np.float64(64), 2, 0, -5, np.nan])
@pytest.mark.parametrize("scheme", ["slices", "paper"])
def test_slices_must_be_whole_numbers(slices, scheme):
    for call in (pose, deform):
        with pytest.raises(ValueError, match="slices"):
            call(Clay.cylinder(), MIDDLE, SNAKE, scheme=scheme, slices=slices)


def test_whole_numbers_of_numpy():
    clay = Clay.cylinder()
    for slices in (np.int64(24), np.int32(24), np.uint8(24)):
        assert pose(clay, MIDDLE, SNAKE, slices=slices).slices == 24
        assert clay.resliced(slices).clay.slices == 24
    assert pose(clay, MIDDLE, SNAKE, slices=tuple(np.array([9, 5, 10]))).slices == 24
    assert counted(np.int64(64)) == (64, None)
    problem = pose(clay, MIDDLE, SNAKE, slices=np.int64(64))
    assert problem.slices == 64


FOREIGN = [
    (pose, {"elements": 16, "degree": 99}, "degree=99|elements=16"),
    (pose, {"elements": 16}, "elements=16 belongs to scheme"),
    (pose, {"degree": 5}, "degree=5 belongs to scheme"),
    (pose, {"scheme": "paper", "elements": 8}, "elements=8 belongs to scheme"),
    (pose, {"scheme": "paper", "spacing": "equal"}, "spacing='equal' belongs to scheme"),
    (pose, {"scheme": "spline", "slices": 64}, "slices=64 belongs to scheme"),
    (pose, {"scheme": "spline", "spacing": "placed"}, "spacing='placed' belongs to scheme"),
    (pose, {"scheme": "splines"}, "unknown scheme 'splines'"),
    (pose, {"spacing": "even"}, "unknown spacing 'even'"),
    (deform, {"scheme": "paper", "spacing": "equal"}, "spacing='equal' belongs to scheme"),
    (deform, {"scheme": "slices", "degree": 4}, "degree=4 belongs to scheme"),
    (deform, {"degree": 4}, "degree=4 belongs to scheme"),
    (deform, {"elements": 8}, "elements=8 belongs to scheme"),
    (deform, {"scheme": "spline", "slices": 64}, "slices=64 belongs to scheme"),
    (deform, {"scheme": "spline", "slices": 64, "tolerance": 1e-3}, "slices=64"),
    (deform, {"scheme": "paper", "tolerance": 1e-3}, "tolerance=0.001 belongs to scheme"),
    (deform, {"tolerance": 1e-14}, "tolerance must lie between"),
    (deform, {"tolerance": 1e-3, "slices": 64}, "slices=64"),
    (deform, {"tolerance": 1e-3, "spacing": "equal"}, "spacing='equal'"),
    (deform, {"scheme": "slices", "slices": "auto"}, "auto|slices"),
    (deform, {"spacing": "even"}, "unknown spacing 'even'"),
    (deform, {"scheme": "paper", "slices": (8, 4, 4)}, "slices must be a whole number"),
    (pose, {"scheme": "paper", "slices": (8, 4, 4)}, "slices must be a whole number"),
    (deform, {"step": 1e-3}, "newton has no setting 'step'"),
    (deform, {"method": "magic"}, "unknown method 'magic'"),
]


@pytest.mark.parametrize(("call", "arguments", "message"), FOREIGN)
def test_arguments_of_other_schemes_are_errors(call, arguments, message):
    with pytest.raises(ValueError, match=message):
        call(Clay.cylinder(), MIDDLE, SNAKE, **arguments)


def test_bad_settings_are_found_before_any_solve():
    for settings in ({"max_iterations": 0}, {"tolerance_of": 1}, {"smallest_step": 1e-9}):
        with pytest.raises(ValueError, match=r"newton has no setting|max_iterations"):
            deform(Clay.cylinder(), MIDDLE, SNAKE, slices=32, **settings)


def test_counts_are_what_was_asked_for():
    for squash, counts in ((MIDDLE, (9, 5, 10)), (REFERENCE, (0, 8, 16)), (MIDDLE, (4, 2, 4))):
        for spacing in ("placed", "equal", None):
            problem = pose(Clay.cylinder(), squash, SNAKE, slices=counts, spacing=spacing)
            u, band = problem.rest.material, problem.band
            assert (u[[0, -1]] == [0, 1]).all()
            assert (np.diff(u) > 0).all()
            assert u[counts[0]] == band.lower
            assert u[counts[0] + counts[1]] == band.upper
            assert problem.slices == sum(counts)
            if spacing == "equal":
                for part in np.split(u, [counts[0], counts[0] + counts[1]]):
                    np.testing.assert_allclose(np.diff(part, 2), 0, atol=1e-12)


def test_unequal_slices_and_the_papers_scheme():
    unequal = Clay.cylinder().resliced(np.linspace(0, 1, 25) ** 1.2).clay
    for call in (pose, deform):
        with pytest.raises(ValueError, match=r"unequal volume.*give slices=24.*resliced\(24\)"):
            call(unequal, MIDDLE, SNAKE, scheme="paper")
    assert pose(unequal, MIDDLE, SNAKE, scheme="paper", slices=24).slices == 24
    assert pose(unequal.resliced(24).clay, MIDDLE, SNAKE, scheme="paper").slices == 24
    assert pose(unequal, MIDDLE, SNAKE).slices == 24


def test_places_outside_the_clay():
    clay = pose(Clay.cylinder(), MIDDLE, SNAKE, slices=24).clay
    for call, value in ((clay.height_at, 1.1), (clay.material_at, -0.1), (clay.radius_at, 1.2)):
        with pytest.raises(ValueError, match=f"between 0 and 1, got {value}"):
            call(value)


def test_a_start_of_another_size():
    problem = pose(Clay.cylinder(), MIDDLE, Material(mu=0.5), slices=24)
    with pytest.raises(ValueError, match="25 nodes"):
        minimize(problem, start=np.linspace(0, 1, 33))
