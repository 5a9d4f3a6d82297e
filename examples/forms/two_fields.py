"""
Shear stiffness that depends on temperature
===========================================

A bias-extension test of a strip with a hot top, in a composite element of displacement
and temperature. Tension and hourglass stabilisation are forms of the library; shear and
conduction are written here. By symmetry the load is that at the mean temperature.
"""

import numpy as np
import skfem
from skfem.helpers import ddot, dot, grad
from skfem.visuals.matplotlib import plot, savefig

from skfem_textile import CENTRE, Fabric, Forms, HourglassBasis, hourglass, tension
from skfem_textile.fabric import kinematics as kin
from skfem_textile.forms.form import contract, outer

W, H, PULLED = 50.0, 100.0, 8.0  # mm
COLD, SLOPE = 0.8, -0.6  # shear stiffness G(θ) = COLD + SLOPE θ in N/mm, 0 ≤ θ ≤ 1
mesh = skfem.MeshQuad.init_tensor(np.linspace(0, W, 13), np.linspace(0, H, 25))
element = skfem.ElementVector(skfem.ElementQuad1()) * skfem.ElementQuad1()
basis = skfem.CellBasis(mesh.with_defaults(), element, quadrature=CENTRE)
fabric = Fabric(1e4, warp=(1, 1), weft=(-1, 1))

# %%
# The shear energy ½ G(θ) Γ², and its derivatives. ``w["u"]`` has both fields.


def shear(w):
    """Shear stiffness G, shear angle Γ, and its first and second derivative."""
    (u, theta), A = w["u"], fabric.directions(w.x)
    F, G = kin.deformation_gradient(grad(u)), COLD + SLOPE * theta
    angle, d = kin.shear_angle(F, *A), kin.shear_angle_d(F, *A)
    return G, angle, d, kin.shear_angle_dd(F, *A)


def residual(v, q, w):
    G, angle, d, _ = shear(w)
    return G * angle * ddot(d, grad(v)) + dot(grad(w["u"][1]), grad(q))


def tangent(u, p, v, q, w):
    G, angle, d, dd = shear(w)
    of_u = contract(grad(v), G * (outer(d, d) + angle * dd), grad(u))
    return of_u + SLOPE * angle * p * ddot(d, grad(v)) + dot(grad(p), grad(q))


energy = skfem.Functional(lambda w: 0.5 * shear(w)[0] * shear(w)[1] ** 2)
own = Forms(energy, skfem.LinearForm(residual), skfem.BilinearForm(tangent))
corners = HourglassBasis(basis.mesh, element)
terms = (tension(fabric), basis), (own, basis), (hourglass(fabric, 4.0), corners)


def total(part, x):
    return sum(skfem.asm(getattr(forms, part), on, u=x) for forms, on in terms)


# %%
# The tangent of both fields is the derivative of the residual. Newton's method:

x, dx = 0.1 * np.random.default_rng(1).standard_normal((2, basis.N))
change = (total("residual", x + 1e-5 * dx) - total("residual", x - 1e-5 * dx)) / 2e-5
assert np.abs(change - total("tangent", x) @ dx).max() < 1e-6 * np.abs(change).max()

top, fixed = basis.get_dofs("top").nodal, basis.get_dofs({"top", "bottom"}).all()
x, goal = basis.zeros(), basis.zeros()
for pulled in np.linspace(0, PULLED, 6)[1:]:
    goal[top["u^2^1"]], goal[top["u^2"]] = pulled, 1.0
    for _ in range(6):
        K, f = total("tangent", x), total("residual", x)
        x += skfem.solve(*skfem.condense(K, -f, x=goal - x, D=fixed))
load = total("residual", x)[top["u^2^1"]].sum()
half = np.pi / 4 - np.arccos((1 + PULLED / (H - W)) / np.sqrt(2))  # of the shear angle
exact = 3 * W * (COLD + SLOPE / 2) * half / (np.cos(half) - np.sin(half))
print(f"load {load:.3f} N, at the mean temperature {exact:.3f} N")
assert abs(load / exact - 1) < 0.05
moment = skfem.Functional(lambda w: shear(w)[0] * shear(w)[1]).elemental(basis, u=x)
values = moment / basis.dx[:, 0]
plot(mesh, values, figsize=(3.5, 4), cmap="viridis", colorbar="Moment (N/mm)")
savefig("moment.png", dpi=200)
