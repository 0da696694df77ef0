"""Every scheme gives what the interface says, in the shapes that it says."""

import jax
import numpy as np
import pytest
from scenes import MIDDLE, SNAKE

import jaxclay
from jaxclay.schemes.base import AnyProblem, Newtonian, lifted, no_forces

SCHEMES = ("slices", "paper", "spline")


@pytest.fixture(params=SCHEMES)
def problem(request):
    return jaxclay.pose(jaxclay.Clay.cylinder(slices=24), MIDDLE, SNAKE, request.param)


def newtonian(problem):
    return getattr(problem, "system", problem)


def test_every_scheme_has_every_member(problem):
    assert isinstance(problem, AnyProblem)
    assert isinstance(newtonian(problem), Newtonian)


def test_shapes_are_those_that_are_written(problem):
    system = newtonian(problem)
    (unknowns,) = problem.unknown_shape
    with jax.enable_x64(True):
        answer = jaxclay.minimize(problem)
        point = lifted(problem, answer.point)
        forces = no_forces(problem)
        step = 1e-3 * np.arange(unknowns) * np.asarray(system.free)
        assert np.shape(problem.free) == np.shape(problem.shift) == (unknowns,)
        places, slices = np.shape(forces.friction), np.shape(forces.floor)
        assert np.shape(system.friction_limit) == np.shape(point.shift) == places
        for value in (system.loose, system.floor, system.rest_thickness, system.slack(point)):
            assert np.shape(value) == slices
        assert np.shape(system.shift_change(step)) == places
        assert np.shape(system.thickness_change(step)) == slices
        assert np.shape(system.from_shift(forces.friction)) == (unknowns,)
        assert np.shape(system.from_thickness(forces.floor)) == (unknowns,)
        model = system.smooth_model(point)
        assert np.shape(model.value) == np.shape(system.kinks(point, 1e-3, np.zeros(slices))) == ()
        assert np.shape(model.gradient) == (unknowns,)
        at_places, at_slices = system.own_stiffness(model.bands)
        assert np.shape(at_places) == places
        assert np.shape(at_slices) == slices
        assert (np.asarray(at_slices) >= 0).all()
        # Where the displacement crosses zero in a span, the answer is on other splines.
        assert newtonian(answer.problem).admissible(answer.point)
        assert not system.admissible(system.moved(point, 1.0 * ~np.asarray(problem.free)))
        assert problem.free_smooth(point) == pytest.approx(float(model.value), rel=1e-12)


def test_forces_and_changes_are_each_others_transposes(problem):
    """What a force on displacements or thicknesses does to the unknowns, by its virtual work."""
    system, rng = newtonian(problem), np.random.default_rng(0)
    free = np.asarray(system.free, float)
    with jax.enable_x64(True):
        step = rng.normal(size=problem.unknown_shape) * free
        for there, back in (
            (system.shift_change, system.from_shift),
            (system.thickness_change, system.from_thickness),
        ):
            changes = np.asarray(there(step))
            force = rng.normal(size=changes.shape)
            work = float(np.sum(force * changes))
            assert float(np.sum(np.asarray(back(force)) * step)) == pytest.approx(work, rel=1e-10)
