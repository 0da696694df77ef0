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
from jaxclay.experiments.charts.shared import DERIVED, Mark, prepared
from jaxclay.experiments.charts.standard import all_charts
from jaxclay.experiments.peers import PEERS
from jaxclay.experiments.results import curves, groups, records, select, table
from jaxclay.experiments.store import experiments
from jaxclay.files.output import check_folder
from jaxclay.files.replacing import replacing
from jaxclay.methods import METHODS

_TEMPLATE = Path(__file__).parent / "report.html.jinja"
_KINDS = {
    "timing": "One task at a time on one core, repeated, compiling apart.",
    "throughput": "Many tasks at once. Their seconds are shares of compiled calls beside which "
    "others ran, so that none are drawn here or compared with those of timing runs.",
}
_WHERE = ("host", "processor", "machine", "device", "blas_threads", "xla_threads", "jaxclay",
          "code", "jax", "jaxlib", "jaxopt", "optax", "numpy", "python")  # fmt: skip
# What seconds depend on: where, and with which versions.
_PLACE, _VERSIONS = ["host", "processor", "device"], ["jaxclay", "code", "jax", "jaxlib"]


def shown(folder: Path, keys: set[str] | None = None) -> pd.DataFrame:
    """The rows of a folder's tasks with those keys, or of all, as the report takes them."""
    rows = prepared(table(folder))
    return rows if keys is None else select(rows, rows.key.isin(list(keys)))


def write(folder: Path, out: Path | None = None, rows: pd.DataFrame | None = None) -> list[Path]:
    """Write ``report.html``, the charts as PNG and ``results.parquet``; returns the paths.

    They go into ``out``, the folder itself if not given; pictures of an earlier report go.
    ``rows`` are those of :func:`shown`; all if not given.

    Raises ValueError: There are no results in the folder; OSError: They cannot be written.
    """
    out = out or folder
    check_folder(out)
    rows = shown(folder) if rows is None else rows
    shapes, ran = curves(folder), experiments(folder)
    pictures = out / "charts"
    pictures.mkdir(parents=True, exist_ok=True)
    for old in pictures.glob("*.png"):
        old.unlink()
    sections = []
    for kind, heading, prefix, part in _sections(rows):
        measured = groups(select(part, part.energy_minimum.notna()), "reference")
        others = groups(select(part, part.status != "converged"), ["family", "status"])
        sections.append({
            "heading": heading, "about": _KINDS[kind], "summary": summary.summary(part),
            "references": "; ".join(
                f"{who} for {', '.join(those.method.unique())}" for who, those in measured
            ),
            # How tasks ended that were not certified, how many, and an example of each.
            "failures": [(*ended, len(those), those.task.iloc[0], those.reason.iloc[0] or "")
                         for ended, those in others],
            "charts": list(_drawn(all_charts(kind, part, shapes), pictures / prefix)),
        })  # fmt: skip
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    known: dict[str, Any] = METHODS | PEERS
    page = environment.from_string(_TEMPLATE.read_text(encoding="utf-8")).render(
        names=sorted({name.rpartition("-")[0] for name in ran}), experiments=ran,
        counts=rows.status.value_counts().to_dict(), scenes=rows.specification.nunique(),
        unmeasured=int((rows.energy_minimum.isna() & (rows.status != "skipped")).sum()),
        sections=sections, columns=summary.ROWS, numbers=summary.NUMBERS,
        rows=[(summary.cells(row), row.reason or "") for row in records(rows)], marks=list(Mark),
        methods=[(name, known[name].summary) for name in rows.method.unique() if name in known],
        ran=list(_ran(rows)),
    )  # fmt: skip
    with replacing(out / "report.html") as temporary:
        temporary.write_text(page, encoding="utf-8")
    with replacing(out / "results.parquet") as temporary:
        rows.drop(columns=list(DERIVED)).to_parquet(temporary, index=False)
    return [out / "report.html", out / "results.parquet", *pictures.glob("*.png")]


def _sections(rows: pd.DataFrame) -> Iterator[tuple[str, str, str, pd.DataFrame]]:
    """Kind, heading, beginning of the charts' names and rows: times of each machine apart."""
    for kind in _KINDS:
        those = select(rows, rows.kind == kind)
        parts = [part for _, part in groups(those, [*_PLACE, *_VERSIONS])]
        if len(parts) == 1 or (parts and kind == "throughput"):
            yield kind, kind.capitalize(), kind, those
        elif kind == "timing":
            for i, part in enumerate(parts, 1):
                yield kind, f"Timing {_apart(part, those)}", f"timing-{i}", part


def _apart(part: pd.DataFrame, whole: pd.DataFrame) -> str:
    """In words the machine and the versions that tell one part of the rows from others."""
    places = [part[name].iloc[0] for name in _PLACE if len(set(whole[name])) > 1]
    versions = [f"{name} {part[name].iloc[0]}" for name in _VERSIONS if len(set(whole[name])) > 1]
    told = zip(("on", "with"), (places, versions), strict=True)
    return " ".join(f"{word} {', '.join(names)}" for word, names in told if names)


def _drawn(charts, prefix: Path) -> Iterator[dict[str, str]]:
    """Each chart as SVG with its caption; as a picture in the folder too."""
    for name, caption, figure in charts:
        with replacing(prefix.with_name(f"{prefix.name}-{name}.png")) as temporary:
            figure.savefig(temporary, dpi=120)
        figure.set_layout_engine("none")  # everything has its place by now
        text = io.StringIO()
        figure.savefig(text, format="svg")
        plt.close(figure)
        yield {"svg": text.getvalue().partition("<svg")[2], "caption": caption}


def _ran(rows: pd.DataFrame) -> Iterator[dict[str, str]]:
    """Machines and versions, with what each of them ran."""
    for values, part in groups(rows, [*_WHERE]):
        pins = sorted({int(pin) for pin in part.pinned.dropna() if pin >= 0})
        held = f"; timing held on core {', '.join(map(str, pins))}" if pins else ""
        cores = " or ".join(f"{n:.0f}" for n in sorted(part.cores.dropna().unique()))
        ran = part.groupby(["kind", "family"]).size().items()
        yield {
            **{name: str(value) for name, value in zip(_WHERE, values, strict=True)},
            "peers": ", ".join(sorted(set(part.packages.dropna()) - {""})),
            "tasks": ", ".join(f"{count} {' '.join(names)}" for names, count in ran),
            "processes": f"{part.process.nunique()}, each of {cores} cores{held}",
            "finished": f"{part.finished.min()} to {part.finished.max()}",
        }
