"""Plies of quadratic triangles."""

import numpy as np
from skfem import MeshTri

from skfem_textile import Fabric, LoadStepper, Ply, Quadratic

SQUARES = MeshTri().refined(2).with_defaults()
ONE = MeshTri(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.arange(3)[:, None])


def ply_on(mesh, shear=1.0):
    return Ply(mesh, Fabric(10.0, shear), Quadratic())


def dofs(ply, columns):
    """The DOF vector of one column per node."""
    u = ply.basis.zeros()
    u[ply.nodal(np.arange(ply.basis.N))] = columns
    return u


def run(scene, steps=4, E=1e4, G=0.0, **options):
    ply = Ply(scene.mesh, Fabric(E, G, scene.warp, scene.weft), Quadratic())
    return LoadStepper(ply, scene.conditions, steps, **options).run()
