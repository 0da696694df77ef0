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

LIMITS = ("max_iterations", "tolerance")  # what peers take
_MOST = 10_000  # combinations


def checked_settings(method: str, settings: dict[str, Values]) -> dict[str, Values]:
    """The settings, ints where the method counts with them.

    Raises
    ------
    MistakeAt
        The setting that is wrong, or none where they are only together.
    """
    found = {}
    for name, values in settings.items():
        try:
            found[name] = _numbers(method, name, values)
        except ValueError as error:
            raise MistakeAt((name,), str(error)) from None
    count = math.prod(len(values.entries) for values in found.values())
    if count > _MOST:
        raise ValueError(f"{count} combinations of settings: at most {_MOST} can be run")
    for each in itertools.product(*(values.fixed() for values in found.values())):
        combination = dict(zip(found, each, strict=True))
        try:
            all_settings(method, combination)
        except ValueError as error:
            raise MistakeAt(_wrong(method, combination), str(error)) from None
    return found


def _numbers(method: str, name: str, values: Values) -> Values:
    """The setting's numbers; whole if its default is."""
    if values.random:
        raise ValueError("cannot be drawn at random: give a number, a list or a range")
    whole = isinstance(all_settings(method, {}).get(name), int)
    return as_whole(values) if whole else values


def all_settings(method: str, chosen: dict[str, Any], scheme: str = "paper") -> dict[str, Any]:
    """The settings of a method or a peer by name, its defaults filled in.

    Raises
    ------
    ValueError
        A setting that it does not have, or a value that it does not take.
    """
    if method in PEERS:
        limits = PEERS[method].limits
        wrong = [name for name in chosen if name not in LIMITS]
        if wrong:
            message = f"{method} has no setting {wrong[0]!r}: it takes {', '.join(LIMITS)}"
            raise ValueError(message)
        return {name: getattr(limits, name) for name in LIMITS} | chosen
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
