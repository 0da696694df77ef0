"""Which column of a table is the height and which the radius, in what unit."""

from __future__ import annotations

import csv
import dataclasses
import itertools
import re

from jaxclay.files.headers import ACROSS, HEIGHT, bare, named, one_of, rank_of
from jaxclay.files.reading import Row, Table, like_a_number, split
from jaxclay.files.units import UNITS, unit_named

_LONGEST = 1000  # characters of a comment that may be a header


@dataclasses.dataclass(frozen=True)
class Columns:
    """Where a table has height and radius.

    Attributes
    ----------
    height, across : int
        Their places in a row.
    quantity : "radius", "diameter" or "circumference"
        What the second of them is.
    unit : str, optional
        Of both, one of :data:`jaxclay.files.units.UNITS`.
    rows : list of Row
        Those below the header.
    headed : bool
        Whether a header says so; if not the two may be the other way round.
    told : list of str
    """

    height: int
    across: int
    quantity: str
    unit: str | None
    rows: list[Row]
    headed: bool
    told: list[str]


@dataclasses.dataclass(frozen=True)
class _Header:
    line: int
    cells: list[str]
    units: list[str]  # a row of its own below the header
    height: int
    across: int
    quantity: str


def find_columns(table: Table, wanted: str | None = None, unit: str | None = None) -> Columns:
    """The columns of a table.

    Parameters
    ----------
    table : Table
        Rows of cells.
    wanted : str, optional
        "HEIGHT,RADIUS": names of the header, or numbers from 1.
    unit : str, optional
        Of both columns, whatever the header says.

    Raises
    ------
    ValueError
        No numbers, nothing that looks like height or radius, names that are there twice, units
        that differ, rows with more cells than the header names.
    """
    rows = table.rows
    first = next((i for i, row in enumerate(rows) if _is_numeric(row)), None)
    if first is None:
        raise ValueError("no numbers below the header: a profile needs at least 2 rows of numbers")
    header, first = _header(table, first, wanted)
    below = rows[first:]
    if header is None:
        return _unheaded(below, wanted, unit)
    shift = _row_names(header, below, table.separator)
    for row in below:
        if len(row.cells) > len(header.cells) + shift:
            raise ValueError(
                f"line {row.line}: {len(row.cells)} values, but the header names "
                f"{len(header.cells)}: {', '.join(header.cells)}."
                + (" Decimal commas need another separator, or quotes" * (table.separator == ","))
            )
    told = ["row numbers left out"] if shift else []
    found, said = _unit(header, unit)
    told.append(_words(header) + (f" in {found}" if found else ""))
    return Columns(
        header.height + shift, header.across + shift, header.quantity, found, below, True,
        told + said,
    )  # fmt: skip


def _is_numeric(row: Row) -> bool:
    return sum(map(like_a_number, row.cells)) > 1


def _header(table: Table, first: int, wanted: str | None) -> tuple[_Header | None, int]:
    """The header, and which row is the first below it."""
    rows = table.rows
    for i in reversed(range(first)):
        units = _units_row(rows[i + 1 : first])
        found = _matched(rows[i].line, rows[i].cells, units or [], wanted)
        if found:
            return found, first if units else i + 1
    # As NumPy writes it, in a comment.
    before = [comment for comment in table.comments if comment[0] < rows[first].line]
    for line, text in reversed(before):
        if len(text) > _LONGEST:
            continue
        for separator in (table.separator, " "):
            cells = split(text, separator)
            if len(cells) == len(rows[first].cells) and (
                found := _matched(line, cells, [], wanted)
            ):
                return found, first
    above = rows[first - 1] if first else None
    if above is not None and len(above.cells) > 1 and not _are_numbers(wanted):
        raise ValueError(_unknown(above, wanted))
    return None, first


def _units_row(rows: list[Row]) -> list[str] | None:
    """The cells of a row that has nothing but units; None where there is no such row."""
    cells = rows[0].cells if len(rows) == 1 else []
    bare = [cell.strip("()[] ") for cell in cells]
    return bare if bare and all(unit_named(cell) or not cell for cell in bare) else None


def _matched(line: int, cells: list[str], units: list[str], wanted: str | None) -> _Header | None:
    """The header that a row is, if it names what is wanted."""
    if wanted is not None:
        places = _places(cells, wanted)
        if places is None:
            return None
        found = next((q for q, _ in ACROSS if rank_of(q, cells[places[1]]) is not None), "radius")
        return _Header(line, cells, units, *places, found)
    height = one_of(line, cells, [(HEIGHT, rank) for rank in range(4)])
    across = one_of(line, cells, ACROSS)
    if height is None or across is None:
        return None
    names = [named(cell)[0] for cell in cells]
    if names[across[1]] == "x" and {"y", "z"} <= set(names):
        raise ValueError(
            f"line {line}: the columns x, y and z are points in space, but a profile lies in a "
            "plane through the axis: say which two are height and radius, --columns z,x"
        )
    return _Header(line, cells, units, height[1], across[1], across[0])


