"""Nobody maintains jaxopt any more: without it everything works but its own methods."""

import importlib.abc
import sys

import jax
import pytest

from jaxclay import METHODS, Clay, Material, Squash, minimize, pose

ITS_OWN = ["lbfgs", "lbfgs-preconditioned", "lbfgsb", "projected-gradient", "augmented-lagrangian"]
OTHERS = [name for name in METHODS if name not in ITS_OWN]


class Broken(importlib.abc.MetaPathFinder):
    """An import as of a package that asks of JAX what is gone."""

    def find_spec(self, fullname, path=None, target=None):
        if fullname == "jaxopt":
            raise AttributeError("module 'jax' has no attribute 'tree_map'")


@pytest.fixture
def missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "jaxopt", None)


def traced(method):
    """A solve is traced alone: what it needs is imported then."""
    problem = pose(Clay.cylinder(slices=11), Squash(0.0, 0.5, 0.4), Material(), "paper")
    with jax.enable_x64(True):
        return jax.eval_shape(lambda problem: minimize(problem, method).energy, problem)


@pytest.mark.parametrize("method", ITS_OWN)
def test_its_methods_name_what_to_install(missing, method):
    with pytest.raises(ImportError, match="pip install jaxopt"):
        traced(method)


@pytest.mark.parametrize("method", OTHERS)
def test_others_do_without(missing, method):
    assert traced(method).shape == ()


def test_an_import_that_fails_otherwise_is_told_too(monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "jaxopt"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(sys, "meta_path", [Broken(), *sys.meta_path])
    with pytest.raises(ImportError, match=r"tree_map.*pip install jaxopt"):
        traced("lbfgs")
