"""Results of a folder as tables: pandas for numbers, xarray for curves."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import xarray as xr

from jaxclay.experiments.columns import COLUMNS, CURVES, SCHEMA
from jaxclay.experiments.store import parts, read_part

# Missing where a task was skipped; of one type all the same, whether or not there is such a task.
_MAY_MISS = {
    "iterations": "Int64",
    "unknowns": "Int64",
    "floored": "boolean",
    "positive": "boolean",
}
_OLD = {"recipe": "specification", "dtype": "precision"}  # columns of 0.1.0
_ALONG = {"contour": "point", "before": "point_before", "start": "point_start", "trace": "stop"}
_LABELS = ("key", "kind", "scene", "number", "units", "scheme", "spacing", "degree", "slices",
           "elements", "tolerance", "method", "settings", "precision")  # fmt: skip


def table(folder: str | Path) -> pd.DataFrame:
    """A row for each task that is done; see :func:`jaxclay.experiments.load`."""
    whole = _read(Path(folder), COLUMNS).to_pandas()
    order = ["kind", *_LABELS[5:-2], "method", "settings", "precision", "scene", "number", "key"]
    order = list(dict.fromkeys(order))
    found = whole.drop_duplicates(subset="key").sort_values(order, ignore_index=True)
    found = found.astype(_MAY_MISS)
    found.attrs["units"] = {name: text for name, (_, text) in COLUMNS.items()}
    return found


def curves(folder: str | Path) -> xr.Dataset:
    """The contours and traces of those tasks: :func:`jaxclay.experiments.load_curves`."""
    whole = _read(Path(folder), [*_LABELS, *CURVES]).to_pandas().drop_duplicates(subset="key")
    variables: dict[str, Any] = {}
    for name, (_, text) in CURVES.items():
        along = _ALONG[name.partition("_")[0]]
        variables[name] = (("task", along), _padded(list(whole[name])), {"description": text})
    labels = {
        name: ("task", whole[name].to_numpy(), {"description": COLUMNS[name][1]})
        for name in _LABELS
    }
    return xr.Dataset(variables, coords=labels)


def _read(folder: Path, columns) -> pa.Table:
    found = []
    for path in parts(folder):
        try:
            found.append(_renamed(read_part(path, [*columns, *_OLD])))
        except (OSError, pa.ArrowException) as error:
            warnings.warn(
                f"{path} is damaged and left out ({str(error).splitlines()[0]}): the next "
                "jaxclay sweep on this folder does its tasks again",
                stacklevel=4,
            )
    if not found:
        raise ValueError(f"no readable results in {folder}: run jaxclay sweep on it again")
    found.append(SCHEMA.empty_table().select(list(columns)))  # what older files do not have
    return pa.concat_tables(found, promote_options="default")


def _renamed(part: pa.Table) -> pa.Table:
    return part.rename_columns([_OLD.get(name, name) for name in part.column_names])


def _padded(rows: list[Any]) -> np.ndarray:
    """Rows of different lengths as one array, filled up with NaN."""
    rows = [() if row is None else row for row in rows]
    longest = max((len(row) for row in rows), default=0)
    whole = np.full((len(rows), longest), np.nan)
    for i, row in enumerate(rows):
        whole[i, : len(row)] = row
    return whole
