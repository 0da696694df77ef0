"""Results of a comparison: one table of every figure, and what ran on what."""

from __future__ import annotations

import importlib.metadata
import os
import platform
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, cast

import pandas as pd
from rich.console import Console
from rich.table import Table

from jaxclay.experiments.compare.peers import PEERS
from jaxclay.files.profiles import replacing
from jaxclay.version import __version__

_ROUNDING = 1e-12  # over the thickness at rest, what the certificate lets pass
_PACKAGES = ("jax", "jaxlib", "jaxopt", "optax", "numpy")


def versions(ran: Iterable[str]) -> dict[str, str]:
    """Versions and machine, one column each; ``ran`` names the methods and peers."""
    used = [package for name in ran if name in PEERS for package in PEERS[name].packages]
    packages = {name: importlib.metadata.version(name) for name in (*_PACKAGES, *sorted(used))}
    return {
        "jaxclay": __version__,
        **packages,
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores",
        "dtype": "float64",
        "device": "cpu",
        "blas_threads": "1",
    }


def frame(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """The rows as a table, with the versions of what ran in every row."""
    return pd.DataFrame(rows).assign(**versions({row["method"] for row in rows}))


def save(table: pd.DataFrame, folder: Path) -> Path:
    """Write ``results.parquet``, whole or not at all."""
    path = folder / "results.parquet"
    with replacing(path) as temporary:
        table.to_parquet(temporary, index=False)
    return path


def answers(table: pd.DataFrame) -> pd.DataFrame:
    """The rows that the printed table shows: default settings, of what takes the scene."""
    refused = table.method.isin(list(PEERS)) & (table.status == "skipped")
    return select(table, (table.experiment == "answer") & ~refused)


def select(table: pd.DataFrame, mask: Any) -> pd.DataFrame:
    """The rows where ``mask`` holds."""
    return cast(pd.DataFrame, table[mask])


def groups(table: pd.DataFrame, by: str | list[str]) -> Iterable[Any]:
    """The value, or values, of the columns ``by`` and the rows that have it, in order."""
    return table.groupby(by, sort=True, dropna=False)


def records(table: pd.DataFrame) -> Iterable[Any]:
    """The rows, one by one, columns as attributes."""
    return table.itertuples()


def print_table(table: pd.DataFrame, console: Console) -> None:
    """One line an answer, a rule between scenes."""
    # Without a terminal there is no width to keep to.
    if not console.is_terminal:
        console.width = 150
    view = Table(title="jaxclay compare", box=None, pad_edge=False)
    for name, justify in COLUMNS.items():
        view.add_column(name, justify=justify, no_wrap=True)
    before = None
    for row in records(answers(table)):
        here = row.scene, row.units, row.slices
        first = tuple(map(str, here)) if here != before else ("", "", "")
        view.add_row(*first, *cells(row), end_section=False)
        before = here
    console.print(view)


COLUMNS: dict[str, Literal["left", "right"]] = {
    "scene": "left",
    "units": "left",
    "slices": "right",
    "method": "left",
    "status": "left",
    "gap / E_free": "right",
    "contour error": "right",
    "compile s": "right",
    "solve s": "right",
    "iterations": "right",
    "1993": "right",
}


def cells(row: Any) -> tuple[str, ...]:
    """A row's cells from "method" on."""
    if row.status == "skipped":
        return row.method, "skipped", "", "", "", "", "", ""
    paper = "0.3 s" if row.paper_1993_s == row.paper_1993_s else ""
    return (
        row.method,
        "below floor" if row.slack < -_ROUNDING else row.status,
        number(row.gap_relative, ".1e", "not certified"),
        number(row.contour_error, ".1e", ""),
        f"{row.compile_s:.2f}",
        number(row.solve_s, ".2e", ""),
        f"{int(row.iterations)}",
        paper,
    )


def number(value: float, spec: str, otherwise: str) -> str:
    """The value formatted, or what stands for a missing one."""
    return format(value, spec) if value == value else otherwise


def skipped(table: pd.DataFrame) -> list[str]:
    """What was skipped and why: scenes once a grid, and what a peer refused once."""
    rows = select(table, table.status == "skipped")
    whole = select(rows, ~rows.method.isin(list(PEERS)))
    whole = whole.drop_duplicates(subset=["scene", "units", "slices"])
    refused = select(rows, rows.method.isin(list(PEERS)) & ~rows.reason.isin(whole.reason))
    counts = refused.groupby("method", sort=False).reason.agg(["first", "size"])
    return [
        *(f"{r.scene} ({r.units}, {r.slices} slices): {r.reason}" for r in records(whole)),
        *(f"{r.Index} on {r.size} scenes and grids: it {r.first}" for r in records(counts)),
    ]
