import numpy as np
import oracles
import pytest
from scenes import MIDDLE, PRINTED, REFERENCE, SNAKE, cylinder_problem, population_problems
from scipy import optimize

import jaxclay
from jaxclay import METHODS, Material, Squash, Status, minimize, rough_shape


def test_newton_is_certified_on_the_random_population():
    refused = []
    for number, problem in enumerate(population_problems(40, seed=1)):
        solution = minimize(problem)
        if solution.status is not Status.CONVERGED or not solution.certificate.accepted:
            refused.append((number, str(solution.status), float(solution.certificate.decrement)))
    assert refused == []


def test_newton_equals_the_closed_form_without_smoothing():
    for problem in population_problems(20, seed=2, smoothing=False):
        solution = minimize(problem).raise_for_status()
        exact = rough_shape(problem, discrete=True).heights
        np.testing.assert_allclose(solution.heights, exact, rtol=0, atol=1e-7)


@pytest.mark.parametrize("mu", [0.0, 1e-14, 1e-10, 1e-6])
@pytest.mark.parametrize("squash", [REFERENCE, MIDDLE, Squash(0, 0.3, 0.6, True)])
def test_newton_needs_no_friction(mu, squash):
    bare = minimize(cylinder_problem(squash, Material(mu=mu, alpha=0.0, beta=0.0)))
    exact = rough_shape(bare.problem, discrete=True).heights
    np.testing.assert_allclose(bare.raise_for_status().heights, exact, rtol=0, atol=1e-7)
    for material in (Material.from_snake_units(mu=mu), Material(mu=mu, alpha=0.1, beta=1e-3)):
        assert minimize(cylinder_problem(squash, material)).status is Status.CONVERGED


@pytest.mark.parametrize(
    ("squash", "mu"),
    [(Squash(0, 0.5, 0.3), 3.0), (Squash(0, 0.75, 0.2, True), 3.0), (Squash(0.3, 0.6, 0.3), 9.0)],
)
def test_newton_equals_the_closed_form_on_the_floor(squash, mu):
    problem = cylinder_problem(squash, Material(mu=mu, alpha=0.0, beta=0.0))
    exact = rough_shape(problem, discrete=True)
    assert exact.floored
    solution = minimize(problem).raise_for_status()
    np.testing.assert_allclose(solution.heights, exact.heights, rtol=0, atol=1e-7)


def smooth_energy(Y, Y0, r0, k, alpha, beta):
    """Section 4 without friction; takes complex heights for the gradient."""
    h = 1 / (len(Y) - 1)
    t = np.diff(Y)
    # A line search may try thicknesses below zero, where no radius exists.
    X = r0 * np.sqrt(h / np.where(t.real > 0.02 * h, t, 0.02 * h))
    strain = k / 2 * np.sum((t / np.diff(Y0) - 1) ** 2)
    tension = alpha / h**2 * (np.sum(np.diff(X) ** 2) + np.sum(t**2))
    bending = beta / h**4 * (np.sum(np.diff(X, 2) ** 2) + np.sum(np.diff(Y, 2) ** 2))
    return h * (strain + tension + bending)


def scipy_minimum(problem):
    """E_total by SLSQP in p, q >= 0 with Y = Y0 + p - q, which makes friction linear."""
    constants = oracles.constants_of(problem)
    mu, Y0 = constants.pop("mu"), constants["Y0"]
    free = np.flatnonzero(problem.free)
    base, m = Y0 + np.asarray(problem.shift), len(free)

    def heights(z):
        Y = base.astype(z.dtype)
        Y[free] += z[:m] - z[m:]
        return Y

    def energy(z):
        return smooth_energy(heights(z), **constants) + mu / (len(Y0) - 1) * np.sum(z)

    def gradient(z):  # by complex step, exact to rounding
        return np.array([energy(z + 1e-30j * e).imag / 1e-30 for e in np.eye(2 * m)])

    start = rough_shape(problem).heights[free] - base[free]
    z = np.concatenate([np.maximum(start, 0), np.maximum(-start, 0)])
    result = optimize.minimize(
        energy, z, jac=gradient, method="SLSQP", bounds=[(0, None)] * (2 * m),
        options={"maxiter": 500, "ftol": 1e-14},
    )  # fmt: skip
    return heights(result.x), result.fun + mu / (len(Y0) - 1) * fixed_shifts(problem)


