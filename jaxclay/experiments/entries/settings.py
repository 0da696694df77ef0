"""The settings of a method in an experiment file: every combination must be one it takes."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

from jaxclay.experiments.entries.lines import MistakeAt, Place
from jaxclay.experiments.entries.values import Values, as_whole
from jaxclay.experiments.peers import PEERS
from jaxclay.methods import METHODS
from jaxclay.methods.choice import method_settings, spline_settings

_LIMITS = ("max_iterations", "tolerance")  # what peers take
_MOST = 10_000  # combinations


def checked_settings(method: str, settings: dict[str, Values]) -> dict[str, Values]:
    """The settings, ints where the method counts with them.

    Raises MistakeAt: The setting that is wrong, or none where they are only together.
    """
    found = {}
    for name, values in settings.items():
        try:
            if values.random or isinstance(all_settings(method, {}).get(name), int):
                values = as_whole(values)  # which refuses what is drawn
        except ValueError as error:
            raise MistakeAt((name,), str(error)) from None
        found[name] = values
    count = math.prod(len(values.entries) for values in found.values())
    if count > _MOST:
        raise ValueError(f"{count} combinations of settings: at most {_MOST} can be run")
    for combination in combinations(found):
        try:
            all_settings(method, combination)
        except ValueError as error:
            raise MistakeAt(_wrong(method, combination), str(error)) from None
    return found


def combinations(settings: dict[str, Values]) -> list[dict[str, float]]:
    """Every choice of one number for each setting."""
    values = itertools.product(*(values.fixed() for values in settings.values()))
    return [dict(zip(settings, each, strict=True)) for each in values]


def all_settings(method: str, chosen: dict[str, Any], scheme: str = "paper") -> dict[str, Any]:
    """The settings of a method or a peer by name, its defaults filled in.

    Raises ValueError: A setting that it does not have, or a value that it does not take.
    """
    if method in PEERS:
        for name in chosen:
            if name not in _LIMITS:
                message = f"{method} has no setting {name!r}: it takes {', '.join(_LIMITS)}"
                raise ValueError(message)
        return {name: getattr(PEERS[method].limits, name) for name in _LIMITS} | chosen
    settings = (spline_settings if scheme == "spline" else method_settings)(method, chosen)
    return {f.name: getattr(settings, f.name) for f in dataclasses.fields(METHODS[method].settings)}


def static_settings(method: str, chosen: dict[str, Any]) -> tuple[Any, ...]:
    """The values of those settings that a program is compiled for."""
    if method in PEERS:
        return ()
    fields = dataclasses.fields(METHODS[method].settings)
    whole = all_settings(method, chosen)
    return tuple(whole[field.name] for field in fields if field.metadata.get("static"))


def _wrong(method: str, combination: dict[str, Any]) -> Place:
    """The first setting that is wrong alone, if one is."""
    for name, value in combination.items():
        try:
            all_settings(method, {name: value})
        except ValueError:
            return (name,)
    return ()
