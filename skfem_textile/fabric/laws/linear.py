"""The linear law by its name."""

from ...registration import LawRegistration, Option
from ..law import Linear

#: The parameter of laws that have no other.
STIFFNESS = Option(
    name="stiffness",
    help="N/mm",
    default=0.0,
    read=float,
    metavar="G",
    unit="N_per_mm",
)

REGISTRATION = LawRegistration(
    name="linear",
    description="M_s = G gamma, or T = E eps",
    build=Linear,
    options=(STIFFNESS,),
)
