"""
User-defined terms
==================

A term is defined by scikit-fem forms of its energy: first an elastic foundation under
fibres pulled at one end, then an additional shear law. The displacement of the fibres
agrees with the closed form.
"""

import matplotlib.pyplot as plt
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
    shear,
)

E, K = 1e4, 4.0  # fibre stiffness in N/mm, foundation in N/mm³
LENGTH, MOVED = 100.0, 0.01  # mm

# %%
# An elastic foundation of stiffness ``k``.


def foundation(k):
    """Energy k u²/2 per area."""
    return Forms(
        Functional(lambda w: 0.5 * k * dot(w["u"], w["u"])),
        LinearForm(lambda v, w: k * dot(w["u"], v)),
        BilinearForm(lambda u, v, w: k * dot(u, v)),
    )


# %%
# Fibres pulled at one end: E u″ = k u.

x, y = np.linspace(0.0, LENGTH, 201), np.linspace(0.0, 10.0, 3)
mesh = MeshQuad.init_tensor(x, y).with_defaults()
ply = Ply(mesh, Fabric(E, 1.0), Full())
# `Full` has a basis with 2×2 points; else use `CellBasis(ply.mesh, ply.basis.elem)`.
ply = ply.with_terms(FormTerm("foundation", foundation(K), ply.basis))
conditions = {
    "pulled": Condition("right", MOVED, direction=(1, 0)),
    "level": Condition(lambda X: X[0] >= 0, 0.0, direction=(0, 1)),
}
state = LoadStepper(ply, conditions, steps=1).run().states[-1]
rate = np.sqrt(K / E)
exact = E * rate * np.tanh(rate * LENGTH) * MOVED * 10.0
force = state.reactions["pulled"][0]
print(f"foundation: force {force:.5f} N, exact {exact:.5f} N")
assert abs(force / exact - 1) < 1e-3

bottom = np.isclose(ply.nodes[1], 0.0)
x = ply.nodes[0, bottom][::8]
u = ply.nodal(state.u)[0, bottom][::8]
closed = MOVED * np.cosh(rate * x) / np.cosh(rate * LENGTH)

plt.rcParams["font.size"] = 8
figure, axes = plt.subplots(figsize=(3.35, 2.4), layout="constrained")
axes.plot(x, 1e3 * closed, label="Closed form")
axes.plot(x, 1e3 * u, "o", markersize=3, label="Ply")
axes.set(xlabel="Position along the fibres (mm)", ylabel="Displacement (µm)", ylim=0)
axes.legend(frameon=False)
figure.savefig("displacement.png", dpi=300)

# %%
# A stiffening shear law, M_s = c Γ³, is added to a ply.


class Stiffening:
    """A stiffening shear law: M_s = c Γ³."""

    def energy(self, x):
        return 0.25 * x**4

    def value(self, x):
        return x**3

    def tangent(self, x):
        return 3 * x**2


# %%
# The rim of a square imposes a shear angle of 45°.

mesh = MeshQuad().refined(2).with_defaults()
ply, further = Ply(mesh, Fabric(E, 1.0), Full()), Fabric(E, Stiffening())


def sheared(X, t):
    angle = t * np.pi / 4
    return X[1] * np.array([[np.sin(angle)], [np.cos(angle) - 1]])


def rim(X):
    return np.any((X == 0) | (X == 1), axis=0)


term = FormTerm("stiffening", shear(further), ply.basis)
frame = {"frame": Condition(rim, sheared)}
result = LoadStepper(ply.with_terms(term), frame, steps=2).run()
energy, exact = result.states[-1].energies["stiffening"], 0.25 * (np.pi / 4) ** 4
print(f"stiffening: {energy:.6f} N·mm, exact {exact:.6f} N·mm")
assert abs(energy / exact - 1) < 1e-6
