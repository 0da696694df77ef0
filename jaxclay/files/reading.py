"""Bytes of a table of numbers to rows of cells: encoding, comments, separator, quotes.

What was taken for what is told in words; what cannot be told apart is refused by its line.
"""

from __future__ import annotations

import codecs
import csv
import dataclasses
import re
from typing import NamedTuple

MOST_BYTES = 2**28
_BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8", ""),
    (codecs.BOM_UTF32_LE, "utf-32", "UTF-32"),
    (codecs.BOM_UTF32_BE, "utf-32", "UTF-32"),
    (codecs.BOM_UTF16_LE, "utf-16", "UTF-16"),
    (codecs.BOM_UTF16_BE, "utf-16", "UTF-16"),
)
# In the order in which they are taken where two split a table as well.
_SEPARATORS = {"\t": "tabs", ";": "semicolons", "|": "bars", " ": "blanks", ",": "commas"}
_CONTROL = re.compile(r"[\x00-\x08\x0e-\x1f\x7f]")
_SEP = re.compile(r'"?sep=(\\t|.)"?', re.IGNORECASE)
_BLANKS = re.compile(r'"(?:[^"]|"")*"|[^\s"]+(?:\s+[(\[][^)\]]*[)\]])?')
_LIKE_A_NUMBER = re.compile(
    r"[-+\u2212\u2013]?(\d[\d.,]*|[.,]\d+)(?<!,)([eE][-+]?\d+)?"
    r"|[1-9]\d{0,2}([ '\u2019\xa0\u202f]\d{3})+([.,]\d+)?"
    r"|[-+]?(nan|inf)|\d[\d.,]* ?(mm|cm|m|in|px)",
    re.ASCII | re.IGNORECASE,
)
_SAMPLE = 500  # rows that a separator is found by
_QUOTED_LINES = 3  # that a cell in quotes may reach over


class Row(NamedTuple):
    """A line of the table, its number, and whether its first cell is quoted."""

    line: int
    cells: list[str]
    quoted: bool


@dataclasses.dataclass(frozen=True)
class Table:
    """The rows of a file as cells, without comments and empty lines.

    Attributes
    ----------
    rows : list of Row
        Without empty cells at their ends.
    comments : list of (line, text)
    separator : str
        One character; a blank for any number of them.
    told : list of str
        Encoding and separator.
    """

    rows: list[Row]
    comments: list[tuple[int, str]]
    separator: str
    told: list[str]


def read_table(data: bytes) -> Table:
    """The rows of a file's bytes; a ValueError names the line that is wrong."""
    text, encoding = _decoded(data)
    lines, comments, separator = _lines(text)
    if separator is None:
        separator = _separator([line for _, line in lines[:_SAMPLE]])
    rows = []
    for number, line in lines:
        try:
            cells = split(line, separator)
        except csv.Error as error:
            raise ValueError(f"line {number} is no row of a table: {error}") from None
        if cells:
            rows.append(Row(number, cells, line.lstrip().startswith('"')))
    told = ([encoding] if encoding else []) + [_SEPARATORS.get(separator, repr(separator))]
    return Table(rows, comments, separator, told)


def like_a_number(cell: str) -> bool:
    """Whether a cell may be meant as a number, in whatever way it is written."""
    return _LIKE_A_NUMBER.fullmatch(cell) is not None


def split(line: str, separator: str) -> list[str]:
    """The cells of a line, without empty ones at its end."""
    if separator == " ":
        cells = [cell.strip('"') for cell in _BLANKS.findall(line)]
    else:
        cells = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    cells = [" ".join(cell.split()) for cell in cells]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _decoded(data: bytes) -> tuple[str, str]:
    """The text, and its encoding where that is not UTF-8."""
    if len(data) > MOST_BYTES:
        raise ValueError(f"larger than any profile: more than {MOST_BYTES // 2**20} MiB")
    if data.startswith(b"PK\x03\x04"):
        raise ValueError("a workbook (xlsx, ods), no text: save its sheet as CSV")
    marked = [found for found in _BYTE_ORDER_MARKS if data.startswith(found[0])]
    pairs = max(len(data) // 2, 1)
    low, high = data[1::2].count(0) / pairs, data[0::2].count(0) / pairs
    if marked:
        _, codec, name = marked[0]
    elif max(low, high) > 0.4 and min(low, high) < 0.1:  # ASCII in pairs of bytes
        codec, name = ("utf-16-le" if low > high else "utf-16-be"), "UTF-16"
    else:
        codec, name = "utf-8", ""
    try:
        text = data.decode(codec)
    except UnicodeDecodeError as error:
        if name or marked:
            raise ValueError(f"{name or 'UTF-8'}, as it begins, but damaged: {error}") from None
        text, name = data.decode("cp1252", errors="replace"), "Latin-1"
    text = text.removeprefix("\ufeff").rstrip("\x1a")  # the end of a file in DOS
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if wrong := _CONTROL.search(text):
        line = text.count("\n", 0, wrong.start()) + 1
        raise ValueError(
            f"line {line}: a byte {ord(wrong.group())}, which no text has: the file is not a table "
            "of numbers, or was damaged when it was written. Save it anew as CSV"
        )
    return text, name


def _lines(text: str) -> tuple[list[tuple[int, str]], list[tuple[int, str]], str | None]:
    """Lines with their numbers, comments, and the separator that a line ``sep=`` names."""
    lines: list[tuple[int, str]] = []
    comments: list[tuple[int, str]] = []
    separator = None
    everything = text.split("\n")
    raw = iter(enumerate(everything, 1))
    for number, line in raw:
        stripped = line.strip()
        if not lines and (named := _SEP.fullmatch(stripped)):
            separator = "\t" if named[1] == "\\t" else named[1]
            continue
        # A column of numbers may be called #.
        if stripped.startswith("%") or re.match(r"#(?!\s*[,;\t])", stripped):
            comments.append((number, stripped.lstrip("#% ")))
            continue
        more = _rest_of_cell(everything[number - 1 : number - 1 + _QUOTED_LINES])
        for _ in range(more):
            line += " " + next(raw)[1]
        line = _without_comment(line)
        if line.strip():
            lines.append((number, line))
    return lines, comments, separator


def _rest_of_cell(lines: list[str]) -> int:
    """How many more lines the quotes of the first reach over."""
    if lines[0].count('"') % 2:
        for i, line in enumerate(lines[1:], 1):
            if line.count('"') % 2:
                return i
    return 0


def _without_comment(line: str) -> str:
    """The line up to a # that is in no quotes and heads no column."""
    quoted = False
    for i, character in enumerate(line):
        if character == '"':
            quoted = not quoted
        elif character == "#" and not quoted and line[:i].strip():
            return line[:i]
    return line


def _separator(lines: list[str]) -> str:
    """What splits the most lines into numbers and nothing else."""

    def score(separator: str) -> float:
        total = 0.0
        for line in lines:
            try:
                cells = split(line, separator)
            except csv.Error:
                continue
            numbers = sum(map(like_a_number, cells))
            total += (numbers / len(cells)) if numbers > 1 else 0.0
        return total

    scores = {separator: score(separator) for separator in _SEPARATORS}
    best = max(scores.values())
    if best == 0:
        raise ValueError(
            "no numbers: a profile is a table of height and radius, a row for each height, and no "
            "line has two numbers"
            if lines
            else "the file is empty"
        )
    return next(separator for separator, found in scores.items() if found == best)
