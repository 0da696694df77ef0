"""Where in a TOML file a key stands: errors name the line, which tomllib does not keep."""

from __future__ import annotations

import uuid
from collections.abc import Iterable
from typing import Any

import tomlkit
from tomlkit.container import OutOfOrderTableProxy
from tomlkit.items import AoT, Table

Place = tuple[str | int, ...]


class MistakeAt(ValueError):
    """A mistake in a table, at a ``place`` below the table's own."""

    def __init__(self, place: Place, message: str):
        super().__init__(message)
        self.place = place


def line_of(text: str, place: Iterable[Any]) -> int:
    """The line, from 1, of the deepest part of ``place`` that has one.

    ``place`` is a path such as ("scenes", 1, "squash", 0, "ratio"): names of keys, and numbers
    of the entries in a list.  A number may be missing in the file, where a list of one may be
    written as its entry.
    """
    document: Any = tomlkit.parse(text)
    chain: list[Any] = [document]
    names: list[Any] = []
    for part in place:
        if isinstance(part, int) and not isinstance(chain[-1], list):
            continue
        if part not in (range(len(chain[-1])) if isinstance(part, int) else chain[-1]):
            break
        names.append(part)
        chain.append(chain[-1][part])
    if not names:
        return 1
    while _has_no_line(chain[-1]):  # what stands first in it has one
        names.append(0 if isinstance(chain[-1], AoT) else next(iter(chain[-1])))
        chain.append(chain[-1][names[-1]])
    # A mark is put there, and its line counted: a comment to a header, else in place of the value.
    mark = uuid.uuid4().hex
    if isinstance(chain[-1], Table):
        chain[-1].comment(mark)
    else:
        chain[-2][names[-1]] = mark
    return tomlkit.dumps(document).partition(mark)[0].count("\n") + 1


def _has_no_line(item: Any) -> bool:
    """Whether it is a list of tables, or a table by dotted keys alone."""
    if isinstance(item, Table):
        return item.is_super_table()
    return isinstance(item, AoT | OutOfOrderTableProxy)
