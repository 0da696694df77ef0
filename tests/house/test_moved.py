"""Module names of 0.1.0 work for one release: they warn and say the new name."""

import importlib

import pytest

import jaxclay
from jaxclay import moved
from jaxclay.schemes.sums import Displaced


@pytest.mark.parametrize(
    "old", [name for name in moved.MODULES if name not in ("compare", "plots")]
)
def test_an_old_module_warns_and_holds_what_the_new_one_does(old):
    importlib.sys.modules.pop(f"jaxclay.{old}", None)
    with pytest.warns(
        DeprecationWarning, match=f"jaxclay.{old} is now jaxclay.{moved.MODULES[old]}"
    ):
        found = importlib.import_module(f"jaxclay.{old}")
    there = importlib.import_module(f"jaxclay.{moved.MODULES[old]}")
    names = [name for name in vars(there) if not name.startswith("_")]
    names = [name for name in names if name not in moved.NAMES.get(old, {})]
    assert all(getattr(found, name) is getattr(there, name) for name in names)
    with pytest.raises(AttributeError, match="nothing"):
        _ = found.nothing


OLD = [
    ("jaxclay.clay", "Clay", lambda: jaxclay.Clay),
    ("jaxclay.clay", "Material", lambda: jaxclay.Material),
    ("jaxclay.schemes.sums", "Point", lambda: Displaced),
    ("jaxclay.compare", "load", lambda: importlib.import_module("jaxclay.experiments").load),
    ("jaxclay.compare", "sweep", lambda: importlib.import_module("jaxclay.experiments").run),
]


@pytest.mark.filterwarnings("ignore:jaxclay.compare is now")
@pytest.mark.parametrize(("module", "name", "new"), OLD)
def test_an_old_name_in_a_module_warns_too(module, name, new):
    with pytest.warns(DeprecationWarning, match=f"{module}.{name} is now"):
        assert getattr(importlib.import_module(module), name) is new()


def test_functions_of_the_face_stay_functions():
    assert callable(jaxclay.minimize)
    assert jaxclay.plots is importlib.import_module("jaxclay.files.plots")
