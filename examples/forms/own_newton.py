"""
Forms in a plain scikit-fem script
==================================

A bias-extension test with scikit-fem, the forms of this library and a custom Newton
loop. The strip of fabric is twice as long as wide, with fibres at ±45° and a distorted
mesh. It is clamped at the bottom and pulled at the top. The load agrees with the closed
form for inextensible fibres.
"""

import matplotlib.pyplot as plt
import numpy as np
from skfem import MeshQuad, asm, condense, solve

from skfem_textile import (
    CENTRE,
    Fabric,
    HourglassBasis,
    hourglass,
    quad_basis,
    shear,
    tension,
)

W, H = 50.0, 100.0  # mm
E, G = 1e4, 0.5  # N/mm

# %%
# The interior nodes of a regular mesh are moved by up to a quarter of their distance.

regular = MeshQuad.init_tensor(np.linspace(0, W, 13), np.linspace(0, H, 25))
p, inside = regular.p.copy(), regular.interior_nodes()
p[:, inside] += np.random.default_rng(1).uniform(-1, 1, (2, inside.size))
mesh = MeshQuad(p, regular.t).with_defaults()

# %%
# Each form has an energy, a residual and a tangent. Tension and shear are integrated at
# one point per element; the hourglass form stabilises the remaining modes.

fabric = Fabric(tension=E, shear=G, warp=(1, 1), weft=(-1, 1))
centre = quad_basis(mesh, CENTRE)
terms = [
    (tension(fabric), centre),
    (shear(fabric), centre),
    (hourglass(fabric, C_s=10 * G), HourglassBasis(mesh)),
]
top, bottom = centre.get_dofs("top"), centre.get_dofs("bottom")
pulled, fixed = top.nodal["u^2"], np.union1d(top, bottom)
free = centre.complement_dofs(fixed)


def total(part, u):
    """Sum of one part, residual or tangent, over the terms."""
    return sum(asm(getattr(forms, part), basis, u=u) for forms, basis in terms)


def pull(u, elongation):
    """Newton's method from ``u`` to the equilibrium at the given elongation."""
    for _ in range(20):
        f, du = total("residual", u), centre.zeros()
        du[pulled] = elongation - u[pulled]
        if not du.any() and np.abs(f[free]).max() < 1e-8 * np.abs(f).max():
            return u
        u = u + solve(*condense(total("tangent", u), -f, x=du, D=fixed))
    raise RuntimeError("Newton's method did not converge")


# %%
# The shear angle at the centre of the strip increases by 1° per step.


def elongation_at(gamma):
    """Elongation in mm for a shear angle gamma at the centre of the strip."""
    return (H - W) * (np.sqrt(2) * np.cos(np.pi / 4 - gamma / 2) - 1)


def exact_load(gamma):
    """Load in N of a strip with inextensible fibres."""
    power = W * (2 * H - 3 * W) * G * gamma + W**2 * G * gamma / 2
    return power / ((H - W) * (np.cos(gamma / 2) - np.sin(gamma / 2)))


u, loads = centre.zeros(), []
angles = np.radians(np.arange(1, 26))
for gamma in angles:
    u = pull(u, elongation_at(gamma))
    loads.append(total("residual", u)[pulled].sum())

exact = exact_load(angles)
print(f"load {loads[-1]:.3f} N, exact {exact[-1]:.3f} N")
assert abs(loads[-1] / exact[-1] - 1) < 0.05

# %%
# The load is close to the closed form, on a mesh not aligned with the fibres.

elongation = elongation_at(angles)
plt.rcParams["font.size"] = 8
figure, axes = plt.subplots(figsize=(3.35, 2.4), layout="constrained")
axes.plot(elongation, exact, label="Closed form")
axes.plot(elongation, loads, "o", markersize=3, label="One point per element")
axes.set(xlabel="Elongation (mm)", ylabel="Load (N)", xlim=0, ylim=0)
axes.legend(frameon=False)
figure.savefig("load.png", dpi=300)
