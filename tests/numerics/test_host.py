"""How the package meets its host: JAX's float64 flag, compilation, imports, warnings."""

import ast
import subprocess
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scenes import REFERENCE, SNAKE, compilations, cylinder_problem

import jaxclay
from jaxclay import Clay, Material, Squash, deform, minimize, pose, rough_shape

PACKAGE = Path(jaxclay.__file__).parent


def leaves_of(*trees):
    return [np.asarray(leaf) for leaf in jax.tree.leaves(trees)]


@pytest.mark.core
@pytest.mark.parametrize("flag", [False, True])
def test_host_calls_give_numpy_float64_whatever_the_flag(flag):
    with jax.enable_x64(flag):
        problem = pose(Clay.cylinder(), REFERENCE, SNAKE, "paper")
        solution = minimize(problem)
        results = problem, rough_shape(problem), solution
        energy = jaxclay.total_energy(problem, solution.heights)
    assert all(not isinstance(leaf, jax.Array) for leaf in jax.tree.leaves(results))
    floats = [leaf for leaf in leaves_of(results, energy) if leaf.dtype.kind == "f"]
    assert len(floats) > 20
    assert all(leaf.dtype == np.float64 for leaf in floats)
    # The answer of a float32 solve would be 1e-7 off.
    assert solution.energy == pytest.approx(0.073727958970178, abs=1e-14)


def of_radius(function):
    """A function of the tool's radius that calls one public function."""
    problem = cylinder_problem()

    def call(radius):
        squash = Squash(0.0, 0.3, radius)
        if function == "pose":
            return pose(Clay.cylinder(), squash, SNAKE, "paper").shift[3]
        if function == "deform":
            return deform(Clay.cylinder(), squash, SNAKE, scheme="paper").energy
        lifted = jax.tree.map(lambda leaf: leaf * (radius / radius), problem)
        if function == "rough_shape":
            return rough_shape(lifted).heights[20]
        return minimize(lifted).energy

    return call


def scanned(call):
    return lambda radius: jax.lax.scan(lambda _, x: (_, call(x)), None, radius[None])[1]


TRANSFORMS = {
    "jit": jax.jit,
    "grad": jax.grad,
    "vmap": lambda call: lambda radius: jax.vmap(call)(radius[None]),
    "scan": scanned,
}


@pytest.mark.parametrize("function", ["pose", "rough_shape", "minimize", "deform"])
@pytest.mark.parametrize("transform", TRANSFORMS)
def test_inside_a_transformation_the_flag_must_be_on(function, transform):
    call = TRANSFORMS[transform](of_radius(function))
    with jax.enable_x64(False), pytest.raises(TypeError, match="jax_enable_x64"):
        call(jnp.asarray(0.4, jnp.float32))


def solved(radius, mu):
    solution = deform(
        Clay.cylinder(), Squash(0.0, 0.3, radius), Material(1.0, mu, 0.01, 1e-5), scheme="paper"
    )
    return solution.heights, solution.energy, solution.status_code


def test_deform_can_be_compiled_and_mapped():
    radii, mus = np.array([0.38, 0.42, 0.55]), np.array([0.3, 1.0, 0.5])
    with jax.enable_x64(True):
        mapped = jax.tree.map(np.asarray, jax.jit(jax.vmap(solved))(radii, mus))
    for j, (radius, mu) in enumerate(zip(radii, mus, strict=True)):
        heights, energy, code = solved(radius, mu)
        assert mapped[2][j] == code == jaxclay.Status.CONVERGED
        np.testing.assert_allclose(mapped[0][j], heights, atol=1e-8)
        assert mapped[1][j] == pytest.approx(energy, rel=1e-11)


def test_new_values_compile_nothing():
    jax.clear_caches()  # what other tests have compiled would not be counted
    log = compilations()
    clay = Clay.cylinder(slices=8)
    for method in ("newton", "greedy"):
        deform(clay, Squash(0.0, 0.5, 0.4), Material(), method, scheme="paper")
    assert len(log) >= 3  # the counter counts: pose and two methods
    log.clear()
    problem = pose(clay, Squash(0.0, 0.5, 0.4), Material(), "paper")
    start = minimize(problem).heights
    minimize(problem, start=start)
    log.clear()
    cone, single = Clay.from_profile([0, 1], [1, 2], 8), np.float32(1)
    scenes = [
        (Clay.cylinder(1, 2, 8), Squash(0.3, 0.9, 0.9), Material(2, 0.5, 0.1, 0.01)),
        (cone, Squash(0, 0.4, 1.2, True), Material.from_snake_units(mu=1)),
        (Clay.cylinder(slices=8), Squash(0 * single, 1, 0.45), Material(k=1, mu=single)),
    ]
    for clay, squash, material in scenes:
        deform(clay, squash, material, scheme="paper")
        minimize(pose(clay, squash, material, "paper"), max_iterations=50, tolerance=1e-11)
        deform(clay, squash, material, "greedy", step=1e-4, threshold=2, scheme="paper")
    minimize(problem, start=start * (1 + 1e-3 * np.linspace(0, 1, 9)))
    assert log == []


def run_python(code, *options):
    return subprocess.run(
        [sys.executable, *options, "-c", code],
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip


@pytest.mark.core
def test_import_is_light():
    code = (
        "import sys, jaxclay\n"
        "heavy = ['jaxopt', 'optax', 'matplotlib', 'pandas', 'jaxclay.experiments']\n"
        "heavy += ['jaxclay.files.plots']\n"
        "print([name for name in heavy if name in sys.modules])"
    )
    result = run_python(code)
    assert result.returncode == 0, result.stderr
    assert result.stdout.strip() == "[]"


@pytest.mark.core
def test_no_warning_escapes_and_no_filter_is_left_behind():
    code = (
        "import warnings\n"
        "before = None\n"
        "import jax, numpy\n"
        "before = list(warnings.filters)\n"
        "import jaxclay\n"
        "clay = jaxclay.Clay.cylinder(slices=8)\n"
        "squash = jaxclay.Squash(0, 0.5, 0.4)\n"
        "jaxclay.deform(clay, squash, jaxclay.Material(), 'lbfgs')\n"
        "assert warnings.filters == before, warnings.filters\n"
    )
    result = run_python(code, "-W", "error")
    assert result.returncode == 0, result.stderr


def test_only_jaxopts_warning_is_filtered():
    rooms = ("numerics", "clay", "model", "schemes", "methods", "solve")
    for path in (path for room in rooms for path in PACKAGE.glob(f"{room}/**/*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            name = getattr(getattr(node, "func", None), "attr", "")
            assert name != "simplefilter", path
            if name == "filterwarnings":
                assert "JAXopt is no longer maintained" in ast.unparse(node), path


@pytest.mark.parametrize(
    ("bottom", "top"), [(5.0, 6.0), (0.5, 0.501)], ids=["above the clay", "between two nodes"]
)
def test_what_the_host_refuses_is_infeasible_inside_jit(bottom, top):
    """Nobody can raise there, so the status has to say it."""
    clay, material = jaxclay.Clay.cylinder(slices=64), jaxclay.Material.from_snake_units()
    with pytest.raises(ValueError, match="band"):
        jaxclay.deform(clay, jaxclay.Squash(bottom, top, 0.4), material, scheme="paper")

    def code(top):
        return jaxclay.deform(
            clay, jaxclay.Squash(bottom, top, 0.4), material, scheme="paper"
        ).status_code

    with jax.enable_x64(True):
        assert jaxclay.Status(int(jax.jit(code)(top))) is jaxclay.Status.INFEASIBLE
