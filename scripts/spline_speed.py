"""Parts c, d and e of the spline benchmark: time to an error, one squash, iterations."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pandas as pd
from bounds import Part, table
from spline_scenes import ADAPTIVE, FIXED, Effort, at_least, at_most, known, percentiles

from jaxclay.compare.accuracy import row_of
from jaxclay.compare.accuracy_tables import reach
from jaxclay.compare.population import population
from jaxclay.compare.solves import Way, prepared, seconds_of

RATIOS = {1e-3: (20.0, 4.0), 1e-4: (80.0, 20.0), 1e-5: (300.0, 100.0)}  # median, 10%
ADAPTIVE_MS = {50: 0.5, 90: 2.0, 99: 4.0}
FIXED_MS = {50: 0.3, 99: 0.5}
ONE_SOLVE, WHOLE_RUN = {50: 10.0, 100: 25.0}, {50: 12.0, 90: 40.0}


def against_the_paper(effort: Effort) -> Part:
    """Part c: the time that the paper's scheme takes to an error, over the splines'."""
    scenes, note = known(effort.timed)
    found = table(
        "c. Compiled calls to a contour error, the paper's scheme over splines: median [10, 90, "
        "99%]",
        *("error", "scenes", "extrapolated", "slices", "paper ms", "splines ms", "ratio"),
    )
    rows = pd.DataFrame([row for one in scenes for row in _on_slices(one, effort)])
    bounds, missed = [], []
    for level, (median, tenth) in RATIOS.items():
        ways, slices, ours, beyond = Way("spline", "newton", 5, True, level), [], [], 0
        theirs = []
        for one in scenes:
            row = row_of(one.scene, ways, one.exact, effort.seconds)
            there = reach(rows, one.scene.number, level)
            if row["error"] > level:
                missed.append(f"{one.scene.number} at {level:g} ({row['error']:.1e})")
                continue
            if not there.seconds > 0:
                continue
            beyond += there.beyond
            slices.append(there.slices)
            theirs.append(1e3 * there.seconds)
            ours.append(1e3 * row["solve_s"])
        ratio = np.array(theirs) / np.array(ours)
        cells = (percentiles(values) for values in (slices, theirs, ours, ratio))
        found.add_row(f"{level:g}", str(len(ours)), str(beyond), *cells)
        what = f"c. times as fast to {level:g} ({beyond} of {len(ours)} extrapolated)"
        bounds.append(at_least(f"{what}, median", ratio, 50, median))
        bounds.append(at_least(f"{what}, 10%", ratio, 10, tenth))
    notes = [f"c. splines above the tolerance: scenes {', '.join(missed) or 'none'}", note]
    notes.append("c. slices: the fewest with that error in truth, or by each scene's fitted order")
    return Part(found, bounds, notes)


def _on_slices(one, effort: Effort) -> list[dict]:
    ways = [Way("paper", "newton", 0, False, n) for n in effort.slices]
    return [row_of(one.scene, way, one.exact, effort.seconds) for way in ways]


@lru_cache
def _timed(effort: Effort) -> pd.DataFrame:
    """Times and iterations of every scene, spans that adapt and fixed ones."""
    rows = []
    for scene in population(effort.timed):
        for name, way in (("adaptive", ADAPTIVE), ("fixed", FIXED)):
            ready = prepared(scene, way)
            answer = ready.call()
            rows.append(
                {
                    "way": name,
                    "scene": scene.number,
                    "iterations": int(answer.iterations),
                    "compiled": 1e3 * seconds_of(ready.solve, effort.seconds),
                    "call": 1e3 * seconds_of(ready.call, effort.seconds),
                    "status": str(answer.status),
                }
            )
    return pd.DataFrame(rows)


def one_squash(effort: Effort) -> Part:
    """Part d: one squash at a time, warm."""
    rows = _timed(effort)
    found = table(
        f"d. One squash of {effort.timed} scenes, ms: median [10, 90, 99%]",
        *("spans", "compiled", "as called"),
    )
    bounds = []
    names = {"adaptive": ("adaptive to 1e-4", ADAPTIVE_MS), "fixed": ("8 fixed spans", FIXED_MS)}
    for way, (name, wanted) in names.items():
        mine = rows[rows.way == way]
        found.add_row(name, percentiles(mine.compiled), percentiles(mine.call))
        for share, most in wanted.items():
            what = f"d. {name}, compiled, {'median' if share == 50 else f'{share}%'}"
            bounds.append(at_most(what, mine.compiled, share, most, " ms"))
    ends = ", ".join(f"{count} {status}" for status, count in rows.status.value_counts().items())
    return Part(found, bounds, [f"d. ends: {ends}"])


def iterations(effort: Effort) -> Part:
    """Part e: Newton's iterations of one solve and of all levels."""
    rows = _timed(effort)
    found = table("e. Newton's iterations: median [10, 90, 99%]", "what", "iterations", "largest")
    bounds = []
    names = {"fixed": ("a solve", ONE_SOLVE), "adaptive": ("a whole run", WHOLE_RUN)}
    for way, (name, wanted) in names.items():
        counts = rows[rows.way == way].iterations
        found.add_row(name, percentiles(counts, "{:.0f}"), str(counts.max()))
        for share, most in wanted.items():
            which = {50: "median", 100: "largest"}.get(share, f"{share}%")
            bounds.append(at_most(f"e. iterations of {name}, {which}", counts, share, most))
    return Part(found, bounds, ["e. a solve: 8 fixed spans; a whole run: adaptive to 1e-4"])
