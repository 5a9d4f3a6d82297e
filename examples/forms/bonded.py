"""
Fabric bonded to a part of an elastic sheet
===========================================

A band of fabric reinforces the middle of a sheet under tension between rollers. The
sheet is scikit-fem's own linear elasticity, on the whole mesh; the fabric covers one
subdomain. One load stepper solves for both. The force agrees with springs in series.
"""

import matplotlib.pyplot as plt
import numpy as np
from skfem import CellBasis, Functional, LinearForm, MeshQuad
from skfem.models.elasticity import lame_parameters, linear_elasticity

from skfem_textile import Condition, Fabric, Forms, FormTerm, LoadStepper, Ply

LENGTH, WIDTH, BAND, PULLED = 90.0, 30.0, 30.0, 0.09  # mm
E, YOUNG, POISSON = 400.0, 200.0, 0.3  # N/mm, N/mm, -

# %%
# The elements of the band have a fabric, and all others one without stiffness.

mesh = MeshQuad.init_tensor(np.linspace(0, LENGTH, 19), np.linspace(0, WIDTH, 7))
in_band = np.abs(mesh.p[0, mesh.t].mean(axis=0) - LENGTH / 2) < BAND / 2
parts = {"band": np.flatnonzero(in_band), "bare": np.flatnonzero(~in_band)}
mesh = mesh.with_defaults().with_subdomains(parts)
fabrics = {"band": Fabric(E, shear=1.0), "bare": Fabric(0.0)}
ply = Ply(mesh, fabrics)

# %%
# The energy of the sheet is ½ a(u, u), with the bilinear form a of scikit-fem.

a = linear_elasticity(*lame_parameters(YOUNG, POISSON))
sheet = Forms(
    Functional(lambda w: 0.5 * a.form(w["u"], w["u"], w)),
    LinearForm(lambda v, w: a.form(w["u"], v, w)),
    a,
)
cells = CellBasis(ply.mesh, ply.basis.elem)
bonded = ply.with_terms(FormTerm("sheet", sheet, cells))

# %%
# The tangent of both is the derivative of their forces.

u, du = 0.01 * np.random.default_rng(1).standard_normal((2, bonded.basis.N))
change = (bonded.residual(u + 1e-4 * du) - bonded.residual(u - 1e-4 * du)) / 2e-4
assert np.abs(change - bonded.tangent(u) @ du).max() < 1e-6 * np.abs(change).max()

# %%
# Sheet and band in series: the sheet has the stiffness D at zero strain across.

conditions = {
    "held": Condition("left", 0.0, direction=(1, 0)),
    "pulled": Condition("right", PULLED, direction=(1, 0)),
    "below": Condition("bottom", 0.0, direction=(0, 1)),
    "above": Condition("top", 0.0, direction=(0, 1)),
}
state = LoadStepper(bonded, conditions, steps=1).run().states[-1]
D = YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))
exact = PULLED * WIDTH / ((LENGTH - BAND) / D + BAND / (D + E))
force = state.reactions["pulled"][0]
print(f"force {force:.4f} N, exact {exact:.4f} N; energies {state.energies}")
assert abs(force / exact - 1) < 2e-3

x, y = bonded.nodes
bottom = np.flatnonzero(y == 0)
bottom = bottom[np.argsort(x[bottom])]
plt.rcParams["font.size"] = 8
figure, axes = plt.subplots(figsize=(3.35, 2.2), layout="constrained")
axes.axvspan((LENGTH - BAND) / 2, (LENGTH + BAND) / 2, color="0.9", label="Fabric")
axes.plot(x[bottom], 1e3 * bonded.nodal(state.u)[0, bottom], ".-")
axes.set(xlabel="Position (mm)", ylabel="Displacement (µm)", xlim=(0, LENGTH))
axes.legend(frameon=False)
figure.savefig("displacement.png", dpi=300)
