"""Results of a folder as tables: pandas for numbers, xarray for curves; and what reads them."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
import pyarrow as pa
import xarray as xr

from jaxclay.experiments.columns import COLUMNS, CURVES, SCHEMA
from jaxclay.experiments.store import parts, read_part

# Missing where a task was skipped; of one type all the same, whether or not there is such a task.
_MAY_MISS = {"iterations": "Int64", "unknowns": "Int64", "floored": "boolean",
             "positive": "boolean"}  # fmt: skip
_OLD = {"recipe": "specification", "dtype": "precision"}  # columns of 0.1.0
_ALONG = {"contour": "point", "before": "point_before", "start": "point_start", "trace": "stop"}
_LABELS = ("key", "kind", "scene", "number", "units", "scheme", "spacing", "degree", "slices",
           "elements", "tolerance", "method", "settings", "precision")  # fmt: skip
_ORDER = ["kind", *_LABELS[5:], "scene", "number", "key"]


def table(folder: str | Path) -> pd.DataFrame:
    """A row for each task that is done; see :func:`jaxclay.experiments.load`."""
    found = _read(Path(folder), COLUMNS).sort_values(_ORDER, ignore_index=True).astype(_MAY_MISS)
    found.attrs["units"] = {name: text for name, (_, text) in COLUMNS.items()}
    return found


def curves(folder: str | Path) -> xr.Dataset:
    """The contours and traces of those tasks: :func:`jaxclay.experiments.load_curves`."""
    whole = _read(Path(folder), [*_LABELS, *CURVES])
    variables: dict[str, Any] = {}
    for name, (_, text) in CURVES.items():  # rows of different lengths, filled up with NaN
        rows = [() if row is None else row for row in whole[name]]
        columns = np.array([*itertools.zip_longest(*rows, fillvalue=np.nan)], float)
        along = "task", _ALONG[name.partition("_")[0]]
        variables[name] = along, columns.reshape(-1, len(rows)).T, {"description": text}
    labels = {n: ("task", whole[n].to_numpy(), {"description": COLUMNS[n][1]}) for n in _LABELS}
    return xr.Dataset(variables, coords=labels)


def _read(folder: Path, columns) -> pd.DataFrame:
    """Those columns of all parts that can be read, each task once."""
    found = []
    for path in parts(folder):
        try:
            part = read_part(path, [*columns, *_OLD])
            found.append(part.rename_columns([_OLD.get(n, n) for n in part.column_names]))
        except (OSError, pa.ArrowException) as error:
            warnings.warn(
                f"{path} is damaged and left out ({str(error).splitlines()[0]}): the next "
                "jaxclay sweep on this folder does its tasks again",
                stacklevel=4,
            )
    if not found:
        raise ValueError(f"no readable results in {folder}: run jaxclay sweep on it again")
    found.append(SCHEMA.empty_table().select(list(columns)))  # what older files do not have
    whole = pa.concat_tables(found, promote_options="default").to_pandas()
    return whole.drop_duplicates(subset="key")


def select(table: pd.DataFrame, mask: Any) -> pd.DataFrame:
    """The rows where ``mask`` holds; typed for pyright, as the next two."""
    return cast(pd.DataFrame, table[mask])


def groups(table: pd.DataFrame, by: str | list[str]) -> Iterable[Any]:
    """The value, or values, of the columns ``by`` and the rows that have it, in order."""
    return table.groupby(by, sort=True, dropna=False)


def records(table: pd.DataFrame) -> Iterable[Any]:
    """The rows, one by one, columns as attributes."""
    return table.itertuples()


def number(value: Any, spec: str, otherwise: str = "") -> str:
    """The value formatted, or what stands for a missing one."""
    return otherwise if pd.isna(value) else format(value, spec)
