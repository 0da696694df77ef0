"""Parts a, b and f of the spline benchmark: orders, unknowns, and what the estimate is worth."""

from __future__ import annotations

import numpy as np
from bounds import Bound, Part, table
from spline_scenes import Effort, Known, at_least, at_most, known, percentiles

import jaxclay
from jaxclay.schemes.spline.first_mesh import _lengths

ORDERS = {3: (1.8, 1.8), 4: (3.5, 3.5), 5: (5.5, 4.5)}  # in energy, in the contour
UNKNOWNS = {"median": (50, 16.0), "90%": (90, 40.0)}
UNKNOWNS_SNAKE = 25.0
RATIO, BELOW = (0.5, 10.0), 0.99
_LADDER = (3e-3, 2e-3, 1e-3, 7e-4, 5e-4, 3e-4, 2e-4, 1e-4, 5e-5)  # tried for an error of 1e-4
_UNSEEN = 2e-6  # errors and estimates that the truth is too rough to compare
_RESTS = 1e-4  # of the largest displacement
_SEEN = 10.0  # errors over what the truth is good for, to be measured
_ROUNDING, _CHORDS = 1e-12, 6e-9  # of E_free, in energies; of contours, drawn by chords


def orders(effort: Effort) -> Part:
    """Part a: halving all spans, on scenes of which all free clay moves one way."""
    scenes, note = known(effort.timed)
    chosen = [one for one in scenes if not one.scene.worked and _one_way(one)]
    found = table(
        f"a. Orders, {len(chosen)} cylinders whose free clay all moves one way: "
        "median [10, 90, 99%]",
        *("degree", "scenes", "in energy", "in the contour"),
    )
    bounds = []
    for degree, wanted in ORDERS.items():
        each = [_orders(one, degree, effort.elements) for one in chosen]
        energy, contour = ([e[i] for e in each if np.isfinite(e[i])] for i in (0, 1))
        cells = percentiles(energy, "{:.2f}"), percentiles(contour, "{:.2f}")
        found.add_row(str(degree), f"{len(energy)}, {len(contour)}", *cells)
        kinds = ("energy", energy, wanted[0]), ("contour", contour, wanted[1])
        for what, values, least in kinds:
            bounds.append(at_least(f"a. order in {what}, degree {degree}", values, 50, least))
    about = "a. spans shorter than the layer at the band's edge; worked clay has kinks inside spans"
    return Part(found, bounds, [note, about])


def _one_way(one: Known) -> bool:
    """Whether the clay on each side of the band moves one way and none of it rests."""
    rest, shape = one.scene.clay, one.exact.clay
    u, band = np.linspace(0, 1, 801), one.exact.problem.band
    shift = np.asarray(shape.height_at(u) - rest.height_at(u))
    for side in (u < float(band.lower)) & (u > 0), u > float(band.upper):
        moved = shift[side] * np.sign(shift[side].sum()) if side.any() else np.ones(1)
        edge = 1 if side[1] else 0  # Y_0 = 0 stays
        if (moved[4 * edge :] <= _RESTS * np.abs(shift).max()).any():
            return False
    return True


def _orders(one: Known, degree: int, elements: tuple[int, ...]) -> tuple[float, float]:
    """Medians of log2 of what errors fall by; nan where none can be seen."""
    clay, squash, material = one.scene.clay, one.scene.squash, one.scene.material
    exact, errors = one.exact, []
    scale = float(exact.certificate.energy_free)
    for count in elements:
        problem = jaxclay.pose(clay, squash, material, "spline", degree, count)
        answer = jaxclay.minimize(problem)
        if not _resolves(problem, count):
            continue
        gap = abs(float(answer.energy - exact.energy)) / scale
        errors.append((gap, jaxclay.contour_error(answer.clay, exact.clay)))
    least = _SEEN * np.array([_ROUNDING, max(float(exact.error_estimate or 0), _CHORDS)])
    found = []
    for kind, floor in zip(np.reshape(errors, (-1, 2)).T, least, strict=True):
        seen = (kind[1:] > floor) & np.isfinite(kind[:-1])  # a shape that fell has no contour
        falls = np.log2(kind[:-1] / kind[1:])[seen]
        found.append(float(np.median(falls)) if len(falls) else np.nan)
    return found[0], found[1]


