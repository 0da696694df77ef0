"""The order of second-order slices, and what splines and the paper's sums say of the same."""

import dataclasses

import numpy as np
import pytest
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE

from jaxclay import Clay, Material, Squash, contour_error, deform

SCENES = {
    "reference": (REFERENCE, 1.0),
    "fig4a": (Squash(0, 0.3, 0.4), 1.0),
    "fig4b": (Squash(0, 0.3, 0.4), 0.1),
    "fig4c": (Squash(0, 0.3, 0.4, top_fixed=True), 0.1),
    "middle": (MIDDLE, 1.0),
}
NO_BENDING = Material(alpha=0.05, beta=0.0)


def solved(name, material, **how):
    squash, mu = SCENES[name]
    stuff = dataclasses.replace(material, mu=mu)
    return deform(Clay.cylinder(), squash, stuff, **how).raise_for_status()


def on_splines(name, material, elements, slices=1024):
    """The answer on splines, read off at the nodes of so many slices."""
    squash, mu = SCENES[name]
    stuff, clay = dataclasses.replace(material, mu=mu), Clay.cylinder(slices=slices)
    return deform(clay, squash, stuff, scheme="spline", elements=elements).raise_for_status()


def order(name, material, grids, finest):
    """Fitted order of the contour's error against the finest slices, and the errors."""
    best = solved(name, material, slices=finest).clay
    errors = [contour_error(solved(name, material, slices=n).clay, best) for n in grids]
    return -np.polyfit(np.log(grids), np.log(errors), 1)[0], errors


@pytest.mark.parametrize("material", [SNAKE, PRINTED], ids=["snake", "printed"])
@pytest.mark.parametrize("name", SCENES)
def test_the_contour_is_of_second_order(name, material):
    # Fewer grids scatter: where nodes come to lie is worth a third of an error.
    fitted, errors = order(name, material, (32, 64, 128, 256), 1024)
    assert fitted >= 1.7, errors
    assert errors[1] < 1e-3
    assert errors[2] < 2e-4
    assert errors[3] < 6e-5


@pytest.mark.parametrize("name", SCENES)
def test_the_order_without_bending(name):
    """Friction's trapezoid rule is of first order where the displacement changes its sign.

    So it does in fig4a and the middle scene; a node from an answer on many slices lies there.
    """
    fitted, errors = order(name, NO_BENDING, (32, 64, 128, 256), 1024)
    assert fitted >= 1.9, errors
    assert errors[3] < 2e-5


@pytest.mark.parametrize("name", ["reference", "fig4b", "fig4c"])
def test_slices_agree_with_splines(name):
    spline = on_splines(name, PRINTED, 16)
    for slices, most in ((64, 2.5e-4), (128, 6e-5), (256, 1.5e-5)):
        assert contour_error(solved(name, PRINTED, slices=slices).clay, spline.clay) < most


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_many_slices_agree_with_splines_as_printed(name):
    spline = on_splines(name, PRINTED, 64)
    assert contour_error(solved(name, PRINTED, slices=1024).clay, spline.clay) < 1e-5


@pytest.mark.slow
@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_many_slices_agree_with_splines_in_snake_units(name):
    """Layers of 1/64 of the clay need many spans, and many nodes to read them off at."""
    spline = on_splines(name, SNAKE, 256, 8192)
    assert contour_error(solved(name, SNAKE, slices=1024).clay, spline.clay) < 1e-5


def extrapolated(values):
    """The limit of three values on grids twice as fine each, with errors of order 1 and 2."""
    a, b, c = values
    return (a - 6 * b + 8 * c) / 3


@pytest.mark.slow
@pytest.mark.parametrize(("mu", "held"), [(1.0, False), (0.1, False), (0.1, True)])
def test_the_papers_sums_go_to_the_same_limit(mu, held):
    """The reference band, whose edge is a node of grids of 16 and more; the height at u = 3/4."""
    squash = Squash(0.0, 0.29296875, 0.4, top_fixed=held)
    material = Material(mu=mu)
    at = [
        float(deform(Clay.cylinder(slices=n), squash, material, scheme="paper").heights[3 * n // 4])
        for n in (32, 64, 128)
    ]
    slices = deform(Clay.cylinder(), squash, material, slices=256).raise_for_status().clay
    assert abs(at[2] - at[1]) > 5e-4
    assert extrapolated(at) == pytest.approx(float(slices.height_at(0.75)), abs=1e-4)
