"""Solvers from outside: they find newton's minima, and are certified like any method."""

import sys

import jax
import numpy as np
import pytest
import threadpoolctl
from scenes import MIDDLE, REFERENCE, SNAKE, cylinder_problem

import jaxclay
from jaxclay.cli.main import main
from jaxclay.experiments import run
from jaxclay.experiments.peers import PEERS, prepare

pytest.importorskip("matplotlib").use("Agg")
pytest.importorskip("pydantic")

from jaxclay.experiments import summary  # noqa: E402
from jaxclay.experiments.charts.shared import prepared  # noqa: E402

SMOOTH = [name for name, peer in PEERS.items() if not peer.move_only]
CONVEX = [name for name, peer in PEERS.items() if peer.move_only]
HELD = jaxclay.Squash(0.0, 0.3, 0.4, top_fixed=True)
DEEP = jaxclay.Squash(0.0, 0.3, 0.3)


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    """As the comparison does: threads of BLAS wait for each other on small matrices."""
    with threadpoolctl.threadpool_limits(1):
        yield


COMPARED = """\
kind = "timing"
repeats = 3
scenes = [{ names = ["reference"], units = ["snake", "printed", "move"] }]
discretisations = [{ scheme = "paper", slices = 32 }]
methods = [{ name = "newton" }, { name = "ipopt" }, { name = "clarabel" }, { name = "piqp" }]

[[parts]]

[[parts]]
ladder = true
scenes = [{ names = ["reference"] }]
"""


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """The reference scene on 32 slices, newton against three peers, ladders included."""
    jax.clear_caches()  # as in a process of its own: what is compiled has no seconds to tell
    folder = tmp_path_factory.mktemp("peers")
    (folder / "peers.toml").write_text(COMPARED)
    return run(folder / "peers.toml", folder / "out"), folder / "out"


def posed(squash, mu=1.0, alpha=0.0, beta=0.0):
    """On 32 slices; with alpha = beta = 0 it is E_move."""
    material = jaxclay.Material(k=1.0, mu=mu, alpha=alpha, beta=beta)
    return cylinder_problem(squash, material, slices=32)


MOVES = {
    "band at the bottom": posed(REFERENCE),
    "band in the middle": posed(MIDDLE),
    "held end": posed(HELD, mu=0.1),
    "slices on the floor": posed(DEEP, mu=10.0),
}
SHAPES = {
    "snake units": cylinder_problem(REFERENCE, SNAKE, slices=32),
    "held end": cylinder_problem(HELD, SNAKE, slices=32),
    "slices on the floor": posed(DEEP, mu=10.0, alpha=1e-5, beta=1e-9),
    "printed constants": cylinder_problem(REFERENCE, jaxclay.Material(), slices=32),
}


PLACED = {
    (place, units): jaxclay.pose(jaxclay.Clay.cylinder(), squash, material, slices=32)
    for place, squash in (("bottom", REFERENCE), ("middle", MIDDLE))
    for units, material in (("snake", SNAKE), ("move", jaxclay.Material(alpha=0.0, beta=0.0)))
}


def answer(name, problem, **limits):
    ready = prepare(name, problem, **limits)
    return ready.certify(ready.solve())


def least_stretch(solution):
    """Of a slice that can move: t over t0, which the floor bounds."""
    stretch = solution.clay.thickness / solution.problem.clay.thickness
    return stretch[solution.problem.loose].min()


@pytest.mark.parametrize("scene", MOVES)
@pytest.mark.parametrize("name", CONVEX)
def test_convex_solvers_agree_with_newton_on_e_move(name, scene):
    newton = jaxclay.minimize(MOVES[scene]).raise_for_status()
    peer = answer(name, MOVES[scene]).raise_for_status()
    np.testing.assert_allclose(peer.energy, newton.energy, rtol=1e-11)
    np.testing.assert_allclose(peer.heights, newton.heights, atol=1e-8)