def _places(cells: list[str], wanted: str) -> tuple[int, int] | None:
    """Where a row names the wanted columns; None where it does not."""
    asked = _two(wanted)
    if _are_numbers(wanted):
        height, across = (int(one) - 1 for one in asked)
        fits = max(height, across) < len(cells) and not any(map(like_a_number, cells))
        return (height, across) if fits else None
    whole, names = [cell.casefold() for cell in cells], [named(cell)[0] for cell in cells]
    found = []
    for one in asked:
        for known, name in ((whole, one.casefold()), (names, named(one)[0])):
            if name in known:
                found.append(known.index(name))
                break
    return (found[0], found[1]) if len(found) == 2 else None


def _two(wanted: str) -> list[str]:
    """The two columns that somebody asks for."""
    found = [one.strip() for one in next(csv.reader([wanted]), [])]
    if len(found) != 2 or not all(found) or found[0] == found[1]:
        raise ValueError(
            f"--columns {wanted!r} is not HEIGHT,RADIUS: two names of the header, or two numbers "
            "from 1"
        )
    return found


def _are_numbers(wanted: str | None) -> bool:
    return wanted is not None and all(re.fullmatch(r"[1-9]\d{0,3}", one) for one in _two(wanted))


def _unknown(row: Row, wanted: str | None) -> str:
    columns = ", ".join(cell or "(no name)" for cell in row.cells)
    if wanted is not None:
        return f"line {row.line}: no columns {wanted!r}: the header names {columns}"
    missing = [
        what
        for what, order in ((HEIGHT, [(HEIGHT, r) for r in range(4)]), ("radius", ACROSS))
        if one_of(row.line, row.cells, order) is None
    ]
    return (
        f"line {row.line}: nothing looks like {' or '.join(missing)} in the columns {columns}: "
        "say which two are, --columns HEIGHT,RADIUS, or name them height and radius"
    )


def _row_names(header: _Header, rows: list[Row], separator: str) -> int:
    """1 where each row begins with a name or a number of its own, as R writes them."""
    if any(len(row.cells) != len(header.cells) + 1 for row in rows):
        return 0
    names = [row.cells[0] for row in rows]
    counted = all(name.isdigit() for name in names) and all(
        int(b) == int(a) + 1 for a, b in itertools.pairwise(names)
    )
    # Without quotes a decimal comma would look the same.
    apart = all(row.quoted for row in rows) or not any(map(like_a_number, names))
    return int(apart or (counted and separator != ","))


def _unit(header: _Header, given: str | None) -> tuple[str | None, list[str]]:
    if given is not None:
        return _asked(given), []
    units = []
    for place in (header.height, header.across):
        below = header.units[place] if place < len(header.units) else ""
        units.append(named(header.cells[place])[1] or unit_named(below))
    height, across = units
    if height and across and height != across:
        raise ValueError(
            f"line {header.line}: height is in {height}, but {header.quantity} in {across}: bring "
            f"both to one unit, or say --unit {across} if they are"
        )
    said = []
    if (height or across) and not (height and across):
        said = [f"no unit of {header.quantity if height else HEIGHT}, taken as the same"]
    return height or across, said


def _asked(unit: str) -> str:
    """The unit that somebody asks for."""
    if (found := unit_named(unit)) is None:
        raise ValueError(f"--unit {unit!r} is no unit of length: choose from {', '.join(UNITS)}")
    return found


def _words(header: _Header) -> str:
    """Height and quantity, or by what names they were found."""
    names = [header.cells[header.height], header.cells[header.across]]
    parts = [
        what if named(name)[0] == what else f"{bare(name)} as {what}"
        for name, what in zip(names, (HEIGHT, header.quantity), strict=True)
    ]
    return " and ".join(parts)


def _unheaded(rows: list[Row], wanted: str | None, unit: str | None) -> Columns:
    width = max(len(row.cells) for row in rows)
    if _are_numbers(wanted):
        assert wanted is not None
        places = [int(one) - 1 for one in _two(wanted)]
        if max(places) >= width:
            raise ValueError(f"--columns {wanted}: the table has {width} columns")
    elif wanted is not None:
        raise ValueError(
            f"--columns {wanted}: the table has no header with these names; its {width} columns "
            f"have the numbers 1 to {width}"
        )
    else:
        places = _two_of_numbers(rows, width)
    found = None if unit is None else _asked(unit)
    told = [f"no header, column {places[0] + 1} as height and {places[1] + 1} as radius"]
    told[0] += f" in {found}" if found else ""
    return Columns(places[0], places[1], "radius", found, rows, wanted is not None, told)


def _two_of_numbers(rows: list[Row], width: int) -> list[int]:
    places = [
        i for i in range(width) if all(i < len(r.cells) and like_a_number(r.cells[i]) for r in rows)
    ]
    first = [row.cells[0] for row in rows]
    if len(places) == 3 and places[0] == 0 and len(rows) > 2 and all(map(str.isdigit, first)):
        numbers = list(map(int, first))
        if numbers[0] in (0, 1) and numbers == list(range(numbers[0], numbers[0] + len(rows))):
            places = places[1:]
    if len(places) != 2:
        raise ValueError(
            f"line {rows[0].line}: no header, and {len(places)} columns of numbers: say which two "
            "are height and radius, --columns 1,2, or put a line height,radius above them. (Commas "
            "cannot both separate and mark decimals.)"
        )
    return places
