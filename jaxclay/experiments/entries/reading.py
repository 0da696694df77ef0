"""Reads an experiment file: TOML in, a validated :class:`.tables.Experiment` out."""

from __future__ import annotations

import json
import math
import re
import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from jaxclay.experiments.entries.lines import MistakeAt, Place, line_of
from jaxclay.experiments.entries.tables import TABLES, Experiment, ScenesTable, Table
from jaxclay.experiments.entries.values import Values
from jaxclay.files.profiles import PROFILES
from jaxclay.files.several import only_profiles

_PACKAGED = Path(__file__).parents[1] / "packaged"
_MOST = 1_000_000  # scenes of a table
Raw = dict[str, Any]


def packaged() -> dict[str, Path]:
    """Name and file of the experiments that come with jaxclay."""
    return {path.stem: path for path in sorted(_PACKAGED.glob("*.toml"))}


def experiment_path(experiment: str | Path) -> Path:
    """The file of an experiment that comes with jaxclay, by its name, or the path itself."""
    return packaged().get(str(experiment), Path(experiment))


def read_experiment(path: str | Path, profiles: str | Path | None = None) -> Experiment:
    """Read and validate an experiment file.

    Parameters
    ----------
    path : str or path
        The TOML file, or the name of one that comes with jaxclay: see :func:`packaged`.  Paths
        of profiles in it are taken from its folder.
    profiles : str or path, optional
        A folder whose CSV files join the profiles of every table of scenes that has some.

    Raises
    ------
    ValueError
        What is wrong, in which line, and what is allowed.
    OSError
        The file cannot be read.
    """
    path = experiment_path(path)
    text = _text(path)
    return checked(_parsed(path, text), path, text, profiles)


def raw_experiment(path: str | Path) -> Raw:
    """The tables of a file, not yet validated, to be edited."""
    path = experiment_path(path)
    return _parsed(path, _text(path))


def checked(
    raw: Raw, path: Path, text: str | None = None, profiles: str | Path | None = None
) -> Experiment:
    """Validate the tables of a file, as they are or edited; raises as :func:`read_experiment`."""
    text = as_toml(raw) if text is None else text
    try:
        found = Experiment.model_validate(raw)
        return _with_files(found, path, profiles)
    except ValidationError as error:
        raise ValueError("\n".join(_explained(path, text, error))) from None
    except MistakeAt as error:
        raise ValueError(f"{_where(path, text, error.place)}{error}") from None
    except RecursionError:
        raise _too_deep(path) from None


