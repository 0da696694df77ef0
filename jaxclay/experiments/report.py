"""``report.html``: a summary, the charts, every row and what ran on what, from results alone."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jinja2
import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import pandas as pd

from jaxclay.experiments import summary
from jaxclay.experiments.charts.marks import Mark
from jaxclay.experiments.charts.series import prepared
from jaxclay.experiments.charts.standard import all_charts
from jaxclay.experiments.frames import groups, records, select
from jaxclay.experiments.peers import PEERS
from jaxclay.experiments.results import curves, table
from jaxclay.experiments.store import experiments
from jaxclay.files.output import check_folder
from jaxclay.files.replacing import replacing
from jaxclay.methods import METHODS

_TEMPLATE = Path(__file__).parent / "report.html.jinja"
CHARTS = "charts"  # folder of the pictures
_KINDS = {
    "timing": "One task at a time on one core, repeated, compiling apart.",
    "throughput": "Many tasks at once. Their seconds are shares of compiled calls beside which "
    "others ran, so that none are drawn here or compared with those of timing runs.",
}
_WHERE = ("host", "processor", "machine", "device", "blas_threads", "xla_threads", "jaxclay",
          "code", "jax", "jaxlib", "jaxopt", "optax", "numpy", "python")  # fmt: skip
# What seconds depend on: where, and with which versions.
_PLACE, _VERSIONS = ["host", "processor", "device"], ["jaxclay", "code", "jax", "jaxlib"]


def write(folder: Path, out: Path | None = None, keys: set[str] | None = None) -> list[Path]:
    """Write ``report.html``, the charts as PNG and ``results.parquet``; returns the paths.

    They go into ``out``, the folder itself if not given; pictures of an earlier report go.
    ``keys`` are those of the tasks that are shown; all if not given.

    Raises
    ------
    ValueError
        There are no results in the folder.
    OSError
        They cannot be written.
    """
    out = folder if out is None else out
    check_folder(out)
    rows = prepared(table(folder))
    rows = rows if keys is None else select(rows, rows.key.isin(list(keys)))
    shapes, ran = curves(folder), experiments(folder)
    pictures = out / CHARTS
    pictures.mkdir(parents=True, exist_ok=True)
    for old in pictures.glob("*.png"):
        old.unlink()
    written: list[Path] = []
    sections = [
        {
            "heading": heading, "about": _KINDS[kind], "summary": _lines(part),
            "references": _references(part), "failures": _failures(part),
            "charts": list(_drawn(kind, prefix, part, shapes, pictures, written)),
        }
        for kind, heading, prefix, part in _sections(rows)
    ]  # fmt: skip
    names = sorted({name.rpartition("-")[0] for name in ran})
    lines = [(summary.cells(row), row.reason or "") for row in records(rows)]
    page = _template().render(
        title=f"jaxclay: {', '.join(names) or 'results'}",
        told=_told(rows, ran), sections=sections, columns=summary.ROWS, numbers=summary.NUMBERS,
        rows=lines, methods=_named(rows), marks=list(Mark), ran=_ran(rows), experiments=ran,
    )  # fmt: skip
    with replacing(out / "report.html") as temporary:
        temporary.write_text(page, encoding="utf-8")
    with replacing(out / "results.parquet") as temporary:
        rows.drop(columns=["way", "family", "problem", "series"]).to_parquet(temporary, index=False)
    return [out / "report.html", out / "results.parquet", *written]


def _template() -> jinja2.Template:
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    return environment.from_string(_TEMPLATE.read_text(encoding="utf-8"))


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


def _drawn(kind, prefix, rows, shapes, folder: Path, written: list[Path]) -> Iterator[dict]:
    """Each chart as SVG with its caption; as a picture in the folder too."""
    for name, caption, figure in all_charts(kind, rows, shapes):
        path = folder / f"{prefix}-{name}.png"
        with replacing(path) as temporary:
            figure.savefig(temporary, dpi=120)
        written.append(path)
        figure.set_layout_engine("none")  # everything has its place by now
        text = io.StringIO()
        figure.savefig(text, format="svg")
        plt.close(figure)
        svg = text.getvalue()
        yield {"svg": svg[svg.index("<svg") :], "caption": caption}


def _lines(rows: pd.DataFrame) -> list[summary.Line]:
    """The summary without columns that are empty."""
    lines = summary.summary(rows)
    kept = [name for name in lines[0] if any(line[name] for line in lines)] if lines else []
    return [{name: line[name] for name in kept} for line in lines]


def _told(rows: pd.DataFrame, names: list[str]) -> str:
    counts = rows.status.value_counts()
    listed = ", ".join(f"{count} {status}" for status, count in counts.items())
    missing = int((rows.energy_minimum.isna() & (rows.status != "skipped")).sum())
    pooled = f" Results of {len(names)} experiments are pooled here: {', '.join(names)}."
    return (
        f"{len(rows)} tasks on {rows.specification.nunique()} scenes: {listed}. "
        f"{missing} answers have no certified minimum to be measured from."
        f"{pooled if len(names) > 1 else ''}"
    )


def _references(rows: pd.DataFrame) -> str:
    certified = select(rows, rows.energy_minimum.notna())
    parts = groups(certified, "reference")
    return "; ".join(f"{who} for {', '.join(part.method.unique())}" for who, part in parts)


def _failures(rows: pd.DataFrame) -> list[tuple[Any, ...]]:
    """How tasks ended that were not certified, how many, and an example of each."""
    others = select(rows, rows.status != "converged")
    return [
        (family, status, len(part), part.task.iloc[0], part.reason.iloc[0] or "")
        for (family, status), part in groups(others, ["family", "status"])
    ]


def _named(rows: pd.DataFrame) -> list[tuple[str, str]]:
    """What the methods and the peers are."""
    known: dict[str, Any] = METHODS | PEERS
    return [(name, known[name].summary) for name in rows.method.unique() if name in known]


def _ran(rows: pd.DataFrame) -> list[list[tuple[str, str]]]:
    """Machines and versions, with what each of them ran."""
    found = []
    for values, part in groups(rows, [*_WHERE]):
        ran = groups(part, ["kind", "family"])
        pins = sorted(int(pin) for pin in part.pinned.dropna().unique() if pin >= 0)
        held = f"; timing held on core {', '.join(map(str, pins))}" if pins else ""
        cores = " or ".join(f"{int(n)}" for n in sorted(part.cores.dropna().unique()))
        peers = sorted(set(part.packages.dropna()) - {""})
        found.append([
            *((name, str(value)) for name, value in zip(_WHERE, values, strict=True)),
            *([("peers", ", ".join(peers))] if peers else []),
            ("tasks", ", ".join(f"{len(same)} {' '.join(names)}" for names, same in ran)),
            ("processes", f"{part.process.nunique()}, each of {cores} cores{held}"),
            ("finished", f"{part.finished.min()} to {part.finished.max()}"),
        ])  # fmt: skip
    return found
