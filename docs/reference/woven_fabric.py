r"""Woven fabric.

A woven fabric is nearly inextensible along two families of fibres and shears easily.
Let the complex number :math:`z_k` be the deformed fibre
:math:`(\boldsymbol{I} + \nabla\boldsymbol{u})\,\boldsymbol{a}_k`. Real and imaginary
part of :math:`\log z_k` are the strain of the fibre and its direction, so that the
energy per area is

.. math::
    \tfrac12 E \sum_k (\operatorname{Re} \log z_k)^2 +
    \tfrac12 G (\tfrac{\pi}{2} + \operatorname{Im} \log z_1 / z_2)^2 .

Elements with 2×2 points that are not aligned with the fibres lock: the load of a strip
that is pulled is many times too large. With one point, and a stabilisation of the
fluctuation of the shear by a stiffness :math:`C` between both, they do not [1]_.

.. [1] N. Hamila & P. Boisse (2013), Composites Part A 52, 135–144.
"""

import numpy as np
from skfem import (
    Basis,
    BilinearForm,
    DiscreteField,
    ElementQuad1,
    ElementVector,
    LinearForm,
    MeshQuad,
    condense,
    solve,
)

E, G, C = 1e4, 0.5, 5.0  # N/mm
A = np.exp(1j * np.pi * np.array([1, 3]) / 4)[:, None, None]  # fibres at ±45°


class Fluctuation(ElementQuad1):
    def gbasis(self, mapping, X, i, tind=None):
        (field,) = super().gbasis(mapping, X, i, tind)
        (centre,) = super().gbasis(mapping, np.full_like(X, 0.5), i, tind)
        return (DiscreteField(np.asarray(field), grad=field.grad - centre.grad),)


def stretched(u):  # ∇u a of both families
    dx, dy = u.grad[0] + 1j * u.grad[1]
    return A.real * dx + A.imag * dy


def shear(log):
    return np.pi / 2 + (log[0] - log[1]).imag


@LinearForm
def residual(v, w):
    z = A + stretched(w["u"])
    d, log = stretched(v) / z, np.log(z)
    return E * (log.real * d.real).sum(axis=0) + G * shear(log) * (d[0] - d[1]).imag


@BilinearForm
def tangent(u, v, w):
    z = A + stretched(w["u"])
    d, e, log = stretched(v) / z, stretched(u) / z, np.log(z)
    second = -d * e
    material = E * (d.real * e.real).sum(axis=0)
    material += G * (d[0] - d[1]).imag * (e[0] - e[1]).imag
    geometric = E * (log.real * second.real).sum(axis=0)
    return material + geometric + G * shear(log) * (second[0] - second[1]).imag


@BilinearForm
def hourglass(u, v, w):
    d, e = stretched(v) / A, stretched(u) / A
    return C * (d[0] - d[1]).imag * (e[0] - e[1]).imag


def pulled(basis, stabilisation):
    """Displacement and load of a strip that is pulled by 15 mm."""
    top, D = basis.get_dofs("top").nodal["u^2"], basis.get_dofs({"top", "bottom"})
    free = basis.complement_dofs(D)
    u, goal = basis.zeros(), basis.zeros()
    for goal[top] in np.linspace(1, 15, 15):
        for _ in range(20):
            f = residual.assemble(basis, u=u) + stabilisation @ u
            if np.abs(f[free]).max() < 1e-9 * E and np.allclose(u[top], goal[top]):
                break
            K = tangent.assemble(basis, u=u) + stabilisation
            u += solve(*condense(K, -f, x=goal - u, D=D))
        else:
            raise RuntimeError("Newton's method did not converge")
    return u, f[top].sum()


mesh = MeshQuad.init_tensor(np.linspace(0, 50, 13), np.linspace(0, 100, 25))
mesh, element = mesh.with_defaults(), ElementVector(ElementQuad1())
K_hg = hourglass.assemble(Basis(mesh, ElementVector(Fluctuation()), intorder=2))
basis = Basis(mesh, element, quadrature=(np.full((2, 1), 0.5), np.ones(1)))
u, load = pulled(basis, K_hg)
_, locked = pulled(Basis(mesh, element, intorder=2), 0 * K_hg)
angle = np.degrees(shear(np.log(A + stretched(basis.interpolate(u)))))[:, 0]

if __name__ == "__main__":
    from skfem.visuals.matplotlib import plot, show

    print(f"load {load:.1f} N, with 2×2 points {locked:.1f} N")
    deformed = MeshQuad(mesh.p + u[basis.nodal_dofs], mesh.t)
    plot(deformed, angle, colorbar="shear angle (°)")
    show()
