"""A ply, and terms of one's own for it: springs, and one with parameters."""

import numpy as np
from scipy.sparse import csr_matrix
from skfem import BilinearForm, ElementQuad1, ElementVector, Functional, LinearForm
from skfem.helpers import dot

from skfem_textile import (
    Condition,
    Fabric,
    Forms,
    FormTerm,
    OnePoint,
    Ply,
    Term,
    TermParameters,
    Values,
)
from tests.helpers import distorted

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


def drag(ply, depends_on_steps=False, **options):
    """A term that is drawn to the last converged displacement."""
    parameters = Drag(ply.basis, depends_on_steps)
    return FormTerm("drag", DRAG, ply.basis, parameters=parameters, **options)
