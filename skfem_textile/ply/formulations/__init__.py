"""Formulations, one a file: on which element, at which points, what stabilises it."""

from ...registration import FormulationRegistration, registered
from .full import Full
from .macro import Macro
from .one_point import Kind, OnePoint
from .quadratic import Quadratic

#: The formulations by their names on the command line.
FORMULATIONS = registered(__name__, FormulationRegistration)

#: The formulation where none is given.
DEFAULT = Macro()

__all__ = ["DEFAULT", "FORMULATIONS", "Full", "Kind", "Macro", "OnePoint", "Quadratic"]
