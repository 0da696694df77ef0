"""Reads an experiment file: TOML in, a validated :class:`.tables.Experiment` out."""

from __future__ import annotations

import tomllib
import uuid
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import tomlkit
from pydantic import ValidationError
from tomlkit.container import OutOfOrderTableProxy
from tomlkit.items import AoT, Table

from jaxclay.experiments.entries.scenes import files_of
from jaxclay.experiments.entries.tables import TABLES, Experiment
from jaxclay.experiments.entries.values import MistakeAt

_PACKAGED = Path(__file__).parents[1] / "packaged"
Raw = dict[str, Any]


class Edited(NamedTuple):
    """An experiment, its name, and the text of a file that says the same."""

    name: str
    experiment: Experiment
    text: str


def packaged() -> dict[str, Path]:
    """Name and file of the experiments that come with jaxclay."""
    return {path.stem: path for path in sorted(_PACKAGED.glob("*.toml"))}


def read_experiment(path: str | Path, profiles: str | Path | None = None) -> Experiment:
    """Read and validate an experiment file.

    Parameters
    ----------
    path : str or path
        The TOML file, or the name of one that comes with jaxclay: see :func:`packaged`.  Paths
        of profiles in it are taken from its folder.
    profiles : str or path, optional
        A folder whose CSV files join the profiles of every table of scenes that has some.

    Raises ValueError: What is wrong, in which line, and what is allowed; OSError: The file cannot
    be read.
    """
    return of_file(path, profiles).experiment


def of_file(path: str | Path, profiles: str | Path | None = None) -> Edited:
    """The same with its name and its text; raises as :func:`read_experiment`."""
    path, text, raw = _opened(path)
    return Edited(path.stem, checked(raw, path, text, profiles), text)


def raw_experiment(path: str | Path) -> Raw:
    """The tables of a file, not yet validated, to be edited."""
    return _opened(path)[2]


def checked(raw: Raw, path: Path, text: str, profiles: str | Path | None = None) -> Experiment:
    """Validate the tables of a file, as they are or edited; raises as :func:`read_experiment`."""
    added = [] if profiles is None else files_of(Path(profiles))
    try:
        found = Experiment.model_validate(raw, context={"folder": path.parent, "added": added})
    except ValidationError as error:
        raise ValueError("\n".join(_explained(path, text, error))) from None
    if added and not any(table.profiles for table in found.scene_tables):
        raise ValueError(f"{path}: no table of [[scenes]] has profiles for those of {profiles}")
    return found


def _opened(experiment: str | Path) -> tuple[Path, str, Raw]:
    """Path, text and tables of a file, or of one that comes with jaxclay."""
    path = packaged().get(str(experiment), Path(experiment))
    if not path.exists():
        raise ValueError(
            f"no experiment {str(path)!r}: name a TOML file, or choose from {', '.join(packaged())}"
        )
    try:
        text = path.read_text(encoding="utf-8-sig")
        raw = tomllib.loads(text)
        tomlkit.parse(text)  # which says where keys stand, and goes less deep
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: a TOML file must be UTF-8: {error}") from None
    except ValueError as error:  # of which a TOMLDecodeError is one
        raise ValueError(f"{path}: {error}") from None
    except RecursionError:
        raise ValueError(
            f"{path}: brackets within brackets, too deep: no key takes more than four"
        ) from None
    return path, text, raw


def _explained(path: Path, text: str, error: ValidationError) -> Iterator[str]:
    """A line for each mistake: the file's line, the key, what is wrong and what is allowed."""
    for mistake in error.errors():
        cause = mistake.get("ctx", {}).get("error")
        place = mistake["loc"] + (cause.place if isinstance(cause, MistakeAt) else ())
        message = mistake["msg"].removeprefix("Value error, ")
        names = [part for part in place if isinstance(part, str)]
        if mistake["type"] == "extra_forbidden":
            table = TABLES[names[-2]] if len(names) > 1 else Experiment
            message = f"unknown key: choose from {', '.join(table.model_fields)}"
        elif mistake["type"] == "missing":
            message = "is missing"
        elif mistake["type"] != "value_error":
            message = f"{message}, got {mistake['input']!r}"
        keys = f"{'.'.join(names)}: " if names else ""
        yield f"{path}: line {_line_of(text, place)}: {keys}{message}"


def _line_of(text: str, place: Iterable[Any]) -> int:
    """The line, from 1, of the deepest part of a place that has one; tomllib does not keep it."""
    document: Any = tomlkit.parse(text)
    parent: Any
    key: Any
    parent, key, item = None, None, document
    for part in place:
        if isinstance(part, int) and not isinstance(item, list):
            continue  # a list of one may be written as its entry
        if part not in (range(len(item)) if isinstance(part, int) else item):
            break
        parent, key, item = item, part, item[part]
    if parent is None:
        return 1
    while _has_no_line(item):  # what stands first in it has one
        parent, key = item, 0 if isinstance(item, AoT) else next(iter(item))
        item = parent[key]
    # A mark is put there, and its line counted: a comment to a header, else in place of the value.
    mark = uuid.uuid4().hex
    if isinstance(item, Table):
        item.comment(mark)
    else:
        parent[key] = mark
    return tomlkit.dumps(document).partition(mark)[0].count("\n") + 1


def _has_no_line(item: Any) -> bool:
    """Whether it is a list of tables, or a table by dotted keys alone."""
    if isinstance(item, Table):
        return item.is_super_table()
    return isinstance(item, AoT | OutOfOrderTableProxy)
