"""``report.html`` of a sweep: charts, medians, what ran on what, from results alone."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import escape
from pathlib import Path

import numpy as np
import pandas as pd

from jaxclay.experiments.compare.report import save_charts, save_page
from jaxclay.experiments.compare.results import groups, number, select
from jaxclay.experiments.sweep.charts import prepared, throughput_charts, timing_charts
from jaxclay.experiments.sweep.heat import failure_charts
from jaxclay.experiments.sweep.load import curves, table
from jaxclay.experiments.sweep.statistics import HIGH, SHIFT, shifted_geometric_mean
from jaxclay.experiments.sweep.store import experiments

_KINDS = {
    "timing": "Timing runs: one task at a time on one core, repeated, compiling apart, each "
    "machine and each version of the solvers by itself.",
    "throughput": "Throughput runs: many tasks at once. Their seconds are shares of compiled calls "
    "beside which others ran, so that none are drawn here or compared with those of timing runs.",
}
_WHERE = ("host", "processor", "machine", "device", "dtype", "jaxclay", "jax", "jaxlib", "jaxopt",
          "optax", "numpy", "python")  # fmt: skip
# What seconds depend on: where, and with which versions.
_PLACE, _VERSIONS = ["host", "processor", "device"], ["jaxclay", "jax", "jaxlib"]
_BY = ["units", "slices", "elements", "tolerance", "series", "settings"]


def write(folder: Path) -> list[Path]:
    """Write the charts as PNG and ``report.html``; returns the paths.

    Raises
    ------
    ValueError
        There are no results in the folder.
    """
    everything = prepared(table(folder))
    traces = curves(folder)
    written: list[Path] = []
    ran = experiments(folder)
    body = f"<p>{_summary(everything, ran)}</p>"
    for kind, heading, prefix, rows in _sections(everything):
        drawn = [
            (f"{prefix}-{name}", caption, figure)
            for name, caption, figure in _charts(kind, rows, traces)
        ]
        paths, figures = save_charts(drawn, folder)
        written += paths
        body += f"<h2>{escape(heading)}</h2><p>{_KINDS[kind]}</p>{figures}"
        body += f"<h3>Medians</h3>{_explanation(kind, rows)}"
        body += f"<div class='wide figures'>{_medians(rows, kind)}</div>"
        body += _failures(rows)
    body += f"<h2>What ran on what</h2>{_what_ran(everything, ran)}"
    return [*written, save_page("jaxclay sweep", body, folder)]


def _sections(rows: pd.DataFrame) -> Iterator[tuple[str, str, str, pd.DataFrame]]:
    """Kind, heading, beginning of the charts' names and rows: times of each machine apart."""
    for kind in _KINDS:
        those = select(rows, rows.kind == kind)
        if those.empty:
            continue
        parts = [part for _, part in groups(those, [*_PLACE, *_VERSIONS])]
        if kind == "throughput" or len(parts) == 1:
            yield kind, kind.capitalize(), kind, those
            continue
        for i, part in enumerate(parts, 1):
            yield kind, f"{kind.capitalize()} {_apart(part, those)}", f"{kind}-{i}", part


def _apart(part: pd.DataFrame, whole: pd.DataFrame) -> str:
    """In words the machine and the versions that tell one part of the rows from others."""
    places = [part[name].iloc[0] for name in _PLACE if len(set(whole[name])) > 1]
    versions = [f"{name} {part[name].iloc[0]}" for name in _VERSIONS if len(set(whole[name])) > 1]
    told = zip(("on", "with"), (places, versions), strict=True)
    return " ".join(f"{word} {', '.join(names)}" for word, names in told if names)


def _charts(kind: str, rows: pd.DataFrame, traces):
    tried = select(rows, rows.status != "skipped")
    if tried.empty:
        return
    if kind == "timing":
        yield from timing_charts(tried, traces)
    else:
        yield from throughput_charts(tried)
    yield from failure_charts(rows)


def _summary(rows: pd.DataFrame, names: list[str]) -> str:
    counts = rows.status.value_counts()
    listed = ", ".join(f"{count} {escape(str(status))}" for status, count in counts.items())
    missing = int((rows.energy_minimum.isna() & (rows.status != "skipped")).sum())
    pooled = f" Results of {len(names)} experiments are pooled here: {escape(', '.join(names))}."
    return (
        f"{len(rows)} tasks on {rows.recipe.nunique()} scenes: {listed}. "
        f"{missing} answers have no certified minimum to be measured from."
        f"{pooled if len(names) > 1 else ''}"
    )


