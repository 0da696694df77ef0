"""The one clock: it times the call that a user makes, with exactly those settings, compiled."""

import jax
import numpy as np
import pytest
from scenes import compilations, cylinder_problem

import jaxclay

pytest.importorskip("pydantic")

from jaxclay.experiments import run
from jaxclay.experiments.contestants import prepare
from jaxclay.experiments.solving import clock

HEAD = """\
kind = "timing"
repeats = 3
scenes = [{ names = ["reference"] }]
"""


pytestmark = pytest.mark.usefixtures("nothing_kept")


@pytest.fixture
def timed(tmp_path):
    def of(text):
        path = tmp_path / "one.toml"
        path.write_text(HEAD + text)
        return run(path, tmp_path / "out")

    return of


def test_static_settings_compile_before_the_timed_runs(timed):
    """A lattice of 11 labels is another program than one of 7."""
    labels = "settings = { labels = [7, 11] }"
    table = timed(
        'discretisations = [{ scheme = "paper", slices = 16 }]\n'
        f'[[methods]]\nname = "lattice"\n{labels}\n'
    )
    assert (table.compile_s > 0.05).all()
    assert (table.solve_s_most < 0.5 * table.compile_s).all()
    assert len(table) == 2


def test_what_compiling_splines_took_is_said(timed):
    table = timed(
        'discretisations = [{ scheme = "spline", elements = 2 }]\n[[methods]]\nname = "newton"\n'
    )
    assert (table.compile_s > 1.0).all()
    assert (table.solve_s < 0.2 * table.compile_s).all()


def test_spline_solves_are_timed_with_the_settings_that_are_judged(timed):
    table = timed(
        'discretisations = [{ scheme = "spline", elements = 2 }]\n'
        '[[methods]]\nname = "newton"\nsettings = { max_iterations = [2, 200] }\n'
    ).set_index("iterations")
    clay = jaxclay.Clay.cylinder(0.5, slices=512)
    squash, material = jaxclay.Squash(0.0, 0.29296875, 0.4), jaxclay.Material.from_snake_units()
    problem = jaxclay.pose(clay, squash, material, "spline", elements=2)
    for settings in ({"max_iterations": 2}, {}):
        answer = jaxclay.minimize(problem, **settings)
        row = table.loc[int(answer.iterations)]
        assert row.energy == pytest.approx(float(answer.energy), rel=1e-9)


@pytest.mark.parametrize("method", ["newton", "greedy", "lattice"])
def test_the_timed_call_is_minimize_itself(method):
    """On more slices than 256 too, where newton was another once."""
    problem = cylinder_problem(slices=320 if method == "newton" else 32)
    ready = prepare(problem, method, {})
    answer, times = clock.timed(("test", method), ready.call, 2)
    there = jaxclay.minimize(problem, method)
    np.testing.assert_array_equal(ready.certified(answer).heights, there.heights)
    assert int(answer.iterations) == int(there.iterations)
    assert times.repeats >= 1


def test_a_call_in_which_jax_compiles_does_not_count():
    problem, calls = cylinder_problem(slices=24), []

    def call():
        if len(calls) in (0, 3):
            jax.clear_caches()
        calls.append(1)
        return jaxclay.minimize(problem)

    log = compilations()
    _, times = clock.timed("some program", call, 5)
    assert len(log) >= 2
    assert times.solve_s_most < times.compile_s
    assert len(calls) >= times.repeats + 2


def test_a_first_answer_has_nothing_compiled_and_nothing_kept(tmp_path):
    problem = cylinder_problem(slices=24)
    jaxclay.minimize(problem)
    before = jax.config.jax_enable_compilation_cache
    log = compilations()
    seconds = clock.first_answer("another", lambda: jaxclay.minimize(problem))
    assert log
    assert jax.config.jax_enable_compilation_cache == before
    _, warm, compiles = clock.clocked(lambda: jaxclay.minimize(problem))
    assert not compiles
    assert seconds > 10 * warm
