"""Parts a, b and f of the newton benchmark: single solves of the named scenes."""

from __future__ import annotations

import numpy as np
from bounds import Bound, Part, table
from clocks import banded_solve, medians, spread
from newton_timing import SAME, Effort, coarse_to_fine, direct, posed

import jaxclay
from jaxclay.compare.peers import prepare

AGAINST_IPOPT = {64: 15.0, 256: 20.0, 1024: 40.0}  # times as fast
IN_SOLVES = {64: 25.0, 256: 40.0, 1024: 60.0, 4096: 70.0}  # banded solves
MOST_ITERATIONS = 25  # on any grid


def against_ipopt(effort: Effort) -> Part:
    """Part a: compiled newton and the whole minimize call against IPOPT's own work."""
    columns = ("newton ms", "minimize ms", "IPOPT ms", "IPOPT/newton", "IPOPT/minimize")
    found = table(
        "a. From the rough shape against IPOPT, over the scenes that end in the same minimum",
        *("slices", "scenes", "certified", "IPOPT's", "same", *columns, "largest gap"),
    )
    bounds, notes = [], []
    for n in (n for n in AGAINST_IPOPT if n in effort.sizes):
        problems, skipped = posed(n)
        rows = []
        for name, problem in problems.items():
            rows.append(row := _race(problem, effort.seconds))
            if not row["same"]:
                notes.append(
                    f"{name} at n = {n}: IPOPT's energy less newton's is {row['gap']:+.1e} E_free, "
                    f"certified: newton {row['ours']}, IPOPT {row['theirs']}"
                )
        same = [row for row in rows if row["same"]]
        times = [spread([row[key] for row in same], scale=1e3) for key in ("newton", "whole")]
        ratios = [row["ipopt"] / row["newton"] for row in same]
        found.add_row(
            *(str(n), str(len(rows)), *(str(sum(r[k] for r in rows)) for k in ("ours", "theirs"))),
            *(str(len(same)), *times, spread([row["ipopt"] for row in same], scale=1e3)),
            *(spread(ratios), spread([row["ipopt"] / row["whole"] for row in same])),
            f"{max((abs(row['gap']) for row in same), default=0):.0e}",
        )
        wanted, median = AGAINST_IPOPT[n], float(np.median(ratios)) if ratios else np.nan
        what = f"a. IPOPT's time over newton's at n = {n}"
        bounds.append(Bound(what, f">= {wanted:g}", f"{median:.3g}", median >= wanted))
        notes += skipped
    return Part(found, bounds, notes)


def _race(problem, seconds: float) -> dict:
    newton, ipopt = direct(problem), prepare("ipopt", problem)
    calls = {"newton": newton, "whole": lambda: jaxclay.minimize(problem), "ipopt": ipopt.solve}
    taken = medians(calls, seconds)
    ours, theirs = newton.judged()[0], ipopt.judge(ipopt.solve())
    gap = float((theirs.energy - ours.energy) / ours.certificate.energy_free)
    accepted = {"ours": ours.certificate.accepted, "theirs": theirs.certificate.accepted}
    judged = {name: bool(value) for name, value in accepted.items()}
    return {**taken, **judged, "gap": gap, "same": judged["ours"] and abs(gap) <= SAME}


def in_banded_solves(effort: Effort) -> Part:
    """Part b: newton in units of one solve by SciPy of a matrix of half-bandwidth 3."""
    found = table(
        "b. From the rough shape in units of one scipy.linalg.solveh_banded (half-bandwidth 3)",
        *("slices", "scenes", "solveh us", "direct ms", "iterations", "certified", "units"),
        *("coarse to fine ms", "iterations", "certified", "units", "faster that certifies"),
    )
    bounds, notes = [], []
    for n in effort.sizes:
        problems, skipped = posed(n)
        rows = [_weigh(problem, effort.seconds) for problem in problems.values()]
        for name, row in zip(problems, rows, strict=True):
            if np.isinf(row["best"]):
                notes.append(f"{name} at n = {n}: {row['status']}")
        best = [row["best"] for row in rows if np.isfinite(row["best"])]
        cells = []
        for way in ("direct", "climb"):
            these = [row[way] for row in rows if way in row]
            cells += [spread([way[0] for way in these], scale=1e3)]
            cells += [spread([way[2] for way in these], "{:.0f}")]
            cells += [f"{sum(way[3] for way in these)}/{len(these)}" if these else "-"]
            cells += [spread([way[1] for way in these])]
        units = spread([row["unit"] for row in rows], scale=1e6)
        found.add_row(str(n), str(len(rows)), units, *cells, spread(best))
        median = float(np.median(best)) if best else np.nan
        what, wanted = f"b. newton in banded solves at n = {n}", IN_SOLVES[n]
        bounds.append(Bound(what, f"<= {wanted:g}", f"{median:.3g}", median <= wanted))
        notes += skipped
    notes.append("b. iterations are those of the finest grid; part f shows the others")
    return Part(found, bounds, notes)


def _weigh(problem, seconds: float) -> dict:
    """Of each way: seconds, units, iterations, certified; the unit in seconds; the best way."""
    n = problem.slices
    ways = {"direct": direct(problem)}
    if n > 256:
        ways["climb"] = coarse_to_fine(problem)
    taken = medians(ways | {"unit": banded_solve(n)}, seconds)
    row: dict = {"unit": taken["unit"]}
    for name, way in ways.items():
        solution, iterations = way.judged()
        units, accepted = taken[name] / taken["unit"], bool(solution.certificate.accepted)
        row[name] = taken[name], units, int(iterations[-1]), accepted
        row["status"] = str(solution.status)
    row["best"] = min((row[name][1] for name in ways if row[name][3]), default=np.inf)
    return row


def by_level(effort: Effort) -> Part:
    """Part f: iterations on each grid on the way from coarse to fine."""
    n = max(effort.sizes)
    problems, notes = posed(n)
    grids, rows = [], []
    for problem in problems.values():
        solution, iterations = coarse_to_fine(problem).judged()
        rows.append([*iterations, solution.status])
    levels = max(len(row) for row in rows) - 1
    grids = [-(-n // 2**j) for j in range(levels)][::-1]
    found = table(
        f"f. Newton's iterations by grid, coarse to fine, to n = {n}",
        *("scene", *map(str, grids), "status"),
    )
    for name, row in zip(problems, rows, strict=True):
        found.add_row(name, *map(str, row))
    columns = np.array([row[:-1] for row in rows if row[-1] is jaxclay.Status.CONVERGED])
    found.add_row("median", *(f"{m:g}" for m in np.median(columns, axis=0)), "")
    most, worst = int(columns.max()), np.median(columns, axis=0).max()
    measured = f"{most} (largest median {worst:g})"
    what = f"f. iterations of what converges, any grid from {grids[0]} to {n}"
    met = most <= MOST_ITERATIONS
    return Part(found, [Bound(what, f"<= {MOST_ITERATIONS}", measured, met)], list(notes))
