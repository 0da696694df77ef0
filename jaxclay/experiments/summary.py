"""The summary of a folder: how each method fared, and a sentence on where it wins and fails."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pandas as pd
from rich.table import Table

from jaxclay.experiments.charts.shared import Mark, marked, told_apart
from jaxclay.experiments.results import groups, number, select

_ROUNDING = 1e-12  # over the thickness at rest, what the certificate lets pass
_MOST_PLACES = 2  # of failures that a sentence names
Line = dict[str, str]


def summary(rows: pd.DataFrame) -> list[Line]:
    """A line for each method on each scheme, and for each of its settings where they are few.

    Of a method that was run over a ladder its own settings count, or the tightest.  Columns that
    would be empty are left out.
    """
    rows = marked(told_apart(rows))
    # Whose certified answer is quickest, by problem; of problems that two or more tried.
    certified = select(rows, (rows.mark == str(Mark.SOLVED)) & (rows.solve_s > 0))
    tried = rows.groupby("problem").series.nunique()
    certified = select(certified, certified.problem.map(tried) > 1)
    first = certified.sort_values("solve_s").drop_duplicates(subset="problem")
    best = dict(zip(first.problem, first.series, strict=True))
    return _filled([_line(str(series), part, best) for series, part in groups(rows, "series")])


def _line(series: str, part: pd.DataFrame, best: dict[str, str]) -> Line:
    tried = select(part, part.status != "skipped")
    counts = part.mark.value_counts()
    certified = int(counts.get(str(Mark.SOLVED), 0))
    timed = select(tried, tried.kind == "timing")
    return {
        "method": series,
        "tasks": f"{len(part)}",
        "certified": f"{certified / len(tried):.0%}" if len(tried) else "",
        "median gap / E_free": _median(tried.gap_relative.abs(), ".1e") or "none certified",
        "median ms": _median(timed.solve_s * 1e3, ".3g"),
        "first answer s": _median(part.first_s, ".2g"),
        **{str(mark): f"{counts.get(str(mark), 0) or ''}" for mark in list(Mark)[1:]},
        "in a sentence": _sentence(series, part, tried, certified, best),
    }


def _sentence(series, part: pd.DataFrame, tried: pd.DataFrame, certified: int, best) -> str:
    """Where it wins and where it fails."""
    told = []
    mine = select(part, part.problem.isin(list(best)))
    wins = [problem for problem in mine.problem.unique() if best[problem] == series]
    if wins:
        there = select(mine, mine.problem.isin(wins))
        told.append(f"quickest certified on {len(wins)} of {mine.problem.nunique()} problems"
                    f"{_places(there, mine)}")  # fmt: skip
    elif certified and len(mine):
        told.append(f"never quickest on {mine.problem.nunique()} problems")
    failed = select(tried, tried.mark != str(Mark.SOLVED))
    for mark, those in groups(failed, "mark"):
        told.append(f"{mark} on {len(those)}{_places(those, tried)}")
    skipped = len(part) - len(tried)
    told += [f"skipped on {skipped}"] if skipped else []
    return "; ".join(told or ["certified on all"])


def _places(those: pd.DataFrame, whole: pd.DataFrame) -> str:
    """In which units or on which scenes, where that says something."""
    units = sorted(set(those.units))
    words = [f"{units[0]} units"] if len(units) == 1 < whole.units.nunique() else []
    scenes = [str(scene) for scene in those.scene.unique()]
    if len(scenes) <= _MOST_PLACES < whole.scene.nunique():
        words.append(" and ".join(scenes))
    return f" ({', '.join(words)})" if words else ""


def refusals(rows: pd.DataFrame) -> dict[str, int]:
    """Each reason for which there is no answer, and how often it was given."""
    refused = select(rows, marked(rows).mark == str(Mark.REFUSED))
    return {str(reason): int(count) for reason, count in refused.reason.value_counts().items()}


def _median(values: pd.Series, spec: str) -> str:
    return number(values.astype(float).median(), spec)


ROWS = ("scene", "units", "size", "method", "settings", "status", "gap / E_free", "contour error",
        "from the continuum", "iterations", "compile s", "solve s", "first s")  # fmt: skip
NUMBERS = ("size", *ROWS[6:])  # columns that are sorted and set as numbers


def cells(row: Any) -> Line:
    """A row of the results as text."""
    broken = row.slack < -_ROUNDING
    size = f"{row.slices}" if row.slices else f"{row.elements} spans of degree {row.degree}"
    size = f"to {row.tolerance:g}" if row.tolerance else size
    values = (
        row.scene if not row.number else f"{row.scene} {row.number}", row.units, size,
        row.family, row.settings, "below floor" if broken else row.status,
        number(row.gap_relative, ".1e", "" if row.status == "skipped" else "none certified"),
        number(row.contour_error, ".1e"), number(row.contour_error_continuum, ".1e"),
        number(row.iterations, "d"), number(row.compile_s, ".2f"), number(row.solve_s, ".2e"),
        number(row.first_s, ".2f"),
    )  # fmt: skip
    return dict(zip(ROWS, values, strict=True))


def printed(title: str, lines: Iterable[Line]) -> Table:
    """Lines as a table for the terminal, without columns that are empty."""
    lines = _filled(list(lines))
    view = Table(title=title, box=None, pad_edge=False)
    for name in lines[0] if lines else ():
        wide = name == "in a sentence"
        text = wide or name in ("method", "scene", "units", "settings", "status")
        view.add_column(name, justify="left" if text else "right", no_wrap=not wide)
    for line in lines:
        view.add_row(*line.values())
    return view


def _filled(lines: list[Line]) -> list[Line]:
    kept = [name for name in lines[0] if any(line[name] for line in lines)] if lines else []
    return [{name: line[name] for name in kept} for line in lines]
