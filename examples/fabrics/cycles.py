"""
Loops of loading and unloading
==============================

A fabric whose unloading differs from its loading: its law is identified from the cycles
of a picture frame, and predicts a bias extension, and the shear angle that remains when
a ply is let go.
"""

import numpy as np
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    Ply,
    Polynomial,
    WithFriction,
    plot,
)
from skfem_textile.calibration import Choice, PictureFrame, Specimen, fit_tests
from skfem_textile.fabric import along
from skfem_textile.scenes import bias_extension

# %%
# Three cycles of a picture frame, here computed with a known law and a noise of 0.5 %.
# Friction elements slip at 0.01 N/mm from 1.5° and at 0.02 N/mm from 7° on.

known = WithFriction(Polynomial((0.1, 0.0, 0.6)), [0.01, 0.02], np.radians([1.5, 7.0]))
frame = PictureFrame(frame=200.0, fabric=160.0)
levels = [0.0, 0.25, 0.0, 0.45, 0.0, 0.7, 0.0]  # rad
gamma = np.interp(np.linspace(0, 6, 361), range(7), levels)
force = frame.arms(gamma)[0][1] * along(known, gamma)[0]
force += 0.005 * force.max() * np.random.default_rng(0).normal(size=gamma.size)
moved = frame.displacement(gamma)
test = Specimen("cycles", frame, force, displacement=moved, cyclic=True)
law = fit_tests([test], Choice("polynomial", degree=3)).laws["shear"]
for limit, onset in zip(law.limits, np.degrees(law.onsets), strict=True):
    print(f"friction of {limit:.4f} N/mm from {onset:.1f} degrees on")
predicted = frame.arms(gamma)[0][1] * along(law, gamma)[0]
curves = {"measured": (moved, force), "law": (moved, predicted)}
plot.curves({"": curves}, "Displacement (mm)", "Force (N)", "frame.png")

# %%
# A bias extension that is unloaded to half of its displacement, and loaded again.

scene = bias_extension(size=(4, 8), part="half").through([1.0, 0.5, 1.0])
curves = {}
for name, shear in {"elastic law": law.law, "with friction": law}.items():
    ply = Ply(scene.mesh, Fabric(1e4, shear, scene.warp, scene.weft))
    result = LoadStepper(ply, scene.conditions, steps=45).run()
    curves[name] = scene.driven_curve(result)
    print(name, {k: round(x, 1) for k, x in result.states[-1].energy_lost.items()})
plot.curves({"": curves}, "Displacement (mm)", "Force (N)", "bias_extension.png")

# %%
# A square is sheared by 40° along its edges, which are then let go. Two nodes hold it.


def sheared(X, t):
    angle = min(2 * t, 1.0) * np.radians(40.0)
    return np.stack([X[1] * np.sin(angle), X[1] * (np.cos(angle) - 1)])


mesh = MeshQuad().refined(3).scaled((100.0, 100.0))
conditions = {
    "edges": Condition(mesh.boundary_nodes(), sheared, until=0.5),
    "corner": Condition(lambda x: (x[0] == 0) & (x[1] == 0)),
    "side": Condition(lambda x: (x[0] == 100) & (x[1] == 0), direction=(0, 1)),
}
curves = {}
for name, shear in {"elastic law": law.law, "with friction": law}.items():
    free = LoadStepper(Ply(mesh, Fabric(1e4, shear)), conditions, steps=(10, 1)).run()
    angles = [abs(np.degrees(free.ply.shear_angle(s.u).mean())) for s in free.states]
    print(f"{name}: {angles[10]:.1f} degrees, let go {angles[-1]:.1f} degrees")
    curves[name] = [state.load_factor for state in free.states], angles
    if shear is law.law:
        assert np.abs(free.u).max() < 1e-4
plot.curves({"": curves}, "Load factor", "Shear angle (degrees)", "let_go.png")
