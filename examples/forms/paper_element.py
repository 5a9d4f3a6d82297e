"""
The element of Hamila & Boisse with asm
=======================================

One integration point per quadrilateral, and stabilisation of the non-constant part of
the shear angle (Hamila & Boisse 2013): three forms, added up in a Newton loop. In a
bias-extension test the middle of the strip shears by the angle of inextensible fibres.
"""

import numpy as np
from skfem import Functional, MeshQuad, asm, condense, solve
from skfem.helpers import grad
from skfem.visuals.matplotlib import plot, savefig

import skfem_textile as textile
from skfem_textile.fabric import kinematics as kin

W, H, PULLED = 50.0, 100.0, 15.0  # mm
mesh = MeshQuad.init_tensor(np.linspace(0, W, 13), np.linspace(0, H, 25))
fabric = textile.Fabric(tension=1e4, shear=0.5, warp=(1, 1), weft=(-1, 1))  # N/mm
centre = textile.quad_basis(mesh.with_defaults(), textile.CENTRE)
terms = [
    (textile.tension(fabric), centre),
    (textile.shear(fabric), centre),
    (textile.hourglass(fabric, C_s=5.0), textile.HourglassBasis(mesh)),
]


def total(part, u):
    return sum(asm(getattr(forms, part), basis, u=u) for forms, basis in terms)


top, fixed = centre.get_dofs("top"), centre.get_dofs({"top", "bottom"}).all()
u, goal = centre.zeros(), centre.zeros()
for pulled in np.linspace(0, PULLED, 16)[1:]:
    goal[top.nodal["u^2"]] = pulled
    for _ in range(6):
        K, f = total("tangent", u), total("residual", u)
        u += solve(*condense(K, -f, x=goal - u, D=fixed))


@Functional
def shear_angle(w):
    F = kin.deformation_gradient(grad(w["u"]))
    return kin.shear_angle(F, *fabric.directions(w.x))


angle = np.degrees(shear_angle.elemental(centre, u=u) / centre.dx[:, 0])
exact = 90 - 2 * np.degrees(np.arccos((1 + PULLED / (H - W)) / np.sqrt(2)))
middle = np.median(angle[np.abs(mesh.p[1, mesh.t].mean(axis=0) - H / 2) < W / 8])
print(f"shear angle {middle:.2f}°, with inextensible fibres {exact:.2f}°")
assert abs(middle - exact) < 0.5
deformed = MeshQuad(mesh.p + u.reshape(-1, 2).T, mesh.t)
look = {"figsize": (3.5, 4), "cmap": "cividis"}
plot(deformed, angle, colorbar="Shear angle (°)", **look)
savefig("shear_angle.png", dpi=200)
