from jaxclay.clay import Clay as Clay, Material as Material
from jaxclay.methods import METHODS as METHODS
from jaxclay.minimize import Status as Status, deform as deform, minimize as minimize
from jaxclay.problem import pose as pose, total_energy as total_energy
from jaxclay.scm import rough_shape as rough_shape
from jaxclay.squash import Squash as Squash
