r"""Woven fabric.

A woven fabric is nearly inextensible along two families of fibres and shears easily.
With fibres and displacement gradient as complex numbers, let :math:`z_k = 1 +
(\nabla\boldsymbol{u}\,\boldsymbol{a}_k) / a_k` be the deformed fibre over the initial
fibre :math:`a_k`. Real and imaginary part of :math:`\log z_k` are the strain of the
fibre and its rotation, so that the energy per area is

.. math::
    \tfrac12 E \sum_k (\operatorname{Re} \log z_k)^2 +
    \tfrac12 G (\operatorname{Im} \log z_1 - \operatorname{Im} \log z_2)^2 .

Elements with 2×2 points that are not aligned with the fibres lock: the load of a strip
that is pulled is many times too large. With one point, and a stabilisation of the
fluctuation of the shear by a stiffness :math:`C` between both, they do not [1]_.

.. [1] N. Hamila & P. Boisse (2013), Composites Part A 52, 135–144.
"""

import numpy as np
from skfem import *

E, G, C = 1e4, 0.5, 5.0  # N/mm
STIFFNESS = np.array([E, E, G])[:, None, None]
A = np.exp(1j * np.pi * np.array([1, 3]) / 4)[:, None, None]  # fibres at ±45°


class Fluctuation(ElementQuad1):
    def gbasis(self, mapping, X, i, tind=None):
        (field,) = super().gbasis(mapping, X, i, tind)
        (centre,) = super().gbasis(mapping, np.full_like(X, 0.5), i, tind)
        return (DiscreteField(np.asarray(field), grad=field.grad - centre.grad),)


def change(u):  # of both fibres, relative to them
    dx, dy = u.grad[0] + 1j * u.grad[1]
    return (A.real * dx + A.imag * dy) / A


def strains(log):  # of both fibres, and shear angle
    return np.array([*log.real, (log[0] - log[1]).imag])


@LinearForm
def residual(v, w):
    z = 1 + change(w["u"])
    return (STIFFNESS * strains(np.log(z)) * strains(change(v) / z)).sum(axis=0)


@BilinearForm
def tangent(u, v, w):
    z = 1 + change(w["u"])
    du, dv = change(u) / z, change(v) / z
    geometric = -strains(np.log(z)) * strains(du * dv)
    return (STIFFNESS * (strains(du) * strains(dv) + geometric)).sum(axis=0)


@BilinearForm
def hourglass(u, v, w):
    return C * strains(change(u))[2] * strains(change(v))[2]


def pull(basis, stabilisation):
    top, fixed = basis.get_dofs("top").nodal["u^2"], basis.get_dofs({"top", "bottom"})
    u, goal = basis.zeros(), basis.zeros()
    for goal[top] in np.linspace(3, 15, 5):  # mm
        for _ in range(8):
            f = residual.assemble(basis, u=u) + stabilisation @ u
            K = tangent.assemble(basis, u=u) + stabilisation
            du = solve(*condense(K, -f, x=goal - u, D=fixed))
            u += du
        assert np.linalg.norm(du) < 1e-9, "Newton's method did not converge"
    return u, f[top].sum()


mesh = MeshQuad.init_tensor(np.linspace(0, 50, 13), np.linspace(0, 100, 25))
mesh, element = mesh.with_defaults(), ElementVector(ElementQuad1())
K_hg = hourglass.assemble(Basis(mesh, ElementVector(Fluctuation()), intorder=2))
basis = Basis(mesh, element, quadrature=(np.full((2, 1), 0.5), np.ones(1)))
u, load = pull(basis, K_hg)
_, locked = pull(Basis(mesh, element, intorder=2), 0 * K_hg)
angle = np.degrees(strains(np.log(1 + change(basis.interpolate(u))))[2, :, 0])

if __name__ == "__main__":
    print(f"load {load:.1f} N, with 2×2 points {locked:.1f} N")
    mesh.translated(u[basis.nodal_dofs]).plot(angle, colorbar="shear angle (°)").show()
