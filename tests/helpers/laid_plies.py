"""Square plies that are laid on surfaces, held where their symmetry holds them."""

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, OnePoint, Ply, drape
from skfem_textile.solve.conditions import Constraints
from skfem_textile.solve.linear import solver_named
from skfem_textile.solve.problem import Problem
from studies.formulations.drape import chebyshev

RADIUS = 60.0
SYMMETRY = {
    "x": Condition("left", (0.0, None, None)),
    "y": Condition("bottom", (None, 0.0, None)),
}


def square(
    side=60.0,
    cells=4,
    fabric=None,
    formulation=None,
    loads=(),
    corner=(0.0, 0.0),
    mesh=MeshQuad,
):
    s = np.linspace(0, side, cells + 1)
    mesh = mesh.init_tensor(s, s).translated(corner).with_defaults()
    fabric, formulation = fabric or Fabric(1e4, 0.1), formulation or OnePoint()
    return Ply(mesh, fabric, formulation, loads, dimension=3)


def problem_of(ply, conditions):
    constraints = Constraints(ply.basis, conditions)
    return Problem(ply, constraints, solver_named("superlu"))


def laid(ply, surface, **options):
    """The displacement that lays a ply on a surface along its geodesics."""
    x = drape.exponential_map(surface, ply.nodes, **options)
    return drape.displacement(ply.nodes, x)


def positions(ply, u):
    """Where the nodes are in space, shape (3, n)."""
    return np.pad(ply.nodes, ((0, 1), (0, 0))) + ply.nodal(u)


def rolled(X):
    """Points of the flat ply on a cylinder of `RADIUS`, whose axis is y."""
    angle = X[0] / RADIUS
    return np.array([RADIUS * np.sin(angle), X[1], RADIUS * (np.cos(angle) - 1)])


def in_net(X):
    """Points of the flat ply in the Chebyshev net of the sphere."""
    n = 200
    net = drape.net(chebyshev.SPHERE, chebyshev.SIDE / n, (0, n), (0, n))
    s = np.linspace(0, chebyshev.SIDE, n + 1)
    place = RegularGridInterpolator((s, s), np.moveaxis(net.positions, 0, -1), "cubic")
    return place(X.T).T
