"""The cases: surfaces, stiffnesses, meshes and formulations, each at its extremes."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from skfem_textile import Full, Macro, OnePoint, Quadratic
from skfem_textile.ply.terms import Formulation

from .surfaces import SURFACES

FORMULATIONS: dict[str, Formulation] = {
    "macro": Macro(),
    "one point": OnePoint(),
    "2×2 points": Full(),
    "quadratic": Quadratic(80.0),
}


#: The kind of all cases.
EXTREME = "extreme"


@dataclass(frozen=True)
class Extreme:
    """One case.

    Attributes
    ----------
    group
        What is extreme about it.
    surface
        Name of `SURFACES`.
    bias
        Whether the fibres run at ±45° and not along the sides.
    stiffness
        E/G; G is 0.1 N/mm.
    formulation
        Name of `FORMULATIONS`.
    cells
        The user's elements a side.
    mesh
        Regular or distorted quadrilaterals, or triangles, or with a hole.
    bending
        D of both families in N·mm.
    tension
        Tension on the free edges in N/mm.
    mirrored
        Whether the surface is mirrored.
    growing
        Whether the surface grows out of the plane, in place of a start along geodesics.
    kind
        `EXTREME`.
    """

    group: str
    surface: str
    bias: bool
    stiffness: float = 1e6
    formulation: str = "macro"
    cells: int = 4
    mesh: str = "regular"
    bending: float = 0.0
    tension: float = 1.0
    mirrored: bool = False
    growing: bool = False
    kind: str = EXTREME

    def __str__(self) -> str:
        words = [self.kind, self.group, self.surface, "±45" if self.bias else "0/90"]
        words += [f"E/G={self.stiffness:g}", self.formulation, f"{self.cells} cells"]
        words += [self.mesh, f"D={self.bending:g}", f"q={self.tension:g}"]
        return ", ".join(words)


def all_extremes() -> Iterator[Extreme]:
    """All cases, group by group."""
    every = list(product(SURFACES, (False, True)))
    for on in every:
        for stiffness in (1e2, 1e4, 1e6, 1e8):
            yield Extreme("stiffness", *on, stiffness)
            yield Extreme("stiffness", *on, stiffness, "one point", 8)
        for mesh in ("distorted", "distorted triangles", "hole"):
            yield Extreme("mesh", *on, mesh=mesh)
        yield Extreme("mesh", *on, formulation="one point", cells=8, mesh="distorted")
        yield Extreme("mesh", *on, formulation="quadratic", mesh="triangles")
        yield Extreme("mesh", *on, formulation="quadratic", mesh="hole")
        yield Extreme("mesh", *on, formulation="2×2 points", cells=8)
        yield Extreme("coarse", *on, cells=2)
        yield Extreme("coarse", *on, formulation="one point", cells=3)
        for bending in (1.0, 1e2, 1e3):
            yield Extreme("bending", *on, bending=bending)
        yield Extreme("bending alone", *on, bending=10.0, tension=0.0)
        yield Extreme("bending alone", *on, bending=1e3, tension=0.0)
        yield Extreme("free edges", *on, tension=0.0)
        yield Extreme("mirrored", *on, mirrored=True)
        yield Extreme("growing", *on, growing=True)
