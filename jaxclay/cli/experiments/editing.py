"""Packaged experiments, edited by the options of ``jaxclay compare`` and ``jaxclay atlas``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import tomlkit

from jaxclay.experiments.entries.reading import Edited, Raw, checked, raw_experiment
from jaxclay.experiments.entries.scenes import files_of
from jaxclay.experiments.peers import PEERS
from jaxclay.experiments.peers import checked as checked_peer
from jaxclay.experiments.scenes import NAMED, packaged_scenes
from jaxclay.methods import METHODS
from jaxclay.numerics.checks import check_positive

_MOST_SLICES = 1024  # dense methods
_UNITS = ["snake", "printed"]


def comparison(
    scenes: list[str] | None = None,
    methods: list[str] | None = None,
    slices: list[int] | None = None,
    profiles: Path | None = None,
    quick: bool = False,
    minimum_radius: float | None = None,
    peers: list[str] | None = None,
) -> Edited:
    """The comparison, narrowed or widened as asked.

    ``peers`` names solvers from outside that run too; an empty list is all of them.  With them
    the named scenes are run as E_move alone too, for those that take nothing else.

    Raises ValueError: An unknown scene, method or peer, too few or too many slices, no CSV in the
    folder; ImportError: A peer's library is missing.
    """
    name, raw = _packaged("compare", quick, methods)
    first, finer, *featured = raw["parts"]
    outside = list(PEERS) if peers == [] else peers or []
    for peer in outside:
        checked_peer(peer)
        raw["methods"].append({"name": peer})
    for n in slices or ():
        if not 8 <= n <= _MOST_SLICES:
            raise ValueError(f"slices must lie between 8 and {_MOST_SLICES}, got {n}")
    if slices:
        raw["discretisations"] = [{"scheme": "paper", "slices": sorted(set(slices))}]
        for part in featured:
            if not isinstance(part["discretisations"][0]["slices"], list):
                part["discretisations"] = [{"scheme": "paper", "slices": min(slices)}]
    packaged = packaged_scenes()
    known: dict[str, Raw] = {
        one: {"names": [one], "units": [units for units in _UNITS if units in packaged[one].units]}
        for one in (first["scenes"][0]["names"] if scenes is None else packaged)
    }
    known |= _of_folder(profiles, minimum_radius) if profiles else {}
    for one in scenes or ():
        if one not in known:
            raise ValueError(f"unknown scene {one!r}: choose from {', '.join(known)}")
    chosen = {one: known[one] for one in scenes or known}
    first["scenes"] = list(chosen.values())
    for part in featured:
        (table,) = part["scenes"]
        if not set(table["names"]) <= set(chosen):
            part["scenes"] = [first["scenes"][0] | {"units": table["units"]}]
    (table,) = finer["scenes"]
    table["names"] = [one for one in table["names"] if one in chosen]
    if slices or not table["names"]:
        raw["parts"].remove(finer)
    for part in raw["parts"]:
        for table in part["scenes"]:
            if outside and set(table.get("names", ())) & set(NAMED):
                table["units"] = [*table["units"], "move"]
    return edited(name, raw)


def atlas(
    methods: list[str] | None = None, seconds: float | None = None, quick: bool = False
) -> Edited:
    """The atlas, of fewer methods or with other seconds for each solve.

    Raises ValueError: An unknown method, seconds that are not positive.
    """
    name, raw = _packaged("atlas", quick, methods)
    if seconds is not None:
        check_positive("seconds", seconds)
        raw["budget"] = seconds
    return edited(name, raw)


def edited(name: str, raw: Raw) -> Edited:
    """The experiment of edited tables; raises as :func:`.entries.reading.read_experiment`."""
    text = tomlkit.dumps(raw)
    return Edited(name, checked(raw, Path(name), text), text)


def _packaged(name: str, quick: bool, methods: list[str] | None) -> tuple[str, Raw]:
    """Name and tables of a packaged experiment or its quick part, of the methods named."""
    name = f"{name}-quick" if quick else name
    raw = raw_experiment(name)
    for method in methods or ():
        if method not in METHODS:
            raise ValueError(f"unknown method {method!r}: choose from {', '.join(METHODS)}")
    if methods is not None:
        raw["methods"] = [{"name": method} for method in dict.fromkeys(methods)]
    return name, raw


def _of_folder(folder: Path, minimum_radius: float | None) -> dict[str, Raw]:
    """Two squashes, at mid-height and at the shoulder, of each CSV profile in a folder."""
    more: dict[str, Any] = {} if minimum_radius is None else {"minimum_radius": minimum_radius}
    return {
        f"{Path(file).stem}-{place}": {
            "profiles": [file], "places": [place], "units": _UNITS, **more
        }
        for file in files_of(folder, minimum_radius)
        for place in ("middle", "shoulder")
    }  # fmt: skip
