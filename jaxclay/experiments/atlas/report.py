"""What an atlas prints and writes: counts, report.html, charts, atlas.parquet."""

from __future__ import annotations

from html import escape
from pathlib import Path

import pandas as pd
from rich.console import Console
from rich.table import Table

from jaxclay.experiments.atlas.charts import charts
from jaxclay.experiments.atlas.marks import Mark
from jaxclay.experiments.compare import report, results
from jaxclay.methods import METHODS

_TITLE = "jaxclay atlas"
_TIME = "ms where solved"


def write(table: pd.DataFrame, seconds: float, folder: Path) -> list[Path]:
    """Write the table, the charts and ``report.html``; returns the paths."""
    written, figures = report.save_charts(charts(table), folder)
    body = f"{_introduction(seconds)}{figures}{_counts_html(table)}{_reasons_html(table)}"
    page = report.save_page(_TITLE, body + report.what_ran(table), folder)
    return [results.save(table, folder), *written, page]


def counts(table: pd.DataFrame) -> pd.DataFrame:
    """How many cells each method has under each mark, a line for each sweep and precision.

    The last column is the median time of the cells that it solved, in milliseconds.
    """
    keys = ["sweep", "precision", "method"]
    found = table.groupby(keys, sort=False).mark.value_counts().unstack(fill_value=0)
    found = found[[str(mark) for mark in Mark if str(mark) in found.columns]]
    solved = results.select(table, table.mark == str(Mark.SOLVED))
    times = solved.groupby(keys, sort=False).solve_s.median() * 1e3
    return found.assign(**{_TIME: times}).reset_index()


def print_table(table: pd.DataFrame, console: Console) -> None:
    """The counts; a rule between sweeps."""
    if not console.is_terminal:
        console.width = 150
    view, counted = Table(title=_TITLE, box=None, pad_edge=False), counts(table)
    for j, name in enumerate(counted.columns):
        view.add_column(name, justify="left" if j < 3 else "right", no_wrap=True)
    for line in _without_repeats(counted):
        view.add_row(*line)
    console.print(view)
    for reason, count in refusals(table).items():
        console.print(f"refused {count} times: {reason}", highlight=False, soft_wrap=True)


def refusals(table: pd.DataFrame) -> dict[str, int]:
    """Each reason for a refusal and how often it was given."""
    rows = results.select(table, table.mark == str(Mark.REFUSED))
    return {str(reason): int(count) for reason, count in rows.reason.value_counts().items()}


def _without_repeats(counted: pd.DataFrame) -> list[list[str]]:
    """The counts as text, sweep and precision named once; no number where there is none."""
    lines, before = [], None
    for row in counted.itertuples(index=False):
        here = tuple(map(str, row[:2]))
        first = here if here != before else ("", "")
        numbers = [str(count) if count else "" for count in row[3:-1]]
        lines.append([*first, row[2], *numbers, results.number(row[-1], ".3g", "")])
        before = here
    return lines


def _introduction(seconds: float) -> str:
    marks = "".join(
        f"<tr><td style='background:{mark.colour};width:2rem'></td>"
        f"<td class=l>{mark.symbol}</td><td class=l>{mark}</td><td class=l>{mark.meaning}</td></tr>"
        for mark in Mark
    )
    return (
        "<p>Every method on every scene of the paper's scheme, started at the rough shape and "
        "checked by the certificate. "
        f"Each solve has {seconds:g} s, compiling apart: it is given as many iterations as fit, "
        "and more, afresh, until it ends or a run has lasted that long.</p>"
        f"<table>{marks}</table>"
    )


def _counts_html(table: pd.DataFrame) -> str:
    counted = counts(table)
    head = "".join(
        f"<th{' class=l' if j < 3 else ''}>{escape(name)}</th>"
        for j, name in enumerate(counted.columns)
    )
    lines = []
    for line in _without_repeats(counted):
        cells = "".join(
            f"<td{' class=l' if j < 3 else ''}>{escape(text)}</td>" for j, text in enumerate(line)
        )
        lines.append(f"<tr{' class=first' if line[0] else ''}>{cells}</tr>")
    named = "".join(
        f"<li><b>{name}</b>: {escape(METHODS[name].summary)}</li>" for name in table.method.unique()
    )
    return f"<h2>Cells by mark</h2><table><tr>{head}</tr>{''.join(lines)}</table><ul>{named}</ul>"


def _reasons_html(table: pd.DataFrame) -> str:
    listed = "".join(
        f"<li>{count} times: {escape(reason)}</li>" for reason, count in refusals(table).items()
    )
    return f"<h2>Refused</h2><ul>{listed}</ul>" if listed else ""