@pytest.mark.parametrize("scene", SHAPES)
def test_ipopt_and_newton_find_the_same_certified_minimum(scene):
    newton = jaxclay.minimize(SHAPES[scene]).raise_for_status()
    peer = answer("ipopt", SHAPES[scene]).raise_for_status()
    assert peer.certificate.on_floor == newton.certificate.on_floor
    np.testing.assert_allclose(peer.energy, newton.energy, rtol=1e-11)
    np.testing.assert_allclose(peer.heights, newton.heights, atol=1e-7)


@pytest.mark.parametrize(
    ("name", "units", "place"),
    [("ipopt", "snake", place) for place in ("bottom", "middle")]
    + [("scipy-lbfgsb", "snake", place) for place in ("bottom", "middle")]
    + [(name, "move", place) for name in CONVEX for place in ("bottom", "middle")],
)
def test_peers_find_newtons_minimum_on_slices_of_unequal_volume(name, units, place):
    problem = PLACED[place, units]
    assert np.ptp(problem.sums.width) > 0.05
    newton = jaxclay.minimize(problem).raise_for_status()
    # Seconds that a busy machine takes are not what is looked at.
    peer = answer(name, problem, seconds=60.0).raise_for_status()
    gap = float(peer.energy - newton.energy) / float(newton.certificate.energy_free)
    assert abs(gap) < (1e-11 if units == "move" else 2e-10)
    np.testing.assert_allclose(peer.heights, newton.heights, atol=1e-6)


@pytest.mark.parametrize("place", ["bottom", "middle"])
def test_trust_constr_ends_beside_newtons_minimum_on_slices_of_unequal_volume(place):
    """By a rule of its own, where the certificate begins to refuse: rounding decides which."""
    problem = PLACED[place, "snake"]
    newton = jaxclay.minimize(problem).raise_for_status()
    peer = answer("scipy-trust-constr", problem, seconds=60.0)
    assert peer.status in (jaxclay.Status.CONVERGED, jaxclay.Status.STALLED)
    gap = float(peer.energy - newton.energy) / float(newton.certificate.energy_free)
    assert -1e-11 < gap < 1e-8
    np.testing.assert_allclose(peer.heights, newton.heights, atol=1e-5)


@pytest.mark.parametrize("name", SMOOTH)
def test_every_peer_certifies_the_reference_scene(name):
    newton = jaxclay.minimize(SHAPES["snake units"])
    peer = answer(name, SHAPES["snake units"]).raise_for_status()
    assert peer.method == name
    assert peer.iterations > 0
    np.testing.assert_allclose(peer.heights, newton.heights, atol=2e-6)


@pytest.mark.parametrize("name", SMOOTH)
def test_answers_lie_above_the_floor_and_above_the_minimum(name):
    problem = SHAPES["slices on the floor"]
    newton, peer = jaxclay.minimize(problem), answer(name, problem)
    assert least_stretch(peer) >= problem.material.floor - 1e-12
    assert peer.energy >= newton.energy - 1e-12 * newton.certificate.energy_free


@pytest.mark.parametrize("name", PEERS)
def test_a_peer_stopped_early_is_not_called_converged(name):
    peer = answer(name, MOVES["band in the middle"], max_iterations=2)
    assert peer.status is jaxclay.Status.ITERATION_LIMIT


def test_an_answer_below_the_floor_is_refused():
    peer = answer("clarabel", MOVES["slices on the floor"], tolerance=0.1)
    assert least_stretch(peer) < peer.problem.material.floor - 1e-4
    assert not peer.certificate.admissible
    assert peer.status is jaxclay.Status.STALLED


@pytest.mark.parametrize("name", ["scipy-lbfgsb", "scipy-trust-constr"])
def test_time_that_has_run_out_counts_as_a_limit(name):
    late = answer(name, SHAPES["snake units"], seconds=0.0)
    assert late.status is jaxclay.Status.ITERATION_LIMIT


@pytest.mark.parametrize("name", PEERS)
def test_a_solve_can_be_repeated(name):
    ready = prepare(name, MOVES["held end"])
    first, second = (ready.certify(ready.solve()) for _ in range(2))
    assert first.iterations == second.iterations
    np.testing.assert_array_equal(first.heights, second.heights)


