"""
Isotropic sheet glued to a fabric
=================================

A user-defined term on the same nodes represents a thin film glued to the fabric. Under
tension along the warp between rollers, the strain is uniform, and the sheet adds its
plane-strain force. Under tension at 45° to the fibres, the fabric shears. The fibres
determine the shape with and without the film, and the film increases the load.
"""

import numpy as np
from skfem import BilinearForm, CellBasis, Functional, LinearForm, MeshQuad
from skfem.helpers import ddot, eye, grad, mul, sym_grad, trace, transpose

from skfem_textile import (
    Condition,
    Fabric,
    Forms,
    FormTerm,
    Full,
    LoadStepper,
    Ply,
    plot,
)
from skfem_textile.scenes import bias_extension

YOUNG, POISSON = 200.0, 0.3  # N/mm
E, PULLED = 1e4, 1e-4  # N/mm, mm

# %%
# The Saint Venant–Kirchhoff energy in plane stress, and its two derivatives.


def sheet(young, poisson):
    """Saint Venant–Kirchhoff energy of a thin sheet in plane stress."""
    mu = young / (2 * (1 + poisson))
    lam = young * poisson / (1 - poisson**2)

    def strain(w):
        G = grad(w["u"])
        return 0.5 * (G + transpose(G) + mul(transpose(G), G))

    def stress(e):
        return lam * eye(trace(e), 2) + 2 * mu * e

    def variation(w, v):
        G, H = grad(w["u"]), grad(v)
        return sym_grad(v) + 0.5 * (mul(transpose(G), H) + mul(transpose(H), G))

    return Forms(
        Functional(lambda w: 0.5 * ddot(stress(strain(w)), strain(w))),
        LinearForm(lambda v, w: ddot(stress(strain(w)), variation(w, v))),
        BilinearForm(
            lambda u, v, w: (
                ddot(stress(variation(w, u)), variation(w, v))
                + ddot(stress(strain(w)), mul(transpose(grad(u)), grad(v)))
            )
        ),
    )


# %%
# A square under tension along the warp, compared with the closed form.

mesh = MeshQuad().refined(2).with_defaults()
ply = Ply(mesh, Fabric(E, 0.1), Full())
ply = ply.with_terms(FormTerm("sheet", sheet(YOUNG, POISSON), ply.basis))
conditions = {
    "held": Condition("left", 0.0, direction=(1, 0)),
    "pulled": Condition("right", PULLED, direction=(1, 0)),
    "below": Condition("bottom", 0.0, direction=(0, 1)),
    "above": Condition("top", 0.0, direction=(0, 1)),
}
state = LoadStepper(ply, conditions, steps=1).run().states[-1]
exact = (E + YOUNG / (1 - POISSON**2)) * PULLED
force = state.reactions["pulled"][0]
print(f"force {force:.6f} N, exact {exact:.6f} N; {state.energies}")
assert abs(force / exact - 1) < 1e-3
assert np.isclose(state.energies["sheet"], 0.5 * YOUNG / 0.91 * PULLED**2, 1e-3)

# %%
# A bias-extension test of the fabric without a film, and with films of two stiffnesses.
# The forms are fully integrated, on a basis of the ply's mesh.

scene = bias_extension(size=(6, 12), shear_angle=np.radians(30.0))
fabric = Ply(scene.mesh, Fabric(1e5, 0.5, scene.warp, scene.weft))
cells = CellBasis(fabric.mesh, fabric.basis.elem)
curves = {}
for young in (0.0, 0.5, 2.0):
    term = FormTerm("sheet", sheet(young, POISSON), cells)
    ply = fabric.with_terms(term) if young else fabric
    states = LoadStepper(ply, scene.conditions, steps=6).run().states
    elongation = [state.displacements["top"][1] for state in states]
    load = [state.reactions["top"][1] for state in states]
    curves[f"Film of {young:g} N/mm" if young else "No film"] = elongation, load
plot.curves({"": curves}, "Elongation (mm)", "Load (N)", filename="load.png")
