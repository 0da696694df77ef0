"""Where modules of 0.1.0 have gone: their old names work for one release, and warn."""

from __future__ import annotations

import importlib
import importlib.abc
import importlib.machinery
import importlib.util
import sys
import warnings
from types import ModuleType

MODULES = {
    "arrays": "numerics.arrays",
    "atlas": "experiments",
    "band": "model.band",
    "banded": "numerics.banded",
    "banded_newton": "numerics.banded_newton",
    "batch": "solve.batch",
    "certificate": "solve.certificate",
    "certified_newton": "solve.certified_newton",
    "checks": "numerics.checks",
    "compare": "experiments",
    "compilations": "numerics.compilations",
    "contour": "clay.contour",
    "deform_command": "cli.deform",
    "distance": "numerics.distance",
    "energies": "schemes.energies",
    "energy": "model.energy",
    "implicit": "solve.implicit",
    "interpolation": "numerics.interpolation",
    "loop": "methods.loop",
    "plots": "files.plots",
    "posing": "schemes.posing",
    "problem": "schemes.problem",
    "profiles": "files.profiles",
    "resolution": "schemes.resolution",
    "scalar_search": "numerics.roots",
    "schemes.slices.ladder": "solve.carried",
    "schemes.slices.refining": "solve.refining",
    "schemes.spline.judge": "solve.certificate",
    "schemes.spline.sensitivity": "solve.spline_derivative",
    "schemes.spline.solve": "solve.on_spans",
    "scm": "schemes.rough",
    "side": "model.side",
    "slicing": "clay.slicing",
    "solution": "solve.solution",
    "squash": "model.squash",
    "start": "solve.start",
    "svg": "files.svg",
    "sweep": "experiments",
    "sweep.tables": "experiments.entries.tables",
    "sweep.columns": "experiments.columns",
    "system": "schemes.system",
}
"""Old names of modules and packages below ``jaxclay``, and the new ones."""

NAMES = {
    "banded": {
        "minimize_banded": "numerics.banded_newton.minimize_banded",
        "BandedResult": "numerics.banded_newton.BandedResult",
    },
    "clay": {
        "Clay": "clay.clay.Clay",
        "Converted": "clay.clay.Converted",
        "Material": "model.material.Material",
    },
    "cli": {"main": "cli.main.main", "entry": "cli.main.entry"},
    "compare": {
        "sweep": "experiments.run",
        "load": "experiments.load",
        "load_curves": "experiments.load_curves",
    },
    "loop": {"Forces": "schemes.base.Forces"},
    "certificate": {"Forces": "schemes.base.Forces"},
    "schemes.sums": {"Point": "schemes.sums.Displaced"},
    "schemes.spline.space": {"Point": "schemes.spline.space.Displaced"},
}
"""Names that have left a module for another one than the rest, or are called otherwise."""


def install() -> None:
    """Let imports find what has moved."""
    if not any(isinstance(finder, _Finder) for finder in sys.meta_path):
        sys.meta_path.append(_Finder())
    for old in ("clay", "cli", "schemes.sums", "schemes.spline.space"):
        importlib.import_module(f"jaxclay.{old}").__getattr__ = _names(old)  # type: ignore[attr-defined]


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Makes modules of old names, which hand on what the new ones hold."""

    def find_spec(self, fullname, path=None, target=None):
        old = fullname.removeprefix("jaxclay.")
        if old == fullname or _new(old) is None:
            return None
        return importlib.machinery.ModuleSpec(fullname, self, is_package=True)

    def create_module(self, spec):
        return None

    def exec_module(self, module: ModuleType) -> None:
        old = module.__name__.removeprefix("jaxclay.")
        new = f"jaxclay.{_new(old)}"
        _warn(module.__name__, new)
        own, there = _names(old), importlib.import_module(new)

        def get(name: str):
            if name in NAMES.get(old, {}):
                return own(name)
            return getattr(there, name)

        module.__doc__, module.__getattr__ = there.__doc__, get  # type: ignore[attr-defined]


def _new(old: str) -> str | None:
    """The new name of a module or of one within a package that has moved."""
    for name in (old, *(old[:i] for i, letter in enumerate(old) if letter == ".")):
        if name in MODULES:
            return MODULES[name] + old[len(name) :]
    return None


def _names(old: str):
    def get(name: str):
        new = NAMES.get(old, {}).get(name)
        if new is None:
            raise AttributeError(f"module 'jaxclay.{old}' has no attribute {name!r}")
        _warn(f"jaxclay.{old}.{name}", f"jaxclay.{new}")
        module, _, name = f"jaxclay.{new}".rpartition(".")
        return getattr(importlib.import_module(module), name)

    return get


def _warn(old: str, new: str) -> None:
    warnings.warn(f"{old} is now {new}", DeprecationWarning, stacklevel=4)
