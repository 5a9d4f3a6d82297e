"""What a ply is made of: fibre directions, and laws of tension and shear."""

from .fabric import Direction, Fabric, Family, unit_vectors
from .law import BiaxialLaw, Law, Linear, Slopes, TwoLaws, is_zero
from .laws.crimp_interchange import CrimpInterchange
from .laws.crimp_toe import CrimpToe
from .laws.crimped_yarns import CrimpedYarns, Softening
from .laws.locking import Locking
from .laws.one_sided import Asymmetric, TensionOnly
from .laws.polynomial import Polynomial
from .laws.pretensioned import Pretensioned
from .laws.sin2 import Sin2
from .laws.tabulated import Tabulated
from .laws.tangent_shear import TangentShear
from .meshing import mesh_along_fibres

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
    "mesh_along_fibres",
    "unit_vectors",
]
