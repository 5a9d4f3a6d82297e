"""A ply, and terms of one's own for it: springs, and what remembers."""

import numpy as np
from helpers import distorted
from scipy.sparse import csr_matrix
from skfem import BilinearForm, ElementQuad1, ElementVector, Functional, LinearForm
from skfem.helpers import dot

from skfem_textile import Condition, Fabric, Forms, OnePoint, Ply, Term

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
    """A spring between two nodes, with no more than a term needs."""

    name, role = "spring", "internal"

    def __init__(self, N, couples=None):
        ends = np.zeros((1, N))
        ends[0, 0], ends[0, -2] = -1.0, 1.0
        self.K = csr_matrix(3.0 * ends.T @ ends)
        self._couples = couples

    def energy(self, u, t):
        return 0.5 * u @ (self.K @ u)

    def residual(self, u, t):
        return self.K @ u

    def tangent(self, u, t):
        return self.K

    def couples(self):
        return self._couples


class Drag:
    """A memory: drawn to the last converged displacement."""

    work, depends_on = 0.0, "path"

    def __init__(self, basis):
        self.basis = basis
        self.begin()

    def begin(self):
        self.parameters = {"last": self.basis.zeros()}

    def commit(self, u):
        self.parameters = {"last": u.copy()}
        return True

    def restore(self, parameters, work):
        self.parameters = parameters
