"""A ply formed by a hemispherical punch through a die, in other codes with penalties.

Every code has the energy of `OnePoint` with a stabilisation stiffness that is given as
a number.  Tools are rigid.  The other codes have a penalty against them: ½ k Σ A φ²
over the nodes inside a tool, with their areas A and depths φ.
"""

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy import ndarray

from .codes import in_dolfinx
from .course import Course

_CHILD = Path(__file__).with_name("dolfinx_forming.py")


@dataclass(frozen=True)
class Forming:
    """A quarter of a square ply on two planes of symmetry, with fibres along its edges.

    The punch comes from below and moves up.  The ply rests on the plane of the holder
    below it and under the die above it, whose opening has a fillet.

    Attributes
    ----------
    parts
        Square elements along each side.
    penalty
        Stiffness k of the tools of other codes in N/mm³.
    side, radius, clearance, fillet, gap
        Side of the quarter, radius of the punch, clearance between punch and die,
        fillet of the die, and gap between die and holder, in mm.
    depth
        Largest travel of the punch in mm.
    E, G, D
        Stiffness of fibres and shear in N/mm, bending stiffness of fibres in N·mm.
    edge_tension
        Traction on the two free edges in N/mm.
    C_s
        Stiffness of the stabilisation in N/mm.
    friction, slip
        Coefficient of friction of all tools, and elastic slip in mm.
    """

    parts: int = 24
    penalty: float = 0.5
    side: float = 150.0
    radius: float = 75.0
    clearance: float = 5.0
    fillet: float = 10.0
    gap: float = 0.3
    depth: float = 75.0
    E: float = 1e4
    G: float = 0.1
    D: float = 5.0
    edge_tension: float = 0.2
    C_s: float = 0.8
    friction: float = 0.0
    slip: float = 0.02

    def travels(self, steps: int) -> ndarray:
        """Travels of the punch in mm at the end of equal steps."""
        return np.linspace(0.0, self.depth, steps + 1)[1:]


def dolfinx(case: Forming, steps: int, method: str = "descent") -> Course:
    """Form a ply with DOLFINx.

    The time excludes mesh, function space, compilation of the forms, and the matrix of
    bending.

    Parameters
    ----------
    case
        Ply and tools.
    steps
        Number of equal steps of the punch to its largest travel; see `course.formed`.
    method
        ``snes``: PETSc's Newton method with its l2 line search; ``descent``: Newton's
        method with a positive definite tangent and a line search on the energy.

    Raises
    ------
    DolfinxError
        If the DOLFINx process fails.
    """
    travels = case.travels(steps)
    data = in_dolfinx(_CHILD, travels=travels, method=method, **asdict(case))
    return Course.of(data["rows"], str(data["failure"]))
