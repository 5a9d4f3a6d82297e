"""Cases that calibrate the estimate, judge it, meet a tolerance, or compare meshes."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from skfem_textile import Fabric, Ply
from skfem_textile.scenes import Scene, bias_extension

from .reference import G

#: Of the pull at equal unknowns: angles in degrees, and unknowns at most.
KINKS, MOST_UNKNOWNS = (30.0, 45.0, 60.0), 25_000

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

    def ply(self, scene: Scene) -> Ply:
        """The ply, of macro-elements."""
        return Ply(scene.mesh, Fabric(self.E, G, scene.warp, scene.weft))


def all_cases() -> Iterator[Case]:
    """Every case; those that judge have other angles, meshes and stiffnesses."""
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
