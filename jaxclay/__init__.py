"""Differentiable virtual clay: rotationally symmetric deformation by energy minimisation."""

import builtins

from jaxclay.cli import starting as starting  # first: it ends what is interrupted meanwhile
from jaxclay import moved as moved
from jaxclay.version import __version__ as __version__

from jaxclay.solve.batch import deform_batch as deform_batch, minimize_batch as minimize_batch
from jaxclay.solve.certificate import Certificate as Certificate
from jaxclay.clay.clay import Clay as Clay
from jaxclay.model.material import Material as Material
from jaxclay.numerics.compilations import keep_compilations as keep_compilations
from jaxclay.clay.contour import area_error as area_error, contour_error as contour_error
from jaxclay.schemes.energies import (
    bending_energy as bending_energy,
    energy_terms as energy_terms,
    friction_energy as friction_energy,
    strain_energy as strain_energy,
    tension_energy as tension_energy,
    total_energy as total_energy,
)
from jaxclay.model.energy import Terms as Terms
from jaxclay.methods import METHODS as METHODS
from jaxclay.solve.minimize import deform as deform, minimize as minimize
from jaxclay.solve.solution import Solution as Solution, Status as Status
from jaxclay.schemes.posing import pose as pose
from jaxclay.schemes.problem import Problem as Problem
from jaxclay.files.profiles import (
    PROFILES as PROFILES,
    load_profile as load_profile,
    save_profile as save_profile,
)
from jaxclay.schemes.spline.problem import SplineProblem as SplineProblem
from jaxclay.schemes.rough import RoughShape as RoughShape, rough_shape as rough_shape
from jaxclay.model.squash import Squash as Squash
from jaxclay.files.svg import save_svg as save_svg

if hasattr(builtins, "__IPYTHON__"):
    keep_compilations()


def __getattr__(name: str):
    """``jaxclay.plots`` and ``studio``, loaded when asked for, since they need more packages."""
    if name in ("plots", "studio"):
        import importlib

        return importlib.import_module(f"jaxclay.{'files.' if name == 'plots' else ''}{name}")
    raise AttributeError(f"module 'jaxclay' has no attribute {name!r}")


moved.install()
