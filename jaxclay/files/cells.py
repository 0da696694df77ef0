"""Cells of a table to numbers: decimal points or commas, and nothing that is guessed."""

from __future__ import annotations

import re

import numpy as np

from jaxclay.files.units import unit_named

_PLAIN = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_THOUSAND = re.compile(r"[-+]?[1-9]\d{0,2},\d{3}", re.ASCII)  # or three decimals
_GROUPED = re.compile(
    r"[-+]?\d{1,3}(([.,'\u2019 ]\d{3}){2,}|[ '\u2019]\d{3})([.,]\d*)?|[-+]?\d{1,3}(,\d{3})+\.\d*"
    r"|[-+]?\d{1,3}(\.\d{3})+,\d*",
    re.ASCII,
)
_MINUS = str.maketrans({"\N{MINUS SIGN}": "-", "\N{EN DASH}": "-", "\xa0": " ", "\u202f": " "})
Cell = tuple[int, str, str]  # line, what it is, text


def numbers_of(cells: list[Cell]) -> tuple[np.ndarray, bool]:
    """The numbers in cells, and whether they have decimal commas.

    Raises
    ------
    ValueError
        The first cell that is empty, no number, not finite, or has thousands separators or a comma
        that may be one, by its line.
    """
    cells = [(line, what, text.translate(_MINUS).strip()) for line, what, text in cells]
    commas = _decimal_commas(cells)
    return np.array([_number(cell, commas) for cell in cells]), commas


def _decimal_commas(cells: list[Cell]) -> bool:
    for line, what, text in cells:
        if _GROUPED.fullmatch(text):
            raise ValueError(
                f"line {line}: {what} {text!r} has thousands separators: write numbers without them"
            )
    having = [cell for cell in cells if "," in cell[2]]
    if not having:
        return False
    line, what, text = having[0]
    points = [cell for cell in cells if "." in cell[2]]
    if points:
        raise ValueError(
            f"line {line}: {what} {text!r} has a comma, but line {points[0][0]} has "
            f"{points[0][2]!r} with a point: write all decimals in one way, and no thousands "
            "separators"
        )
    if all(_THOUSAND.fullmatch(text) for _, _, text in having):
        plain = text.replace(",", "")
        raise ValueError(
            f"line {line}: {what} {text!r} may be {plain} with a thousands separator or "
            f"{text.replace(',', '.')} with a decimal comma, and no other cell tells: write it as "
            "one of the two"
        )
    return True


def _number(cell: Cell, commas: bool) -> float:
    line, what, text = cell
    if not text:
        raise ValueError(f"line {line}: {what} is empty: fill the cell, or take the line out")
    plain = text.replace(",", ".") if commas else text
    value = float(plain) if _PLAIN.fullmatch(plain) else float("nan")
    if not np.isfinite(value):
        measured = re.fullmatch(r"[-+\d.,]+\s*(\D+)", text)
        cure = "take the line out, or write a number"
        if measured and (unit := unit_named(measured[1])):
            cure = f"write the unit in the header, {what} ({unit})"
        raise ValueError(f"line {line}: {what} {text!r} is not a finite number: {cure}")
    return value
