"""
Ply in a custom Newton loop
===========================

A ``Ply`` sums its terms and provides energy, residual and tangent for any solver. Here
a strip is loaded off-axis, with fibres at −35° and 55° to the load. No fibre runs from
clamp to clamp, so shear is largest in the centre of the strip. The triangles at the
clamps hardly shear.
"""

import numpy as np
from skfem import MeshQuad, condense, solve

from skfem_textile import Fabric, Ply, plot

LENGTH, WIDTH, PULLED, STEPS = 150.0, 50.0, 14.0, 35  # mm

mesh = MeshQuad.init_tensor(np.linspace(0, LENGTH, 25), np.linspace(0, WIDTH, 9))
warp, weft = ((np.cos(a), np.sin(a)) for a in np.radians([-35.0, 55.0]))
ply = Ply(mesh.with_defaults(), Fabric(5e4, 0.5, warp, weft))

# %%
# ``ply.basis`` is a scikit-fem basis. The ply splits each element of the mesh in four
# and keeps the boundary names.

left, right = ply.basis.get_dofs("left"), ply.basis.get_dofs("right")
pulled, fixed = right.nodal["u^1"], np.union1d(left, right)
free = ply.basis.complement_dofs(fixed)


def equilibrium(u, elongation, parameters):
    """Newton's method from ``u``: displacement and forces at the given elongation."""
    for _ in range(20):
        f, du = ply.residual(u, 1.0, parameters), ply.basis.zeros()
        du[pulled] = elongation - u[pulled]
        if not du.any() and np.abs(f[free]).max() < 1e-8 * np.abs(f).max():
            return u, f
        K = ply.tangent(u, 1.0, parameters)
        u = u + solve(*condense(K, -f, x=du, D=fixed))
    raise RuntimeError("Newton's method did not converge")


# %%
# The default formulation has stiffnesses as parameters, held fixed during a step.
# ``updated`` evaluates them at the end of each step; ``advanced`` does so for
# parameters that depend on the step, which terms may add.

u, parameters = ply.basis.zeros(), ply.parameters_at_rest
for step in range(1, STEPS + 1):
    elongation = PULLED * step / STEPS
    u, f = equilibrium(u, elongation, parameters)
    if step % 5 == 0:
        load, energy = f[pulled].sum(), ply.energy(u, 1.0, parameters)
        print(f"{elongation:5.1f} mm: {load:6.2f} N, energy {energy:6.2f} N·mm")
    parameters = ply.advanced(ply.updated(parameters, u), u)
strain = np.abs(ply.law_strain(u)).max()
print(f"largest fibre strain {100 * strain:.2f} %")
assert strain < 0.01

# %%
# A ``LoadStepper`` also checks each state, and reduces a step that fails. Plots take
# its result, or basis, displacement and fabric.

plot.shear_angle(ply.basis, u, ply.fabric, filename="shear_angle.png")
