"""Names and looks of the lines: a method on a scheme, and its settings where there are several."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from jaxclay.experiments.contestants import contestant
from jaxclay.experiments.frames import groups, select
from jaxclay.files.plots import COLOURS

_MOST = 3  # settings of a method that get a line each; of a longer ladder one is taken
SCHEMES = {"paper": "paper's sums", "equal": "equal slices", "placed": "placed slices",
           "spline": "splines"}  # fmt: skip
DERIVED = ("way", "family", "problem", "series")  # columns that are added


def prepared(table: pd.DataFrame) -> pd.DataFrame:
    """The rows with columns for their family, method and scheme, and for their problem."""
    way = np.where(table.scheme == "slices", table.spacing, table.scheme)
    told = pd.Series([SCHEMES.get(one, one) for one in way], table.index)
    family = table.method + np.where(table.scheme == "paper", "", " (" + told + ")")
    family += np.where(table.precision == "float64", "", ", " + table.precision)
    size = table.slices.astype(str) + "-" + table.elements.astype(str)
    size += "-" + table.tolerance.astype(str) + "-" + table.degree.astype(str)
    found = table.assign(
        way=way, family=family, problem=table.specification + "-" + size + "-" + way,
        series=family,
    )  # fmt: skip
    found.attrs = {}  # or pandas copies them at every step
    return found


def told_apart(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows with a series for each of a method's settings.

    Of a ladder with more than a few the default is taken, or what is tightest.
    """
    parts = []
    for family, part in groups(rows, "family"):
        settings = sorted(part.settings.unique(), key=_tightness)
        if len(settings) > _MOST:
            settings = [""] if "" in settings else settings[:1]
        kept = select(part, part.settings.isin(settings))
        several = len(settings) > 1
        named = (family + " " + kept.settings.replace("", "default")) if several else family
        parts.append(kept.assign(series=named))
    return pd.concat(parts) if parts else rows


def default_rows(rows: pd.DataFrame) -> pd.DataFrame:
    """Those with the methods' own settings; all of a method that was run with others alone."""
    own = rows.settings == ""
    return select(rows, own | ~rows.family.isin(rows.family[own]))


def _tightness(settings: str) -> list[Any]:
    return [float(one.partition("=")[2] or "inf") for one in settings.split(", ")]


def style(series: str) -> dict[str, Any]:
    """Colour, marker and line: a method's own in all charts, hollow or dashed on other schemes."""
    looks = contestant(series.split(" ")[0].rstrip(","))
    found = {
        "label": series, "markersize": 5, "linewidth": 1.3, "linestyle": looks.line,
        "color": COLOURS[looks.colour], "marker": looks.marker,
    }  # fmt: skip
    if looks.line == "--":  # a peer
        found["markerfacecolor"] = "white"
    if "splines" in series:
        found |= {"linestyle": "--", "markerfacecolor": "white"}
    elif "slices)" in series:
        found |= {"linestyle": ":" if "equal" in series else "-", "markerfacecolor": "white"}
    return found