def _resolves(problem, count: int) -> bool:
    """Whether equal spans are shorter than the layer at the band's edge."""
    lower, upper = float(problem.band.lower), float(problem.band.upper)
    slope = np.asarray(problem.clay.derivatives(np.array([lower, upper]))[1]) / problem.clay.unit
    layer = np.asarray(_lengths(slope, problem.rest.r0, problem.material)[0])
    spans = np.array([lower, 1 - upper]) / count
    return bool((spans <= layer).all())


def unknowns(effort: Effort) -> Part:
    """Part b: the fewest unknowns with a true error below 1e-4."""
    scenes, note = known(effort.scenes)
    fewest, asked = [], []
    for scene, exact in scenes:
        counts = []
        for tolerance in _LADDER:
            answer = jaxclay.deform(scene.clay, scene.squash, scene.material, tolerance=tolerance)
            if tolerance == 1e-4:
                asked.append(int(answer.unknowns))
            if jaxclay.contour_error(answer.clay, exact.clay) <= 1e-4:
                counts.append(int(answer.unknowns))
        fewest.append(min(counts, default=np.inf))
    snake = np.array([one.scene.snake for one in scenes])
    found = table("b. Unknowns: median [10, 90, 99%]", "scenes", "all", "snake units", "as printed")
    for name, values in (("error 1e-4", np.array(fewest)), ("tolerance 1e-4", np.array(asked))):
        kinds = values, values[snake], values[~snake]
        found.add_row(name, *(percentiles(kind, "{:.0f}") for kind in kinds))
    what = "b. unknowns for a contour error of 1e-4"
    bounds = [at_most(f"{what}, {n}", fewest, *b) for n, b in UNKNOWNS.items()]
    bounds.append(at_most(f"{what}, snake units", np.array(fewest)[snake], 50, UNKNOWNS_SNAKE))
    return Part(found, bounds, [note, f"{len(scenes)} scenes"])


def estimates(effort: Effort) -> Part:
    """Part f: the estimate over the true error, tolerance 1e-4."""
    scenes, note = known(effort.scenes)
    ratios, errors = [], []
    for scene, exact in scenes:
        answer = jaxclay.deform(scene.clay, scene.squash, scene.material, tolerance=1e-4)
        errors.append(jaxclay.contour_error(answer.clay, exact.clay))
        ratios.append(float(answer.error_estimate or 0) / errors[-1])
    low, high = RATIO
    # Errors smaller than what the truth is good for cannot be told from none.
    inside = [low <= ratio <= high or max(error, ratio * error) < _UNSEEN
              for ratio, error in zip(ratios, errors, strict=True)]  # fmt: skip
    outside = [f"{scene.number} ({ratio:.2g})"
               for (scene, _), ratio, good in zip(scenes, ratios, inside, strict=True)
               if not good]  # fmt: skip
    below = float(np.mean(np.array(errors) <= 1e-4))
    found = table("f. Tolerance 1e-4: median [10, 90, 99%]", "scenes", "estimate / error", "error")
    found.add_row(str(len(scenes)), percentiles(ratios), percentiles(errors, "{:.1e}"))
    bounds = [
        Bound(f"f. estimate over true error within {low:g}..{high:g}", "100%",
              f"{np.mean(inside):.1%}, {min(ratios):.2g}..{max(ratios):.2g}", all(inside)),
        Bound("f. true error below the tolerance", ">= 99%", f"{below:.1%}", below >= BELOW),
    ]  # fmt: skip
    return Part(found, bounds, [note, f"outside: scenes {', '.join(outside) or 'none'}"])
