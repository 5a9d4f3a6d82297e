"""Every rival of the library."""

from .linear import SolverName
from .plain import QUAD4_CENTRE, Plain
from .rival import QUAD4, QUAD9, QUAD9_REDUCED, TRIANGLE6, Rival
from .with_dolfinx import Dolfinx
from .with_felupe import FElupe
from .with_native import Native


def _in_process(solver: SolverName) -> tuple[Rival, ...]:
    return (
        FElupe(QUAD4, solver),
        FElupe(TRIANGLE6, solver),
        FElupe(QUAD9, solver),
        Plain(QUAD4, solver=solver),
        Plain(QUAD4_CENTRE, 1.0, solver),
        Plain(TRIANGLE6, solver=solver),
        Plain(QUAD9, solver=solver),
        Plain(QUAD9_REDUCED, solver=solver),
        Native(QUAD4, solver),
        Native(TRIANGLE6, solver),
    )


#: Each code and element with the fastest linear solver that it can take, and with that
#: of SciPy alone; DOLFINx has but its own.
RIVALS: tuple[Rival, ...] = (
    *_in_process("fastest"),
    Dolfinx(QUAD4),
    Dolfinx(TRIANGLE6),
    *_in_process("SciPy"),
)