def test_a_start_is_taken():
    problem = SHAPES["snake units"]
    start = jaxclay.minimize(problem).heights
    ready = prepare("optimistix-bfgs", problem, start, max_iterations=1)
    cold = prepare("optimistix-bfgs", problem, max_iterations=1)
    energies = [float(r.certify(r.solve()).energy) for r in (ready, cold)]
    assert energies[0] < energies[1]


@pytest.mark.parametrize("name", CONVEX)
def test_convex_solvers_refuse_tension_and_bending(name):
    with pytest.raises(ValueError, match=rf"{name} solves E_move alone: alpha and beta must be 0"):
        prepare(name, SHAPES["snake units"])


def test_an_unknown_peer_is_named():
    with pytest.raises(ValueError, match="unknown peer 'knitro': choose from ipopt"):
        prepare("knitro", SHAPES["snake units"])


def test_a_missing_library_says_what_to_install(tmp_path, monkeypatch, capfd):
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(ImportError, match=r"needs casadi: pip install '\.\[peers\]'"):
        prepare("ipopt", SHAPES["snake units"])
    assert main(["compare", "--peers", "ipopt", "--out", str(tmp_path / "out")]) == 2
    assert "pip install '.[peers]'" in capfd.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_comparison_shows_peers_beside_methods(compared):
    table, _ = compared
    own = table[(table.settings == "") & (table.status != "skipped")]
    rows = own.set_index(["units", "method"]).sort_index()
    assert set(rows.loc["snake"].index) == {"newton", "ipopt"}
    assert set(rows.loc["move"].index) == {"newton", "ipopt", "clarabel", "piqp"}
    assert set(rows.status) == {"converged"}
    assert (rows.compile_s > 0).all()
    assert (abs(rows.gap_relative.dropna()) < 1e-10).all()
    assert (rows.gap_relative.notna() | (rows.index.get_level_values("method") == "newton")).all()
    assert own.packages[own.method == "ipopt"].str.startswith("casadi ").all()


def test_refused_scenes_are_counted_with_the_reason(compared):
    table, _ = compared
    refused = table[(table.status == "skipped") & (table.settings == "")]
    assert set(refused.method) == {"clarabel", "piqp"}
    assert summary.refusals(prepared(refused)) == {
        f"{name} solves E_move alone: alpha and beta must be 0": 2 for name in ("clarabel", "piqp")
    }


def test_an_answer_below_the_floor_is_shown_so(compared):
    rows = prepared(compared[0])
    row = next(rows[rows.method == "newton"].itertuples())
    assert summary.cells(row)["status"] == "converged"
    assert summary.cells(row._replace(slack=-1e-9))["status"] == "below floor"


def test_looser_tolerances_are_faster_and_farther_off(compared):
    table, _ = compared
    rows = table[(table.method == "ipopt") & (table.settings != "")]
    tolerance = rows.settings.str.removeprefix("tolerance=").astype(float)
    rows = rows.assign(tolerance=tolerance).sort_values("tolerance")
    assert (np.diff(rows.iterations) <= 0).all()
    assert rows.gap_relative.iloc[0] < 1e-10 < rows.gap_relative.iloc[-1]


def test_the_report_tells_peers_apart(compared):
    assert main(["report", str(compared[1])]) == 0
    page = (compared[1] / "report.html").read_text(encoding="utf-8")
    assert "IPOPT through CasADi" in page
    assert "casadi 3" in page


def test_a_budget_is_told_to_a_peer(tmp_path):
    path = tmp_path / "late.toml"
    text = COMPARED.split("[[parts]]")[0].replace("repeats = 3", "repeats = 1\nbudget = 1e-6")
    methods = '[{ name = "scipy-lbfgsb" }]'
    path.write_text(text.split("methods = ")[0] + f"methods = {methods}\n")
    assert set(run(path, tmp_path / "out").status) == {"out of time"}
