"""Fabrics: fibre directions and constitutive laws of tension and shear."""

from .fabric import Direction, Fabric, Family, unit_vectors
from .law import BiaxialLaw, Law, Linear, Slopes, TwoLaws, is_zero
from .laws.biaxial import CrimpedYarns, CrimpInterchange, Softening
from .laws.polynomial import Polynomial
from .laws.shear import Locking, Sin2, TangentShear
from .laws.tabulated import Tabulated
from .laws.tension import Asymmetric, CrimpToe, Pretensioned, TensionOnly

__all__ = [
    "Asymmetric",
    "BiaxialLaw",
    "CrimpInterchange",
    "CrimpToe",
    "CrimpedYarns",
    "Direction",
    "Fabric",
    "Family",
    "Law",
    "Linear",
    "Locking",
    "Polynomial",
    "Pretensioned",
    "Sin2",
    "Slopes",
    "Softening",
    "Tabulated",
    "TangentShear",
    "TensionOnly",
    "TwoLaws",
    "is_zero",
    "unit_vectors",
]