def fixed_shifts(problem):
    return np.sum(np.abs(np.asarray(problem.shift)[np.asarray(problem.fixed)]))


SMOOTHER = Material.from_snake_units(alpha=3.0, beta=10.0)


@pytest.mark.parametrize(
    ("squash", "material"),
    [(REFERENCE, SNAKE), (MIDDLE, SMOOTHER), (Squash(0, 0.25, 0.55), SMOOTHER)],
)
def test_newton_against_scipy(squash, material):
    problem = cylinder_problem(squash, material)
    solution = minimize(problem)
    heights, energy = scipy_minimum(problem)
    assert energy == pytest.approx(
        oracles.total_energy(heights, **oracles.constants_of(problem)), rel=1e-12
    )
    assert solution.energy <= energy + 1e-13
    assert solution.energy == pytest.approx(energy, abs=1e-9)
    np.testing.assert_allclose(solution.heights, heights, atol=1e-4)


@pytest.mark.core
def test_printed_reference_energies_of_the_model():
    # model.md, section 4: the minimum moves towards 2.55342 as n grows.
    solution = minimize(cylinder_problem(REFERENCE, PRINTED))
    assert solution.energy == pytest.approx(2.5366, abs=5e-5)


@pytest.mark.core
@pytest.mark.parametrize("method", METHODS)
def test_every_method_on_the_reference_scene(method):
    problem = cylinder_problem(REFERENCE, SNAKE)
    best = minimize(problem)
    solution = minimize(problem, method)
    rough = jaxclay.total_energy(problem, solution.rough.heights)
    gap = float(solution.energy - best.energy)
    assert gap >= -1e-15
    if method.startswith("greedy"):
        assert solution.status is Status.STALLED
        assert gap < (1e-6 if method == "greedy-refined" else 0.6 * (rough - best.energy))
    else:
        assert solution.status is Status.CONVERGED
        assert gap < 1e-12
        np.testing.assert_allclose(solution.heights, best.heights, atol=1e-6)
    expected = oracles.energy_terms(solution.heights, **oracles.constants_of(problem))
    for name, value in expected.items():
        assert getattr(solution.terms, name) == pytest.approx(value, rel=1e-9)
    assert solution.energy == pytest.approx(sum(expected.values()), rel=1e-12)


HARD = [
    (REFERENCE, PRINTED),
    (MIDDLE, PRINTED),
    (MIDDLE, Material.from_snake_units(mu=0.05)),
    (Squash(0, 0.3, 0.4, top_fixed=True), Material.from_snake_units(mu=0.1)),
    (Squash(0, 0.5, 0.3), Material.from_snake_units(mu=2.0, alpha=10.0, beta=10.0)),
    (Squash(0, 0.5, 0.3), Material(mu=3.0, alpha=0.0, beta=0.0)),
    (Squash(0, 0.2, 0.6), Material(alpha=0.5, beta=0.01)),
]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("limit", [5, 300])
def test_converged_means_certified_and_no_lower_minimum_nearby(method, limit):
    for squash, material in HARD:
        problem = cylinder_problem(squash, material)
        solution = minimize(problem, method, max_iterations=limit)
        assert solution.iterations <= limit
        assert (solution.status is Status.CONVERGED) == bool(solution.certificate.accepted)
        assert np.isfinite(solution.heights).all()
        best = float(minimize(problem).raise_for_status().energy)
        gap = (float(solution.energy) - best) / float(solution.certificate.energy_free)
        assert gap >= -1e-10
        if solution.status is Status.CONVERGED:
            assert gap <= 1e-9


