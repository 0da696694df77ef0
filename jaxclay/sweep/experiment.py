"""Reads an experiment file: TOML in, a validated :class:`jaxclay.sweep.tables.Experiment` out."""

from __future__ import annotations

import tomllib
from pathlib import Path

from pydantic import ValidationError

from jaxclay.profiles import PROFILES
from jaxclay.sweep.lines import line_of
from jaxclay.sweep.tables import TABLES, Experiment

_PACKAGED = Path(__file__).parent / "experiments"


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

    Raises
    ------
    ValueError
        What is wrong, in which line, and what is allowed.
    OSError
        The file cannot be read.
    """
    path = packaged().get(str(path), Path(path))
    if not path.exists():
        raise ValueError(
            f"no experiment {str(path)!r}: name a TOML file, or choose from {', '.join(packaged())}"
        )
    text = path.read_text(encoding="utf-8")
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{path}: {error}") from None
    try:
        found = Experiment.model_validate(raw)
    except ValidationError as error:
        raise ValueError("\n".join(_explained(path, text, error))) from None
    return _with_files(found, path, text, profiles)


def _explained(path: Path, text: str, error: ValidationError):
    """A line for each mistake: the file's line, the key, what is wrong and what is allowed."""
    for mistake in error.errors():
        place = tuple(part for part in mistake["loc"] if part != "function-before")
        key = ".".join(str(part) for part in place if isinstance(part, str))
        message = mistake["msg"].removeprefix("Value error, ")
        if mistake["type"] == "extra_forbidden":
            message = f"unknown key: choose from {', '.join(_keys(place[:-1]))}"
        elif mistake["type"] == "missing":
            message = "is missing"
        elif mistake["type"] != "value_error":
            message = f"{message}, got {mistake['input']!r}"
        yield f"{path}: line {line_of(text, place)}: {key}{': ' if key else ''}{message}"


def _keys(place: tuple[str | int, ...]) -> list[str]:
    """The keys of the table at a place."""
    names = [part for part in place if isinstance(part, str)]
    return list((TABLES[names[-1]] if names else Experiment).model_fields)


def _with_files(found: Experiment, path: Path, text: str, folder) -> Experiment:
    """The experiment with every profile a packaged name or the path of one file."""
    added = sorted(str(file.resolve()) for file in Path(folder).glob("*.csv")) if folder else []
    if folder and not added:
        raise ValueError(f"no CSV file in {folder}: each profile is a file with height,radius")
    tables = []
    for j, table in enumerate(found.scenes):
        if table.profiles is None:
            tables.append(table)
            continue
        names = []
        for entry in table.profiles:
            names += _matches(entry, path, line_of(text, ("scenes", j, "profiles")))
        names = list(dict.fromkeys([*names, *added]))
        tables.append(table.model_copy(update={"profiles": names}))
    if added and not any(table.profiles for table in tables):
        raise ValueError(f"{path}: no table of [[scenes]] has profiles for those of {folder}")
    return found.model_copy(update={"scenes": tables})


def _matches(entry: str, path: Path, line: int) -> list[str]:
    if entry in PROFILES:
        return [entry]
    place = Path(entry)
    base = Path(place.anchor) if place.is_absolute() else path.parent
    pattern = str(place.relative_to(place.anchor))
    files = sorted(str(file.resolve()) for file in base.glob(pattern) if file.is_file())
    if not files:
        raise ValueError(
            f"{path}: line {line}: no profile {entry!r}: choose from {', '.join(PROFILES)}, or "
            "name CSV files, as in pots/*.csv"
        )
    return files
