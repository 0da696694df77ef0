"""report.html: the charts, the table and what ran, in one file that needs no network."""

from __future__ import annotations

import io
from collections.abc import Iterable
from html import escape
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd
from matplotlib.figure import Figure

from jaxclay.experiments.compare import results
from jaxclay.experiments.compare.charts import charts
from jaxclay.experiments.compare.peers import PEERS
from jaxclay.experiments.compare.runner import Overlay
from jaxclay.files.profiles import replacing

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 70rem; margin: 2rem auto; padding: 0 1rem;
       color: #1a1a1a; background: #fff }
figure { margin: 2rem 0 } figcaption { color: #444; max-width: 60rem } svg { max-width: 100%;
height: auto }
table { border-collapse: collapse; font-size: 13px } th, td { padding: .15rem .6rem;
text-align: right } th { position: sticky; top: 0; background: #fff; border-bottom: 1px solid #888 }
td.l, th.l { text-align: left } tr.first td { border-top: 1px solid #ccc }
.converged { color: #00614a } .stalled, .iteration, .below { color: #8a3a00 }
.wide { overflow-x: auto }
.figures td { white-space: nowrap }
"""


def write(table: pd.DataFrame, overlays: list[Overlay], folder: Path) -> list[Path]:
    """Write every chart as PNG and ``report.html`` with the charts as SVG; returns the paths."""
    written, figures = save_charts(charts(table, overlays), folder)
    return [*written, save_page("jaxclay compare", _body(table, figures), folder)]


def save_charts(drawn: Iterable[tuple[str, str, Figure]], folder: Path) -> tuple[list[Path], str]:
    """Write charts as PNG, given name, caption and figure; the paths, and the charts as HTML."""
    written, figures = [], []
    for name, caption, figure in drawn:
        path = folder / f"{name}.png"
        with replacing(path) as temporary:
            figure.savefig(temporary, dpi=150)
        written.append(path)
        figures.append(f"<figure>{_svg(figure)}<figcaption>{escape(caption)}</figcaption></figure>")
        plt.close(figure)
    return written, "".join(figures)


def save_page(title: str, body: str, folder: Path) -> Path:
    """Write ``report.html``: a title, what follows it, and the style; it loads nothing."""
    path = folder / "report.html"
    head = (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{title}</title>"
        "<meta name=viewport content='width=device-width, initial-scale=1'>"
        f"<style>{_STYLE}</style><h1>{title}</h1>"
    )
    with replacing(path) as temporary:
        temporary.write_text(f"{head}{body}</html>", encoding="utf-8")
    return path


def what_ran(table: pd.DataFrame) -> str:
    """Versions and machine as HTML."""
    lines = "".join(
        f"<tr><td class=l>{escape(name)}</td><td class=l>{escape(str(value))}</td></tr>"
        for name, value in results.versions(table.method.unique()).items()
    )
    return f"<h2>What ran</h2><table>{lines}</table>"


def _svg(figure: Figure) -> str:
    text = io.StringIO()
    figure.savefig(text, format="svg")
    svg = text.getvalue()
    return svg[svg.index("<svg") :]


def _body(table: pd.DataFrame, figures: str) -> str:
    left_out = "".join(f"<li>{escape(line)}</li>" for line in results.skipped(table))
    return (
        f"<p>{_summary(table)}</p>{figures}"
        f"<h2>Every answer</h2>{_explanation()}{_peers(table)}"
        f"<div class=wide>{_table(table)}</div>"
        + (f"<h2>Skipped</h2><ul>{left_out}</ul>" if left_out else "")
        + what_ran(table)
    )


def _summary(table: pd.DataFrame) -> str:
    rows = results.answers(table)
    counts = rows[rows.status != "skipped"].groupby("method", sort=False).status
    parts = [
        f"<b>{escape(str(method))}</b> converged on {(status == 'converged').sum()} of "
        f"{len(status)}"
        for method, status in counts
    ]
    return "Certified answers: " + "; ".join(parts) + "."


def _explanation() -> str:
    return (
        "<p>All on the paper's scheme (eqs. 20-22), on which greedy is defined. The gap is E_total "
        "minus the certified minimum's, over E_free, the energy of the terms that touch a free "
        "node; the contour error is the largest distance to the certified minimum's contour on the "
        "same grid, over the piece's first height. Solve seconds are the median of repeats; "
        "compiling is timed apart, at the method's first call on a grid. In the column 1993 stands "
        "the time that the paper gives for one greedy deformation of 64 points, display included, "
        "on the workstation of its day.</p>"
    )


def _peers(table: pd.DataFrame) -> str:
    """What the solvers from outside are, if there are any."""
    names = [name for name in PEERS if (table.method == name).any()]
    if not names:
        return ""
    listed = "".join(f"<li><b>{name}</b>: {escape(PEERS[name].summary)}</li>" for name in names)
    return (
        "<p>Peers are established solvers from outside, dashed in the charts. They start at the "
        "rough shape like the methods, and their answers are taken as they stand: below floor is "
        "one that breaks the thickness floor. Building a solver counts as compiling, and a solve "
        "that has not ended after 2 seconds as one at its iteration limit.</p>"
        f"<ul>{listed}</ul>"
    )


def _table(table: pd.DataFrame) -> str:
    left = {name for name, justify in results.COLUMNS.items() if justify == "left"}
    head = "".join(
        f"<th{' class=l' if name in left else ''}>{escape(name)}</th>" for name in results.COLUMNS
    )
    lines, before = [], None
    for row in results.records(results.answers(table)):
        here = row.scene, row.units, row.slices
        first = here != before
        values = [*(map(str, here) if first else ("", "", "")), *results.cells(row)]
        cells = []
        for name, value in zip(results.COLUMNS, values, strict=True):
            kind = "l " if name in left else ""
            kind += value.split()[0] if name == "status" and value else ""
            cells.append(f"<td class='{kind}'>{escape(value)}</td>")
        lines.append(f"<tr{' class=first' if first else ''}>{''.join(cells)}</tr>")
        before = here
    return f"<table><tr>{head}</tr>{''.join(lines)}</table>"
