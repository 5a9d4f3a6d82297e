"""Cases that calibrate the estimate, judge it, meet a tolerance, or compare meshes."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from skfem_textile import Fabric, Ply
from skfem_textile.ply.ply import DEFAULT
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, bias_extension

from ..angles.cases import G, Reference, Specimen
from ..angles.references import stored

#: Of the pull at equal unknowns: angles in degrees, and unknowns at most.
KINKS, MOST_UNKNOWNS = (30.0, 45.0, 60.0), 25_000

#: Cells along a side of a rhombus of the mesh along the fibres.
CELLS = 16

#: Tolerance of the load that is asked for.
TOLERANCE = 0.01


@dataclass(frozen=True)
class Case:
    """A pull along the bisector of the fibres, and what it is for.

    Attributes
    ----------
    task
        ``calibrates`` or ``judges`` the estimate, ``tolerance``, or ``kinks``.
    degrees, gamma
        Inclination of the fibres, and shear angle at the end.
    E
        Fibre stiffness in N/mm.
    mesh, across, seed
        Kind of mesh, its elements across, and seed.
    """

    task: str
    degrees: float
    gamma: float
    E: float
    mesh: str
    across: int
    seed: int = 1

    def scene(self) -> Scene:
        """The scene."""
        theta = np.radians(self.degrees)
        size = self.across, round(2 * self.across * np.tan(theta))
        return bias_extension(
            self.mesh,
            size,
            seed=self.seed,
            warp=theta,
            weft=np.pi - theta,
            shear_angle=np.radians(self.gamma),
        )

    def ply(self, scene: Scene, formulation: Formulation = DEFAULT) -> Ply:
        """The ply."""
        fabric = Fabric(self.E, G, scene.warp, scene.weft)
        return Ply(scene.mesh, fabric, formulation)

    @property
    def specimen(self) -> Specimen:
        """The same ply in the study of angles."""
        return Specimen(self.degrees, "linear", self.E / G)

    def reference(self, scene: Scene) -> float:
        """The load in N at the end: that of the study of angles."""
        assert scene.load is not None
        inextensible = scene.load(self.specimen.shear_law, 1.0)
        share = stored()[self.specimen, round(self.gamma)]["load"]
        return float(share * inextensible)

    def scene_along_fibres(self) -> Scene:
        """The scene up to 40 degrees on the coarser mesh of the study's references."""
        return self.specimen.scene(Reference(self.specimen).mesh(CELLS))


def all_cases() -> Iterator[Case]:
    """Every case; those that judge have other meshes and stiffnesses, more angles."""
    meshes, gammas = ("irregular", "delaunay"), (20.0, 40.0)
    for degrees, gamma, mesh, across in product(
        (30.0, 45.0, 60.0), gammas, meshes, (6, 12)
    ):
        yield Case("calibrates", degrees, gamma, 1e6, mesh, across, seed=1)
    angles = (30.0, 37.5, 45.0, 52.5, 60.0)
    for degrees, gamma, mesh, across in product(angles, gammas, meshes, (8, 16)):
        yield Case("judges", degrees, gamma, 1e5, mesh, across, seed=2)
    for degrees, gamma, mesh in product(angles, gammas, meshes):
        yield Case("tolerance", degrees, gamma, 1e5, mesh, 6, seed=3)
    for kinked in KINKS:
        yield Case("kinks", kinked, 40.0, 1e6, "delaunay", 4)
