"""
Picture frame
=============

A hinged frame imposes a uniform shear angle on a square of fabric, for any mesh. The
force of the testing machine at two opposite corners follows from the shear moment.
Three shear laws have the same moment at 30° and differ beyond.
"""

import numpy as np

from skfem_textile import Fabric, LoadStepper, Locking, Ply, Polynomial, Sin2, plot
from skfem_textile.scenes import picture_frame

# %%
# A moment of 0.05 N·mm/mm² at 30°: a softening fabric, a stiffening one, and one that
# locks at 55°.

AT = np.radians(30.0)
laws = {
    "sin²": Sin2(0.05 / (np.sin(AT) * np.cos(AT))),
    "Polynomial": Polynomial((0.02 / AT, 0.0, 0.03 / AT**3), odd=True),
    "Locking": Locking(0.05 / AT * (1 - (30 / 55) ** 2), np.radians(55.0)),
}

# %%
# The mesh is distorted on purpose: fibres are not aligned with the elements.

scene = picture_frame(size=(6, 6), shear_angle=np.radians(50.0))
side, curves, results = 40.0, {}, {}
for name, law in laws.items():
    ply = Ply(scene.mesh, Fabric(1e4, law, scene.warp, scene.weft))
    results[name] = LoadStepper(ply, scene.conditions, steps=10).run()
    angles = [50.0 * state.load_factor for state in results[name].states]
    moments = [law.value(np.radians(angle)) for angle in angles]
    gamma = np.degrees(ply.shear_angle(results[name].u))
    print(f"{name:10} shear angles from {gamma.min():.4f}° to {gamma.max():.4f}°")
    assert np.allclose(gamma, 50.0, atol=0.01)
    forces = [
        side * moment / np.sin(np.pi / 4 - np.radians(angle) / 2)
        for angle, moment in zip(angles, moments, strict=True)
    ]
    curves[name] = angles, forces

plot.curves({"": curves}, "Shear angle (°)", "Pull at the corner (N)", "pull.png")

# %%
# The shape is the same for all laws.

plot.fibre_directions(
    results["Locking"], titles=["Fibres at 50°"], filename="fibres.png"
)
