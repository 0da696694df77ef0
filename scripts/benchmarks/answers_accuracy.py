"""Parts g to i of the answers benchmark: tolerances kept, and what they take."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from answers_speed import SEED, kernel, posed
from bounds import Bound, Part, at_least, at_most, table
from clocks import medians, spread
from slices_scenes import MATERIALS, SQUASHES, Scene, next_squash, population

import jaxclay
from jaxclay import Clay, Material, Squash, Status, contour_error, deform

TOLERANCES = (1e-3, 1e-4)
_FINE = 2048  # slices of references


def to_tolerance(effort) -> Part:
    """Part g."""
    scenes = list(population(effort.scenes, SEED))
    truths = [deform(*scene[:3], slices=_FINE) for scene in scenes]
    pairs = [pair for pair in zip(scenes, truths, strict=True) if not pair[1].status.value]
    found = table(
        f"g. deform to a tolerance, {len(pairs)} scenes, errors against n = {_FINE}",
        *("tolerance", "within", "estimate / error: 10%, 50%, 90%", "slices: 50%, 90%", "ms"),
        "solves at n = 128: 50%, 90%",
    )
    bounds, solves = [], np.zeros(2)
    for tolerance, most in zip(TOLERANCES, ((64, 256), (256, 512)), strict=True):
        rows = [_row(scene, known.clay, tolerance, effort.seconds) for scene, known in pairs]
        error, estimate, slices, seconds, unit = np.array(rows).T
        within, picked = np.mean(error <= tolerance), np.quantile(slices, (0.5, 0.9))
        ratios = np.quantile(estimate / error, (0.1, 0.5, 0.9))
        solves = np.quantile(seconds / np.median(unit), (0.5, 0.9))
        columns = (f"{within:.1%}", ratios, picked, spread(seconds, scale=1e3), solves)
        cells = (c if isinstance(c, str) else ", ".join(f"{x:.3g}" for x in c) for c in columns)
        found.add_row(f"{tolerance:g}", *cells)
        at = f"g. {tolerance:g}:"
        bounds += [
            at_least(f"{at} errors within it", within, 0.97, "{:.1%}"),
            _between(f"{at} estimate / error, median", ratios[1], 0.8, 1.5),
            at_least(f"{at} the same, 10%", ratios[0], 0.3),
            at_most(f"{at} the same, 90%", ratios[2], 3),
            at_most(f"{at} slices, median", picked[0], most[0]),
            at_most(f"{at} slices, 90%", picked[1], most[1]),
        ]
    what = "g. deform(tolerance=1e-4), in solves at n = 128,"
    bounds += [at_most(f"{what} median", solves[0], 10), at_most(f"{what} 90%", solves[1], 30)]
    return Part(found, bounds, ["g. what does not converge counts as beyond its tolerance"])


def _between(what: str, value: float, least: float, most: float) -> Bound:
    return Bound(what, f"{least:g} to {most:g}", f"{value:.3g}", bool(least <= value <= most))


def _row(scene: Scene, reference: Clay, tolerance: float, seconds: float) -> tuple[float, ...]:
    """True error (infinite if refused), estimate, slices, seconds, seconds of a solve at 128."""
    answer = deform(*scene[:3], tolerance=tolerance)
    error = contour_error(answer.clay, reference) if answer.status is Status.CONVERGED else np.inf
    call = lambda: deform(*scene[:3], tolerance=tolerance)  # noqa: E731
    taken = medians({"deform": call, "solve": kernel(posed(scene, 128))}, seconds)
    estimate, slices = float(answer.error_estimate or np.nan), np.size(answer.heights) - 1
    return error, estimate, slices, taken["deform"], taken["solve"]


class Session:
    """What becomes of a session to a tolerance.

    Attributes
    ----------
    clay : Clay
    slices : int
        Most that were stored.
    refused : list of str
        Why, for every squash that was refused.
    wrongly : int
        How many of them fine slices solve.
    solves : list of float
        Seconds of each squash over those of a solve at n = 256.
    """

    def __init__(self, clay: Clay, material: Material, tolerance: float):
        self.clay, self.material, self.tolerance = clay, material, tolerance
        self.slices, self.wrongly = 0, 0
        self.refused: list[str] = []
        self.solves: list[float] = []

    def squash(self, tool: Squash, solvable: bool) -> None:
        """One squash more; timed for the loosest tolerance."""
        before, how = self.clay, dict[str, Any](tolerance=self.tolerance)
        self.clay, why = _squashed(before, tool, self.material, **how)
        self.slices = max(self.slices, np.size(self.clay.heights) - 1)
        self.refused += [why] if why else []
        self.wrongly += bool(why and solvable)
        if self.tolerance == TOLERANCES[0] and not why:
            solve = kernel(posed(Scene(before, tool, self.material, True), 256))
            call = lambda: deform(before, tool, self.material, **how)  # noqa: E731
            taken = medians({"deform": call, "solve": solve}, 0.0)
            self.solves.append(taken["deform"] / taken["solve"])


def _sessions(seed: int, material: Material) -> tuple[Clay, list[Session]]:
    """A session by tolerance, with the squashes that fine slices' shape chooses; and that shape."""
    rng, exact = np.random.default_rng(seed), Clay.cylinder(radius=0.4)
    runs = [Session(exact, material, tolerance) for tolerance in TOLERANCES]
    for _ in range(SQUASHES):
        tool = next_squash(rng, exact)
        exact, missing = _squashed(exact, tool, material, slices=_FINE)
        for run in runs:
            run.squash(tool, not missing)
    return exact, runs


