"""Every rival of the library."""

from .plain import QUAD4_CENTRE, Plain
from .rival import QUAD4, QUAD9, QUAD9_REDUCED, TRIANGLE6, Rival
from .with_dolfinx import Dolfinx
from .with_felupe import FElupe
from .with_native import Native

RIVALS: tuple[Rival, ...] = (
    Plain(QUAD4),
    Plain(QUAD4_CENTRE, C_s=1.0),
    Plain(TRIANGLE6),
    Plain(QUAD9),
    Plain(QUAD9_REDUCED),
    FElupe(QUAD4),
    FElupe(QUAD4, "pypardiso"),
    FElupe(TRIANGLE6),
    FElupe(TRIANGLE6, "pypardiso"),
    FElupe(QUAD9),
    Dolfinx(QUAD4),
    Dolfinx(TRIANGLE6),
    Native(QUAD4),
    Native(TRIANGLE6),
)
