"""Differentiable virtual clay: rotationally symmetric deformation by energy minimisation."""

import builtins

from jaxclay.batch import deform_batch as deform_batch, minimize_batch as minimize_batch
from jaxclay.certificate import Certificate as Certificate
from jaxclay.clay import Clay as Clay, Material as Material
from jaxclay.compilations import keep_compilations as keep_compilations
from jaxclay.contour import area_error as area_error, contour_error as contour_error
from jaxclay.energies import (
    bending_energy as bending_energy,
    energy_terms as energy_terms,
    friction_energy as friction_energy,
    strain_energy as strain_energy,
    tension_energy as tension_energy,
    total_energy as total_energy,
)
from jaxclay.energy import Terms as Terms
from jaxclay.methods import METHODS as METHODS
from jaxclay.minimize import (
    Solution as Solution,
    Status as Status,
    deform as deform,
    minimize as minimize,
)
from jaxclay.posing import pose as pose
from jaxclay.problem import Problem as Problem
from jaxclay.profiles import (
    PROFILES as PROFILES,
    load_profile as load_profile,
    save_profile as save_profile,
)
from jaxclay.schemes.spline.problem import SplineProblem as SplineProblem
from jaxclay.scm import RoughShape as RoughShape, rough_shape as rough_shape
from jaxclay.squash import Squash as Squash
from jaxclay.svg import save_svg as save_svg

__version__ = "0.1.0"

if hasattr(builtins, "__IPYTHON__"):
    keep_compilations()


def __getattr__(name: str):
    """``jaxclay.plots``, loaded when asked for, since it needs Matplotlib."""
    if name == "plots":
        import importlib

        return importlib.import_module("jaxclay.plots")
    raise AttributeError(f"module 'jaxclay' has no attribute {name!r}")
