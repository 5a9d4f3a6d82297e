"""Laws of tension and shear by their names, one a file."""

from ...registration import LawRegistration, registered

#: The laws by their names on the command line.
LAWS = registered(__name__, LawRegistration)

__all__ = ["LAWS"]
