"""Where in a TOML file a key stands: errors name the line, which the parser does not keep."""

from __future__ import annotations

import re
from collections.abc import Sequence

_HEADER = re.compile(r"\s*(\[\[|\[)\s*([\w.\-\s\"']+?)\s*(\]\]|\])\s*(#.*)?$")
_KEY = re.compile(r"\s*([\w\-\"'.]+)\s*=")


def line_of(text: str, place: Sequence[str | int]) -> int:
    """The line, from 1, of the deepest part of ``place`` that has one.

    ``place`` is a path such as ("scenes", 1, "squash", "ratio"): names of keys, and numbers
    of the tables in a list.  Keys inside an inline table count as on the line where it begins.
    """
    best, best_depth = 1, 0
    for number, path in _paths(text):
        depth = _shared(path, place)
        if depth > best_depth and depth == len(path):
            best, best_depth = number, depth
    return best


def _paths(text: str):
    """Line and path of every table header and of every key, top to bottom."""
    table: list[str | int] = []
    counts: dict[tuple[str | int, ...], int] = {}
    for number, line in enumerate(text.splitlines(), 1):
        header = _HEADER.match(line)
        if header:
            table = _table_path(header[2], header[1] == "[[", counts)
            yield number, table
        elif key := _KEY.match(line):
            yield number, [*table, *_names(key[1])]


def _table_path(dotted: str, in_list: bool, counts: dict) -> list[str | int]:
    """The header's names, each list of tables followed by the number of its last one."""
    path: list[str | int] = []
    names = _names(dotted)
    for depth, name in enumerate(names):
        path.append(name)
        if in_list and depth == len(names) - 1:
            counts[tuple(path)] = counts.get(tuple(path), -1) + 1
        if tuple(path) in counts:
            path.append(counts[tuple(path)])
    return path


def _names(dotted: str) -> list[str]:
    return [name.strip().strip("\"'") for name in dotted.split(".")]


def _shared(path: Sequence[str | int], place: Sequence[str | int]) -> int:
    """How many leading parts two paths share."""
    depth = 0
    for a, b in zip(path, place, strict=False):
        if a != b:
            break
        depth += 1
    return depth