def _squashed(clay: Clay, tool: Squash, material: Material, **how: Any) -> tuple[Clay, str]:
    """The clay afterwards, and why it was refused if it was.

    Then it is the clay as it was, or the one that an unresolved answer advises to go on with.
    """
    try:
        answer = deform(clay, tool, material, **how)
    except ValueError as error:
        return clay, str(error)
    if answer.status in (Status.CONVERGED, Status.UNRESOLVED):
        return answer.clay, "" if answer.status is Status.CONVERGED else answer.message
    return clay, answer.message


def squash_often(seed: int, material: Material, tolerance: float) -> Clay:
    """The clay after a session that chooses squashes by its own shape."""
    rng, clay = np.random.default_rng(seed), Clay.cylinder(radius=0.4)
    for _ in range(SQUASHES):
        clay, _ = _squashed(clay, next_squash(rng, clay), material, tolerance=tolerance)
    return clay


def sessions(effort) -> Part:
    """Part h."""
    found = table(
        f"h. Sessions of {SQUASHES} squashes, errors against n = {_FINE}",
        *("material", "tolerance", "squashes", "refused", "error 50%", "error 90%", "most slices"),
    )
    every: list[Session] = []
    errors: dict[float, list[float]] = {tolerance: [] for tolerance in TOLERANCES}
    for name, material in MATERIALS.items():
        pairs = [_sessions(seed, material) for seed in range(effort.sessions)]
        for i, tolerance in enumerate(TOLERANCES):
            some = [runs[i] for _, runs in pairs]
            these = [contour_error(runs[i].clay, exact) for exact, runs in pairs]
            every, errors[tolerance] = every + some, errors[tolerance] + these
            refused, most = sum(len(run.refused) for run in some), max(r.slices for r in some)
            cells = name, f"{tolerance:g}", str(SQUASHES * len(some)), str(refused)
            middle, high = np.quantile(these, (0.5, 0.9))
            found.add_row(*cells, f"{middle:.2g}", f"{high:.2g}", str(most))
    refused = [why for run in every for why in run.refused]
    share = 1 - len(refused) / (SQUASHES * len(every))
    times = [ratio for run in every for ratio in run.solves]
    bounds = [
        at_least("h. squashes converged", share, 0.999, "{:.2%}"),
        at_most("h. refused though n = 2048 solves it", sum(run.wrongly for run in every), 0, "{}"),
        at_most("h. storage, slices", max(run.slices for run in every), 1499, "{}"),
        at_most("h. a squash to 1e-3 in solves at 256, median", np.median(times), 8),
        at_most("h. the same, 90%", np.quantile(times, 0.9), 20),
    ]
    for tolerance, those in errors.items():
        high = np.quantile(those, 0.9) / tolerance
        bounds.append(at_most(f"h. {tolerance:g}: error in the end, 90%", high, 2, unit=" times"))
    return Part(found, bounds, [f"h. refused: {why}" for why in dict.fromkeys(refused)])


def smooth_profiles(effort) -> Part:
    """Part i."""
    ends = [deform(*scene, tolerance=1e-4) for scene in _profiles(effort.profiles)]
    share = sum(end.status is Status.CONVERGED for end in ends) / len(ends)
    found = table("i. Smooth random profiles, a squash each to 1e-4", "profiles", "converged")
    found.add_row(str(len(ends)), f"{share:.2%}")
    notes = [f"i. {i}: {end.message}" for i, end in enumerate(ends) if end.status.value]
    return Part(found, [at_least("i. profiles converged", share, 0.998, "{:.2%}")], notes)


def _profiles(count: int) -> Iterator[tuple[Any, Squash, Material]]:
    """Profiles from a file, as people have them, 80 to 300 high, and a squash of each."""
    rng, material = np.random.default_rng(SEED), Material.from_snake_units()
    for _ in range(count):
        H, a = rng.uniform(80, 300), rng.uniform(-1, 1)
        f, p, bottom = rng.uniform(0.7, 2.2), rng.uniform(0, 3), rng.uniform(0, 0.7)
        y = np.linspace(0, 1, 40)
        radii = H * (0.25 + 0.12 * a * np.sin(np.pi * y * f + p))
        low, high = np.round(H * np.array([bottom, bottom + rng.uniform(0.05, 0.25)]), 2)
        radius = np.interp((low + high) / 2, H * y, radii) * rng.uniform(0.7, 1.1)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "profile.csv"
            rows = np.column_stack([H * y, radii])
            np.savetxt(path, rows, "%.17g", ",", header="height,radius", comments="")
            yield jaxclay.load_profile(path), Squash(low, high, radius), material
