"""Terms of one's own: an elastic foundation, and a shear law with a kernel.

A term is given by scikit-fem forms of its energy.  A kernel gives the same numbers for
all elements at once.
"""

import numpy as np
from skfem import BilinearForm, Functional, LinearForm, MeshQuad
from skfem.helpers import dot

from skfem_textile import (
    Condition,
    Fabric,
    Forms,
    FormTerm,
    Full,
    LoadStepper,
    Ply,
    forms,
)
from skfem_textile.ply.kernels.kernel import ShearKernel

E, K = 1e3, 0.4  # fibre stiffness in N/mm, foundation in N/mm³
LENGTH, MOVED = 100.0, 0.01  # mm


def foundation(k):
    """The energy k u²/2 per area."""
    return Forms(
        Functional(lambda w: 0.5 * k * dot(w["u"], w["u"])),
        LinearForm(lambda v, w: k * dot(w["u"], v)),
        BilinearForm(lambda u, v, w: k * dot(u, v)),
    )


def fibres_on_a_foundation():
    """Fibres that are pulled at one end: E u″ = k u."""
    x, y = np.linspace(0.0, LENGTH, 201), np.linspace(0.0, 10.0, 3)
    mesh = MeshQuad.init_tensor(x, y).with_defaults()
    ply = Ply(mesh, Fabric(E, 1.0), Full())
    ply = ply.with_terms(FormTerm("foundation", foundation(K), ply.basis))
    conditions = {
        "pulled": Condition("right", MOVED, direction=(1, 0)),
        "level": Condition(lambda X: X[0] >= 0, 0.0, direction=(0, 1)),
    }
    state = LoadStepper(ply, conditions, steps=1).run().states[-1]
    rate = np.sqrt(K / E)
    exact = E * rate * np.tanh(rate * LENGTH) * MOVED * 10.0
    found = state.reactions["pulled"][0]
    print(f"foundation: pulled with {found:.5f} N, exact {exact:.5f} N")
    assert abs(found / exact - 1) < 1e-3


class Stiffening:
    """A shear law that becomes stiffer: M_s = c Γ³."""

    def energy(self, x):
        return 0.25 * x**4

    def value(self, x):
        return x**3

    def tangent(self, x):
        return 3 * x**2


def a_further_shear_law():
    """Two shear laws in one ply, with a kernel and without: the same answer."""
    mesh = MeshQuad().refined(2).with_defaults()
    ply, further = Ply(mesh, Fabric(E, 1.0), Full()), Fabric(E, Stiffening())

    def sheared(X, t):
        angle = t * np.pi / 4
        return X[1] * np.array([[np.sin(angle)], [np.cos(angle) - 1]])

    def rim(X):
        return np.any((X == 0) | (X == 1), axis=0)

    conditions = {"frame": Condition(rim, sheared)}
    energies = []
    for kernel in (None, ShearKernel(further)):
        term = FormTerm("stiffening", forms.shear(further), ply.basis, kernel)
        result = LoadStepper(ply.with_terms(term), conditions, steps=2).run()
        energies.append(result.states[-1].energies)
    print(f"stiffening: {energies[1]['stiffening']:.6f} N·mm of {energies[1]}")
    exact = 0.25 * (np.pi / 4) ** 4
    assert abs(energies[0]["stiffening"] - energies[1]["stiffening"]) < 1e-12
    assert abs(energies[1]["stiffening"] / exact - 1) < 1e-6


if __name__ == "__main__":
    fibres_on_a_foundation()
    a_further_shear_law()
