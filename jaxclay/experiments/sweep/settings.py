"""The settings of a method in an experiment file: every combination must be one it takes."""

from __future__ import annotations

import dataclasses
import itertools
import math
from typing import Any

from jaxclay.experiments.sweep.lines import MistakeAt, Place
from jaxclay.experiments.sweep.values import Values, as_whole
from jaxclay.methods import METHODS
from jaxclay.methods.choice import method_settings

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
            method_settings(method, combination)
        except ValueError as error:
            raise MistakeAt(_wrong(method, combination), str(error)) from None
    return found


def _numbers(method: str, name: str, values: Values) -> Values:
    """The setting's numbers; whole if its default is."""
    if values.random:
        raise ValueError("cannot be drawn at random: give a number, a list or a range")
    fields = dataclasses.fields(METHODS[method].settings)
    whole = any(field.name == name and isinstance(field.default, int) for field in fields)
    return as_whole(values) if whole else values


def _wrong(method: str, combination: dict[str, Any]) -> Place:
    """The first setting that is wrong alone, if one is."""
    for name, value in combination.items():
        try:
            method_settings(method, {name: value})
        except ValueError:
            return (name,)
    return ()
