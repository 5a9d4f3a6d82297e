"""Methods, meshes and cases of the study of the inf-sup constant."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy import ndarray
from skfem import Mesh

from skfem_textile.fabric import Fabric
from skfem_textile.mesh.splitting import cut
from skfem_textile.ply.formulations import Full, Macro, OnePoint, Quadratic
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes.rectangle import rectangle

from ..common.tables import Row
from .constraints import Constraints, spectrum
from .motions import KINKED, SMOOTH, distances, stiffness

#: Stiffness of fibres and of shear in N/mm, of real fabrics at the upper end.
E, G = 1e6, 1.0

#: Spacings of nodes along a side of the unit square.
ACROSS = (4, 8, 16, 24)

#: Shear angle in degrees of the sheared state, and the finest mesh for it.
SHEARED, SHEARED_ACROSS = 40, 16

#: How often the mesh is refined on which the norm of a tension is taken; and once more,
#: on meshes of so many spacings, to see what that changes.
REFINED, CHECKED_ACROSS = 2, 8


@dataclass(frozen=True)
class Method:
    """A formulation on quadrilaterals or triangles.

    ``parts`` is the number of spacings of nodes along an edge of the user's element.
    """

    name: str
    formulation: Formulation
    triangles: bool = False
    parts: int = 2


TWO_BY_TWO = Method("2×2 points, quads", Full(), parts=1)
ONE_POINT = Method("one point, quads", OnePoint(), parts=1)
ONE_POINT_TRIANGLES = Method("one point, split triangles", OnePoint(), triangles=True)
QUADRATIC = Method("quadratic triangles", Quadratic(), triangles=True)
QUADRATIC_MEAN = Method("quadratic, mean", Quadratic(80.0), triangles=True)
MACRO = Method("macro-elements, quads", Macro())
MACRO_TRIANGLES = Method("macro-elements, triangles", Macro(), triangles=True)
METHODS = (
    TWO_BY_TWO,
    ONE_POINT,
    ONE_POINT_TRIANGLES,
    QUADRATIC,
    QUADRATIC_MEAN,
    MACRO,
    MACRO_TRIANGLES,
)


@dataclass(frozen=True)
class Layout:
    """Fibres at an angle in degrees to a regular or an irregular mesh."""

    angle: int
    regular: bool = True

    def __str__(self) -> str:
        return f"{self.angle}°" if self.regular else f"{self.angle}°, irregular"


IRREGULAR = Layout(0, regular=False)
LAYOUTS = (*(Layout(angle) for angle in (0, 15, 30, 45)), IRREGULAR)


@dataclass(frozen=True)
class Case:
    """A method on the unit square, about a flat or a sheared state."""

    method: Method
    layout: Layout
    across: int
    shear: int = 0
    refined: int = REFINED

    def __str__(self) -> str:
        state = f", sheared {self.shear}°" if self.shear else ""
        mesh = f"{self.across} across, refined {self.refined}"
        return f"{self.method.name}, {self.layout}{state}, {mesh}"

    def mesh(self) -> Mesh:
        """The user's mesh; triangles of a regular one are squares cut in two."""
        n = self.across // self.method.parts
        triangles, regular = self.method.triangles, self.layout.regular
        if not regular:
            return rectangle(1, 1, (n, n), "delaunay" if triangles else "irregular")
        squares: Any = rectangle(1, 1, (n, n), "aligned")
        return cut(squares) if triangles else squares

    def directions(self) -> ndarray:
        """Unit reference directions of warp and weft, as columns."""
        angle = np.radians(self.layout.angle)
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, -s], [s, c]])

    def constraints(self) -> Constraints:
        """What the formulation asks; each family turns by half of the shear angle."""
        A, half = self.directions(), np.radians(self.shear) / 2
        closer = np.array([[np.cos(half), np.sin(half)], [np.sin(half), np.cos(half)]])
        mesh = self.method.formulation.working_mesh(self.mesh())
        fabric = Fabric(E, G, *A.T)
        return Constraints(mesh, fabric, self.method.formulation, A @ closer @ A.T)

    def rows(self) -> list[Row]:
        """Singular values, kernel and distances; of flat plies the stiffness too."""
        asked = self.constraints()
        found = spectrum(asked, self.refined)
        row: Row = {
            "method": self.method.name,
            "layout": str(self.layout),
            "shear": self.shear,
            "refined": self.refined,
            "across": self.across,
            "unknowns": asked.basis.N,
            "constraints": asked.matrix.shape[0],
            "rank": len(found.values),
            "kernel": found.kernel.shape[1],
            "inf_sup": found.inf_sup,
            "inf_sup_in_l2": found.in_l2,
            "largest": float(found.values[-1]),
            "largest_zero": found.largest_zero,
        }
        for kind, profiles in (("smooth", SMOOTH), ("kinked", KINKED)):
            from_mesh, from_kernel = distances(asked, found.kernel, profiles)
            row[f"{kind}_from_mesh"] = from_mesh
            row[f"{kind}_from_kernel"] = from_kernel
            if not self.shear:
                row[f"{kind}_stiffness"] = stiffness(asked, profiles)
        return [row]


def all_cases() -> Iterator[Case]:
    """Every case: flat, sheared, and with the norm taken on a finer mesh."""
    for method, layout in product(METHODS, LAYOUTS):
        for across in ACROSS:
            yield Case(method, layout, across)
        if layout.regular:
            for across in (n for n in ACROSS if n <= SHEARED_ACROSS):
                yield Case(method, layout, across, SHEARED)
    for method in METHODS:
        yield Case(method, Layout(30), CHECKED_ACROSS, refined=REFINED + 1)
