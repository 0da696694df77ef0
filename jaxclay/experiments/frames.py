"""Small helpers for tables of results, typed for pyright."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

import pandas as pd


def select(table: pd.DataFrame, mask: Any) -> pd.DataFrame:
    """The rows where ``mask`` holds."""
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