def test_each_status_has_its_scene():
    reference = cylinder_problem(REFERENCE, SNAKE)
    huge = cylinder_problem(REFERENCE, Material(alpha=1e308))
    crushed = cylinder_problem(Squash(0, 0.99, 0.4, top_fixed=True), SNAKE)
    found = {
        "converged": minimize(reference),
        "stalled": minimize(reference, "greedy"),
        "iteration limit": minimize(reference, max_iterations=2),
        "non-finite": minimize(huge),
        "infeasible": minimize(crushed),
    }
    for name, solution in found.items():
        assert str(solution.status) == name
        assert name in solution.message
        assert np.isfinite(solution.heights).all()
        if name == "converged":
            assert solution.raise_for_status() is solution
        else:
            assert not solution.certificate.accepted
            with pytest.raises(RuntimeError, match=name):
                solution.raise_for_status()


@pytest.mark.parametrize("method", METHODS)
def test_every_method_reports_what_cannot_be_solved(method):
    huge = minimize(cylinder_problem(REFERENCE, Material(alpha=1e308)), method)
    crushed = cylinder_problem(Squash(0, 0.99, 0.4, top_fixed=True), SNAKE)
    assert huge.status is Status.NON_FINITE
    assert minimize(crushed, method).status is Status.INFEASIBLE


@pytest.mark.parametrize(
    ("method", "settings", "message"),
    [
        ("magic", {}, "unknown method 'magic': choose from newton, lbfgs"),
        ("newton", {"step": 1e-3}, "newton has no setting 'step': it takes max_iterations"),
        ("greedy", {"step": -1.0}, "step must be between .*, got -1"),
        ("greedy", {"threshold": 0}, "threshold must be at least 1, got 0"),
        ("greedy-refined", {"smallest_step": 0.1}, "smallest_step must be between"),
        ("newton", {"max_iterations": 0}, "max_iterations must be at least 1, got 0"),
        ("lbfgs", {"tolerance": float("nan")}, "tolerance must be between .*, got nan"),
    ],
)
def test_bad_methods_and_settings_are_named(method, settings, message):
    with pytest.raises(ValueError, match=message):
        minimize(cylinder_problem(REFERENCE, SNAKE), method, **settings)


def swapped(heights):
    return heights[np.r_[:20, 21, 20, 22:65]]


def thinned(heights):
    return np.where(np.arange(65) == 40, heights[41] - 0.01 / 64, heights)


BAD_STARTS = {
    "length": (lambda y: y[:-1], r"one height for each of 65 nodes: got shape \(64,\)"),
    "order": (swapped, "start must be finite and increase"),
    "nan": (lambda y: np.where(y > 0.9, np.nan, y), "start must be finite"),
    "floor": (thinned, "slice 40 .* at least 0.05"),
}


@pytest.mark.parametrize("name", BAD_STARTS)
def test_bad_starts_are_named(name):
    spoil, message = BAD_STARTS[name]
    problem = cylinder_problem(REFERENCE, SNAKE)
    with pytest.raises(ValueError, match=message):
        minimize(problem, start=spoil(rough_shape(problem).heights))


def test_the_start_does_not_change_the_minimum():
    problem = cylinder_problem(REFERENCE, SNAKE)
    best = minimize(problem)
    lifted = best.heights + 0.02 * (np.arange(65) - 12).clip(0) / 52
    np.testing.assert_allclose(minimize(problem, start=lifted).heights, best.heights, atol=1e-7)


@pytest.mark.parametrize("slices", [50, 100])
def test_a_start_exactly_on_the_floor_is_allowed(slices):
    """The lower bound is compared in float64: in float32 it lies above itself half the time."""
    clay = jaxclay.Clay.cylinder(radius=0.5, height=1.3, slices=slices)
    for floor in (0.03, 0.05, 0.07, 0.11):
        material = jaxclay.Material(mu=4.0, alpha=0.0, beta=0.0, floor=floor)
        problem = jaxclay.pose(clay, jaxclay.Squash(0.0, 0.4, 0.3), material, "paper")
        rough = jaxclay.rough_shape(problem, discrete=True)
        assert rough.floored
        again = jaxclay.minimize(problem, start=rough.heights)
        assert again.status is jaxclay.Status.CONVERGED
