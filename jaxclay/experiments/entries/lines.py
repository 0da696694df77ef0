"""Where in a TOML file a key stands: errors name the line, which the parser does not keep."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator

Place = tuple[str | int, ...]

_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}|'
    r"'''.*?'{3,5}|"
    r'"(?:\\.|[^"\\])*"|'
    r"'[^']*'|"
    r"#[^\n]*|[\[\]{}=,.]|[^\s\[\]{}=,.#\"']+",
    re.DOTALL,
)


class MistakeAt(ValueError):
    """A mistake in a table, at a ``place`` below the table's own."""

    def __init__(self, place: Place, message: str):
        super().__init__(message)
        self.place = place


def line_of(text: str, place: Place) -> int:
    """The line, from 1, of the deepest part of ``place`` that has one.

    ``place`` is a path such as ("scenes", 1, "squash", 0, "ratio"): names of keys, and numbers
    of the entries in a list.  A number may be missing in the file, where a list of one may be
    written as its entry.
    """
    best, best_depth = 1, 0
    for line, path in _Walk(text).paths():
        depth = _depth(path, place)
        if depth > best_depth:
            best, best_depth = line, depth
    return best


def _depth(path: Place, place: Place) -> int:
    """How far into ``place`` the whole of ``path`` leads; 0 if it leads elsewhere."""
    depth = 0
    for part in path:
        while depth < len(place) and place[depth] != part and isinstance(place[depth], int):
            depth += 1
        if depth == len(place) or place[depth] != part:
            return 0
        depth += 1
    return depth


class _Walk:
    """A walk over the tokens of a file that the parser has taken, so that none is amiss."""

    def __init__(self, text: str):
        self.tokens: list[tuple[int, str]] = []
        self.at = 0
        line, end = 1, 0
        for match in _TOKEN.finditer(text):
            line, end = line + text.count("\n", end, match.start()), match.start()
            if not match[0].startswith("#"):
                self.tokens.append((line, match[0]))

    def paths(self) -> Iterator[tuple[int, Place]]:
        """Line and path of every header, key and entry of a list, top to bottom."""
        table: Place = ()
        counts: dict[Place, int] = {}
        while self.at < len(self.tokens):
            line, token = self.tokens[self.at]
            if token == "[":
                brackets = 2 if self.tokens[self.at + 1][1] == "[" else 1
                self.at += brackets
                table = _table_path(self._names(), brackets == 2, counts)
                self.at += brackets
                yield line, table
            else:
                yield from self._pair(table)

    def _names(self) -> list[str]:
        """The names of a key or a header, up to the sign that ends it."""
        names = []
        while (token := self.tokens[self.at][1]) not in ("=", "]"):
            names += [token.strip("\"'")] if token != "." else []
            self.at += 1
        return names

    def _pair(self, table: Place) -> Iterator[tuple[int, Place]]:
        line = self.tokens[self.at][0]
        place = (*table, *self._names())
        self.at += 1  # the sign =
        for end in range(len(table) + 1, len(place) + 1):
            yield line, place[:end]
        yield from self._value(place)

    def _value(self, place: Place) -> Iterator[tuple[int, Place]]:
        line, opening = self.tokens[self.at]
        self.at += 1
        if opening not in ("[", "{"):
            self._skip_rest(line)
            return
        for number in itertools.count():
            if self.tokens[self.at][1] in ("]", "}"):
                break
            if opening == "{":
                yield from self._pair(place)
            else:
                yield self.tokens[self.at][0], (*place, number)
                yield from self._value((*place, number))
            if self.tokens[self.at][1] == ",":
                self.at += 1
        self.at += 1

    def _skip_rest(self, line: int) -> None:
        """What a number or a date has beyond its first token, such as its decimals."""
        while self.at < len(self.tokens):
            next_line, token = self.tokens[self.at]
            if next_line != line or token in (",", "]", "}"):
                break
            self.at += 1


def _table_path(names: list[str], in_list: bool, counts: dict[Place, int]) -> Place:
    """The header's names, each list of tables followed by the number of its last one."""
    path: Place = ()
    for depth, name in enumerate(names):
        path += (name,)
        if in_list and depth == len(names) - 1:
            counts[path] = counts.get(path, -1) + 1
        if path in counts:
            path += (counts[path],)
    return path
