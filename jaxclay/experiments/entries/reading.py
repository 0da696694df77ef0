"""Reads an experiment file: TOML in, a validated :class:`.tables.Experiment` out."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import tomlkit
from pydantic import ValidationError

from jaxclay.experiments.entries.lines import MistakeAt, Place, line_of
from jaxclay.experiments.entries.profiles import files_of
from jaxclay.experiments.entries.tables import TABLES, Experiment

_PACKAGED = Path(__file__).parents[1] / "packaged"
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

    Raises ValueError: What is wrong, in which line, and what is allowed; OSError: The file cannot
    be read.
    """
    path = experiment_path(path)
    text = experiment_text(path)
    return checked(_parsed(path, text), path, text, profiles)


def raw_experiment(path: str | Path) -> Raw:
    """The tables of a file, not yet validated, to be edited."""
    path = experiment_path(path)
    return _parsed(path, experiment_text(path))


def checked(raw: Raw, path: Path, text: str, profiles: str | Path | None = None) -> Experiment:
    """Validate the tables of a file, as they are or edited; raises as :func:`read_experiment`."""
    added = [] if profiles is None else files_of(Path(profiles))
    try:
        context = {"folder": path.parent, "added": added}
        found = Experiment.model_validate(raw, context=context)
    except ValidationError as error:
        raise ValueError("\n".join(_explained(path, text, error))) from None
    tables = [one for whole in (found, *(found.parts or ())) for one in whole.scenes or ()]
    if added and not any(table.profiles for table in tables):
        raise ValueError(f"{path}: no table of [[scenes]] has profiles for those of {profiles}")
    return found


def as_toml(raw: Raw) -> str:
    """Tables as the text of a file."""
    return tomlkit.dumps(raw)


def experiment_text(path: Path) -> str:
    """The text of a file; raises as :func:`read_experiment`."""
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
        raw = tomllib.loads(text)
        tomlkit.parse(text)  # which says where keys stand, and goes less deep
    except ValueError as error:  # of which a TOMLDecodeError is one
        raise ValueError(f"{path}: {error}") from None
    except RecursionError:
        raise ValueError(
            f"{path}: brackets within brackets, too deep: no key takes more than four"
        ) from None
    return raw


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
        keys = ".".join(part for part in place if isinstance(part, str))
        yield f"{path}: line {line_of(text, place)}: {keys}{': ' if keys else ''}{message}"


def _keys(place: Place) -> list[str]:
    """The keys of the table at a place."""
    names = [part for part in place if isinstance(part, str)]
    return list((TABLES[names[-1]] if names else Experiment).model_fields)
