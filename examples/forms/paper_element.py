"""
The element of Hamila & Boisse with asm
=======================================

One integration point per quadrilateral, and stabilisation of the non-constant part of
the shear angle (Hamila & Boisse 2013): three forms, added up in a Newton loop. In a
bias-extension test the middle of the strip shears by the angle of inextensible fibres.
"""

import numpy as np
from skfem import MeshQuad, asm, condense, solve

import skfem_textile as textile
from skfem_textile import plot

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


angle = np.degrees(textile.fibre_fields(centre, u, fabric, at="elements").shear_angle)
exact = 90 - 2 * np.degrees(np.arccos((1 + PULLED / (H - W)) / np.sqrt(2)))
middle = np.median(angle[np.abs(mesh.p[1, mesh.t].mean(axis=0) - H / 2) < W / 8])
print(f"shear angle {middle:.2f}°, with inextensible fibres {exact:.2f}°")
assert abs(middle - exact) < 0.5
plot.shear_angle(centre, u, fabric, filename="shear_angle.png")