def as_toml(raw: Raw) -> str:
    """Tables as the text of a file, a line for each key."""
    return "".join(f"{key} = {_value(value)}\n" for key, value in raw.items())


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_value(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


def _text(path: Path) -> str:
    if not path.exists():
        raise ValueError(
            f"no experiment {str(path)!r}: name a TOML file, or choose from {', '.join(packaged())}"
        )
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: a TOML file must be UTF-8: {error}") from None


def _parsed(path: Path, text: str) -> Raw:
    try:
        return tomllib.loads(text)
    except ValueError as error:  # of which a TOMLDecodeError is one
        raise ValueError(f"{path}: {error}") from None
    except RecursionError:
        raise _too_deep(path) from None


def _too_deep(path: Path) -> ValueError:
    return ValueError(f"{path}: brackets within brackets, too deep: no key takes more than four")


def _explained(path: Path, text: str, error: ValidationError):
    """A line for each mistake: the file's line, the key, what is wrong and what is allowed."""
    for mistake in error.errors():
        cause = mistake.get("ctx", {}).get("error")
        place = mistake["loc"] + (cause.place if isinstance(cause, MistakeAt) else ())
        message = mistake["msg"].removeprefix("Value error, ")
        if mistake["type"] == "extra_forbidden":
            message = f"unknown key: choose from {', '.join(_keys(place[:-1]))}"
        elif mistake["type"] == "missing":
            message = "is missing"
        elif mistake["type"] != "value_error":
            message = f"{message}, got {mistake['input']!r}"
        yield f"{_where(path, text, place)}{message}"


def _where(path: Path, text: str, place: Place) -> str:
    """What a message begins with: the file, the line and the key."""
    keys = ".".join(part for part in place if isinstance(part, str))
    return f"{path}: line {line_of(text, place)}: {keys}{': ' if keys else ''}"


def _keys(place: Place) -> list[str]:
    """The keys of the table at a place."""
    names = [part for part in place if isinstance(part, str)]
    return list((TABLES[names[-1]] if names else Experiment).model_fields)


def _with_files(found: Experiment, path: Path, folder: str | Path | None) -> Experiment:
    """The experiment with every profile a packaged name or the path of one file."""
    added = files_of(Path(folder)) if folder is not None else []
    scenes = _tables_with_files(found.scenes, path, (), added)
    parts = [
        part.model_copy(
            update={"scenes": _tables_with_files(part.scenes, path, ("parts", i), added)}
        )
        if part.scenes
        else part
        for i, part in enumerate(found.parts or ())
    ]
    everything = [*(scenes or ()), *(one for part in parts for one in part.scenes or ())]
    if added and not any(table.profiles for table in everything):
        raise ValueError(f"{path}: no table of [[scenes]] has profiles for those of {folder}")
    return found.model_copy(update={"scenes": scenes} | ({"parts": parts} if parts else {}))


def _tables_with_files(
    scenes: list[ScenesTable] | None, path: Path, place: Place, added: list[str]
) -> list[ScenesTable] | None:
    tables = []
    for j, table in enumerate(scenes or ()):
        here = (*place, "scenes", j)
        if table.profiles is not None:
            names = []
            for i, entry in enumerate(table.profiles):
                least = table.minimum_radius
                names += _matches(entry, path.parent, (*here, "profiles", i), least)
            names = list(dict.fromkeys([*names, *added]))
            table = table.model_copy(update={"profiles": names})
        if table.draws is None and (count := _combinations(table)) > _MOST:
            message = f"{count} combinations: at most {_MOST}, or give draws"
            raise MistakeAt(here, message)
        tables.append(table)
    return tables or None


def files_of(folder: Path, minimum_radius: float | None = None) -> list[str]:
    """The profiles in a folder: CSV files, however their ending is written; hidden ones are none.

    Raises
    ------
    ValueError
        There is none.
    """
    if not folder.is_dir():
        wrong = "is a file" if folder.exists() else "does not exist"
        raise ValueError(f"{folder} {wrong}: name a folder of profiles, CSV files")
    files = sorted(
        str(file.resolve())
        for file in folder.iterdir()
        if file.suffix.lower() == ".csv" and not file.name.startswith(".")
    )
    if not files:
        raise ValueError(f"no CSV file in {folder}: each profile is a file with height,radius")
    return only_profiles(files, minimum_radius)


def _matches(entry: str, folder: Path, place: Place, least: float | None) -> list[str]:
    """The profiles that an entry, at a place of the file, names."""
    if entry in PROFILES:
        return [entry]
    pattern = Path(entry)
    base = Path(pattern.anchor) if pattern.is_absolute() else folder
    try:
        wanted = re.sub(r"(?<=\*)\.csv$", ".[cC][sS][vV]", str(pattern.relative_to(pattern.anchor)))
        found = [file for file in base.glob(wanted) if file.is_file()]
        files = sorted(str(file.resolve()) for file in found if not file.name.startswith("."))
    except (IndexError, OSError, ValueError):  # raised for "", "**a" and what is no path
        files = []
    if not files:
        raise MistakeAt(
            place,
            f"no profile {entry!r}: choose from {', '.join(PROFILES)}, or name CSV files, as in "
            "pots/*.csv",
        )
    try:
        return only_profiles(files, least)
    except ValueError as error:
        raise MistakeAt(place, str(error)) from None


def _combinations(table: ScenesTable) -> int:
    """How many scenes the lists of a table make, counted without making them."""
    pieces = len(table.profiles or ()) + (_product(table.cylinders) if table.cylinders else 0)
    squashes = math.prod(_product(squash) for squash in table.squash or ())
    squashes *= len(table.places or (1,))
    return pieces * squashes * _product(table.material) * len(table.units)


def _product(table: Table) -> int:
    return math.prod(len(value.entries) for _, value in table if isinstance(value, Values))
