"""Profiles that an experiment names: packaged ones, and CSV files by glob or by folder."""

from __future__ import annotations

import re
from pathlib import Path

from jaxclay.files.profiles import PROFILES
from jaxclay.files.several import only_profiles


def files_of(folder: Path, minimum_radius: float | None = None) -> list[str]:
    """The profiles in a folder: CSV files, however their ending is written; hidden ones are none.

    Raises ValueError: There is none, or one that is no profile.
    """
    if not folder.is_dir():
        wrong = "is a file" if folder.exists() else "does not exist"
        raise ValueError(f"{folder} {wrong}: name a folder of profiles, CSV files")
    files = _visible(file for file in folder.iterdir() if file.suffix.lower() == ".csv")
    if not files:
        raise ValueError(f"no CSV file in {folder}: each profile is a file with height,radius")
    return only_profiles(files, minimum_radius)


def matches(entry: str, folder: Path, minimum_radius: float | None) -> list[str]:
    """The profiles that an entry of a file in ``folder`` names.

    Raises ValueError: There is none, or one that is no profile.
    """
    if entry in PROFILES:
        return [entry]
    pattern = Path(entry)
    base = Path(pattern.anchor) if pattern.is_absolute() else folder
    try:
        wanted = re.sub(r"(?<=\*)\.csv$", ".[cC][sS][vV]", str(pattern.relative_to(pattern.anchor)))
        files = _visible(base.glob(wanted))
    except (IndexError, OSError, ValueError):  # raised for "", "**a" and what is no path
        files = []
    if not files:
        known = ", ".join(PROFILES)
        raise ValueError(
            f"no profile {entry!r}: choose from {known}, or name CSV files, as in pots/*.csv"
        )
    return only_profiles(files, minimum_radius)


def _visible(paths) -> list[str]:
    files = (path for path in paths if path.is_file() and not path.name.startswith("."))
    return sorted(str(path.resolve()) for path in files)
