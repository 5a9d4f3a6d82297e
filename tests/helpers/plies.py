"""Plies of tests: squares that bend, quadratic triangles, user-defined terms."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from skfem import (
    BilinearForm,
    ElementQuad1,
    ElementVector,
    Functional,
    LinearForm,
    MeshTri,
)
from skfem.helpers import dot

from skfem_textile import (
    Condition,
    Fabric,
    Forms,
    FormTerm,
    Full,
    LoadStepper,
    Macro,
    OnePoint,
    Ply,
    Quadratic,
    Term,
    TermParameters,
    Values,
)
from skfem_textile.scenes.rectangle import rectangle
from tests.helpers import distorted

# Shared by tests of bending: a square, inclined fibres, formulations


FORMULATIONS = {
    "one point": OnePoint(),
    "full": Full(),
    "macro": Macro(),
    "quadratic": Quadratic(),
}
every_formulation = pytest.mark.parametrize(
    "formulation", FORMULATIONS.values(), ids=FORMULATIONS
)

SIDE, D = 100.0, 10.0


def inclined(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return {"warp": (c, s), "weft": (-s, c)}


def square(n, jitter=0.0, side=SIDE):
    return rectangle(side, side, (n, n), "irregular", jitter, 1)


#: Fibres with different curvatures.
CURVED = {
    "warp": lambda x: np.stack([np.cos(0.2 * x[1]), np.sin(0.2 * x[1])]),
    "weft": lambda x: np.stack([-np.sin(0.3 * x[0]), np.cos(0.2 * x[0])]),
}


# Plies of quadratic triangles


SQUARES = MeshTri().refined(2).with_defaults()
ONE = MeshTri(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), np.arange(3)[:, None])


def ply_on(mesh, shear=1.0):
    return Ply(mesh, Fabric(10.0, shear), Quadratic())


def dofs(ply, columns):
    """The DOF vector of one column per node."""
    u = ply.basis.zeros()
    u[ply.nodal(np.arange(ply.basis.N))] = columns
    return u


def lifted(ply, z):
    """Displacement of a ply in space along z only."""
    u = ply.basis.zeros()
    u[2::3] = z
    return u


def run(scene, steps=4, E=1e4, G=0.0, **options):
    ply = Ply(scene.mesh, Fabric(E, G, scene.warp, scene.weft), Quadratic())
    return LoadStepper(ply, scene.conditions, steps, **options).run()


# A ply, and user-defined terms for it: springs, and one with parameters


SPRINGS = Forms(
    Functional(lambda w: 0.5 * (1 + w["t"]) * dot(w["u"], w["u"])),
    LinearForm(lambda v, w: (1 + w["t"]) * dot(w["u"], v)),
    BilinearForm(lambda u, v, w: (1 + w["t"]) * dot(u, v)),
)
ELEMENT = ElementVector(ElementQuad1())
CONDITIONS = {
    "clamp": Condition("bottom"),
    "pull": Condition("top", 0.3, direction=(1, 0)),
}


def plain(formulation=None):
    mesh = distorted(1).with_defaults()
    mesh = mesh.with_subdomains({"some": np.arange(5)})
    return Ply(mesh, Fabric(1e3, 0.5), formulation or OnePoint(1.0))


class Spring(Term):
    """A spring between two nodes, with the minimal interface of a term."""

    name, role = "spring", "internal"

    def __init__(self, N, couples=None):
        ends = np.zeros((1, N))
        ends[0, 0], ends[0, -2] = -1.0, 1.0
        self.K = csr_matrix(3.0 * ends.T @ ends)
        self._couples = couples

    def energy(self, u, t, p):
        return 0.5 * u @ (self.K @ u)

    def residual(self, u, t, p):
        return self.K @ u

    def tangent(self, u, t, p):
        return self.K

    def couples(self):
        return self._couples


DRAG = Forms(
    Functional(lambda w: 0.5 * dot(w["u"] - w["last"], w["u"] - w["last"])),
    LinearForm(lambda v, w: dot(w["u"] - w["last"], v)),
    BilinearForm(lambda u, v, w: dot(u, v)),
)


class Drag(TermParameters):
    """The displacement of the last converged state, and the number of steps."""

    def __init__(self, basis, depends_on_steps=False):
        self.basis, self.depends_on_steps = basis, depends_on_steps

    def at_rest(self):
        zero = self.basis.zeros()
        return Values({"last": zero, "times": zero})

    def advanced(self, values, u, t):
        return Values({"last": u, "times": values["times"] + 1.0})


def drag_term(ply, depends_on_steps=False, **options):
    """A term with a force towards the last converged displacement."""
    parameters = Drag(ply.basis, depends_on_steps)
    return FormTerm("drag", DRAG, ply.basis, parameters=parameters, **options)