def _explanation(kind: str, rows: pd.DataFrame) -> str:
    times = (
        f"Milliseconds are of the compiled call alone; the shifted geometric mean adds "
        f"{SHIFT * 1e3:g} ms before it takes logarithms, and the last column holds the time that "
        f"{HIGH:.0%} of the tasks stay below. "
        if kind == "timing"
        else ""
    )
    certified = select(rows, rows.energy_minimum.notna())
    references = "; ".join(
        f"{escape(str(who))} for {escape(', '.join(part.series.unique()))}"
        for who, part in groups(certified, "reference")
    )
    return (
        f"<p>{times}Gaps are over E_free, measured from the minimum of another method than the "
        f"row's, which the certificate accepts ({references or 'none here'}). Where it accepts "
        "none, a column uncertified counts the task and the medians are without it.</p>"
    )


def _medians(rows: pd.DataFrame, kind: str) -> str:
    timing = kind == "timing"
    names = ["units", "slices", "method", "settings", "tasks", "certified", "skipped"]
    names += ["gap / E_free", "contour error / l", "from the continuum / l", "iterations"]
    names += ["median ms", "shifted mean ms", "90% ms"] if timing else []
    names += ["uncertified"]
    lines = []
    for by, part in sorted(groups(rows, _BY), key=_order):
        units, slices, elements, tolerance, series, settings = by
        size = f"{slices}" if slices else f"{elements} spans" if elements else f"to {tolerance:g}"
        lines.append([units, size, series, settings, *_figures(part, timing)])
    columns = [[name, *cells] for name, *cells in zip(names, *lines, strict=True) if any(cells)]
    head, *lines = zip(*columns, strict=True)
    head = "".join(f"<th class=l>{name}</th>" for name in head)
    body = "</tr><tr>".join("".join(_cell(text) for text in line) for line in lines)
    return f"<table><tr>{head}</tr><tr>{body}</tr></table>"


def _order(group) -> tuple:
    """As the columns stand, settings by their values."""
    (*before, settings), _ = group
    return *before, [float(value) for value in re.findall("=([^,]+)", settings)]


def _figures(part: pd.DataFrame, timing: bool) -> list[str]:
    tried = select(part, part.status != "skipped")
    certified = (tried.status == "converged").mean()
    figures = [
        f"{len(part)}",
        number(certified, ".0%", ""),
        f"{len(part) - len(tried) or ''}",
        _median(tried.gap_relative) or "none certified",
        _median(tried.contour_error),
        _median(tried.contour_error_continuum),
        number(tried.iterations.astype(float).median(), ".0f", ""),
    ]
    if timing:
        times = tried.solve_s
        values = times.median(), shifted_geometric_mean(times), times.quantile(HIGH)
        figures += [number(value * 1e3, ".3g", "") for value in values]
    return [*figures, f"{int(tried.energy_minimum.isna().sum()) or ''}"]


def _median(errors: pd.Series) -> str:
    """Of the errors that are known; nothing where none is."""
    known = np.abs(errors.dropna())
    return f"{np.median(known):.1e}" if len(known) else ""


def _cell(text: object) -> str:
    return f"<td class=l>{escape(str(text))}</td>"


def _failures(rows: pd.DataFrame) -> str:
    """How tasks ended that were not certified, and an example of each."""
    others = select(rows, rows.status != "converged")
    if others.empty:
        return ""
    lines = "".join(
        f"<tr>{_cell(series)}{_cell(status)}{_cell(len(part))}{_cell(part.task.iloc[0])}"
        f"{_cell(part.reason.iloc[0])}</tr>"
        for (series, status), part in groups(others, ["series", "status"])
    )
    head = "".join(f"<th class=l>{name}</th>" for name in
                   ("method", "ended as", "tasks", "for example", "why"))  # fmt: skip
    return f"<h3>Not certified</h3><div class=wide><table><tr>{head}</tr>{lines}</table></div>"


def _what_ran(rows: pd.DataFrame, names: list[str]) -> str:
    """Experiments by name; machines and versions, with what each of them ran."""
    files = escape(", ".join(names))
    named = f"<p>Experiments, as kept in the folder experiments: {files}.</p>" if files else ""
    tables = []
    for values, part in groups(rows, [*_WHERE]):
        ran = groups(part, ["kind", "scheme", "method"])
        listed = ", ".join(f"{len(same)} {' '.join(names)}" for names, same in ran)
        cores = " or ".join(f"{int(n)}" for n in sorted(part.cores.dropna().unique()))
        pins = sorted(int(pin) for pin in part.pinned.dropna().unique() if pin >= 0)
        held = f"; timing held on core {', '.join(map(str, pins))}" if pins else ""
        lines = [
            *zip(_WHERE, values, strict=True),
            ("tasks", listed),
            ("processes", f"{part.process.nunique()}, each of {cores} cores{held}"),
            ("finished", f"{part.finished.min()} to {part.finished.max()}"),
        ]
        cells = "".join(f"<tr>{_cell(name)}{_cell(value)}</tr>" for name, value in lines)
        tables.append(f"<table>{cells}</table>")
    return named + "<br>".join(tables)
