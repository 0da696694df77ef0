"""Clay squeezed to a thin wide lip at the bottom: the floor pushes hard, on fine slices."""

import dataclasses

import numpy as np
import pytest

from jaxclay import Clay, Material, Squash, Status, deform
from jaxclay.clay.contour import contour_error

STIFF = Material(alpha=0.01, beta=1e-4)
# Bottom, top and radius; the tool ends 0.0017 above the bottom, then leaves the lip to smoothing.
SQUASHES = (
    (0.605, 0.856, 0.332),
    (0.051, 0.173, 0.318),
    (0.042, 0.194, 0.227),
    (0.504, 0.803, 0.295),
    (0.057, 0.276, 0.413),
    (0.0017, 0.2286, 0.362),
    (0.257, 0.416, 0.348),
)


@pytest.fixture(scope="module")
def reference():
    clay = Clay.cylinder(radius=0.4)
    for squash in SQUASHES:
        answer = deform(clay, Squash(*squash), STIFF, slices=2048).raise_for_status()
        clay = answer.clay
    return clay


@pytest.mark.parametrize("tolerance", [1e-3, 1e-4])
def test_a_session_keeps_its_tolerance_through_a_lip(reference, tolerance):
    clay = Clay.cylinder(radius=0.4)
    widest = 0.0
    for squash in SQUASHES:
        answer = deform(clay, Squash(*squash), STIFF, tolerance=tolerance)
        assert answer.status is Status.CONVERGED, answer.message
        clay = answer.clay
        widest = max(widest, clay.radii.max())
    assert widest > 4  # ten times the cylinder's radius
    assert contour_error(clay, reference) <= 2 * tolerance


def test_slices_on_the_floor_are_certified_however_fine():
    # What a lip of radius 0.95 becomes: 1000 times the energy of other squashes, in bending.
    clay, material = Clay.cylinder(radius=0.4), Material.from_snake_units()
    for squash in ((0.05, 0.171, 0.318), (0.04, 0.192, 0.227), (0.052, 0.271, 0.183)):
        clay = deform(clay, Squash(*squash), material, tolerance=1e-3).clay
    answers = [
        deform(clay, Squash(0.0012, 0.228, 0.139), material, slices=n) for n in (512, 1024, 2048)
    ]
    for answer in answers:
        assert answer.status is Status.CONVERGED, answer.message
        slices = np.diff(answer.clay.heights) / np.diff(answer.problem.clay.heights)
        assert slices.min() == pytest.approx(material.floor, rel=1e-8)
        assert answer.certificate.on_floor > 1
    coarse, fine = (contour_error(a.clay, answers[-1].clay) for a in answers[:2])
    assert fine < coarse / 2 < 0.01


def test_an_error_that_nobody_knows_is_no_advice():
    answer = deform(Clay.cylinder(), Squash(0.0, 0.3, 0.45), Material(), tolerance=1e-2)
    unknown = dataclasses.replace(
        answer, error_estimate=np.inf, status_code=np.asarray(Status.UNRESOLVED.value)
    )
    assert "inf" not in unknown.message
    assert f"slices={answer.problem.slices}" in unknown.message
