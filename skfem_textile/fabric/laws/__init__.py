"""Laws of tension and shear, one a file."""

from ...registration import registered
from ..law import LawRegistration
from .linear import Linear
from .one_stiffness import is_zero
from .sin2 import Sin2

#: The laws by their names on the command line.
LAWS = registered(__name__, LawRegistration)

__all__ = ["LAWS", "Linear", "Sin2", "is_zero"]
