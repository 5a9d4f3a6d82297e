r"""Woven fabric.

A woven fabric is nearly inextensible along two families of fibres and shears easily.
Let the complex number :math:`z_k` be the deformed fibre
:math:`(\boldsymbol{I} + \nabla\boldsymbol{u})\,\boldsymbol{a}_k`. Real and imaginary
part of :math:`\log z_k` are the strain of the fibre and its direction, so that the
energy per area is

.. math::
    \tfrac12 E \sum_k (\operatorname{Re} \log z_k)^2 +
    \tfrac12 G (\operatorname{Im} \log z_1 / z_2 - \tfrac{\pi}{2})^2 .

Elements with 2×2 points that are not aligned with the fibres lock. With one point, and
a stabilisation :math:`C` of the fluctuation of the shear, they do not [1]_.

.. [1] N. Hamila & P. Boisse (2013), Composites Part A 52, 135–144.
"""

import numpy as np
from skfem import (
    Basis,
    BilinearForm,
    ElementQuad1,
    ElementVector,
    LinearForm,
    MeshQuad,
    condense,
    solve,
)

E, G, C = 1e4, 0.5, 5.0  # N/mm
A = np.exp(1j * np.pi * np.array([3, 1]) / 4)[:, None, None]  # fibres at ±45°


class Fluctuation(ElementQuad1):
    def lbasis(self, X, i):
        phi, dphi = super().lbasis(X, i)
        return phi, dphi - super().lbasis(0 * X + 0.5, i)[1]


def stretched(u):  # ∇u a of both families
    dx, dy = u.grad[0] + 1j * u.grad[1]
    return A.real * dx + A.imag * dy


@LinearForm
def residual(v, w):
    z = A + stretched(w["u"])
    d, log = stretched(v) / z, np.log(z)
    shear = (log[0] - log[1]).imag - np.pi / 2
    return E * (log.real * d.real).sum(axis=0) + G * shear * (d[0] - d[1]).imag


@BilinearForm
def tangent(u, v, w):
    z = A + stretched(w["u"])
    d, e, log = stretched(v) / z, stretched(u) / z, np.log(z)
    shear = (log[0] - log[1]).imag - np.pi / 2
    material = E * (d.real * e.real).sum(axis=0)
    material += G * (d[0] - d[1]).imag * (e[0] - e[1]).imag
    second = -d * e
    geometric = E * (log.real * second.real).sum(axis=0)
    return material + geometric + G * shear * (second[0] - second[1]).imag


@BilinearForm
def hourglass(u, v, w):
    d, e = stretched(v) / A, stretched(u) / A
    return C * (d[0] - d[1]).imag * (e[0] - e[1]).imag


mesh = MeshQuad.init_tensor(np.linspace(0, 50, 13), np.linspace(0, 100, 25))
mesh = mesh.with_defaults()
centre = np.full((2, 1), 0.5), np.ones(1)
basis = Basis(mesh, ElementVector(ElementQuad1()), quadrature=centre)
K_hg = hourglass.assemble(Basis(mesh, ElementVector(Fluctuation()), intorder=2))
top, D = basis.get_dofs("top"), basis.get_dofs({"top", "bottom"})
u, goal = basis.zeros(), basis.zeros()
for pulled in np.linspace(1, 15, 15):  # mm
    goal[top.nodal["u^2"]] = pulled
    for _ in range(8):
        K = tangent.assemble(basis, u=u) + K_hg
        f = residual.assemble(basis, u=u) + K_hg @ u
        u += solve(*condense(K, -f, x=goal - u, D=D))

z = A + stretched(basis.interpolate(u))
shear = np.degrees(np.angle(z[0] / z[1]) - np.pi / 2)[:, 0]

if __name__ == "__main__":
    from skfem.visuals.matplotlib import plot, show

    deformed = MeshQuad(mesh.p + u.reshape(-1, 2).T, mesh.t)
    plot(deformed, shear, colorbar="shear angle (°)")
    show()
