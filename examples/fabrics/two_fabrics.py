"""
Two fabrics in one ply
======================

A patch of a stiffer fabric is sewn into a ply. First, both fabrics are loaded in series
along the warp: the force is the same, so the compliant one stretches more. Then the ply
is stretched at 45° to its fibres: the stiff patch shears less, and the fabric at its
corners shears more.
"""

import numpy as np
from skfem import MeshQuad

from skfem_textile import Condition, Fabric, LoadStepper, Macro, OnePoint, Ply, plot
from skfem_textile.scenes import bias_extension

# %%
# Assign a fabric to each subdomain of the mesh.

SOFT, STIFF, PULLED = 1e4, 4e4, 0.1  # N/mm, N/mm, mm

mesh = MeshQuad.init_tensor(np.linspace(0, 20, 9), np.linspace(0, 5, 3))
mesh = mesh.with_defaults().with_subdomains(
    {"soft": lambda x: x[0] < 10, "stiff": lambda x: x[0] > 10}
)
fabrics = {"soft": Fabric(SOFT, 0.1), "stiff": Fabric(STIFF, 0.1)}
conditions = {
    "held": Condition("left", 0.0, direction=(1, 0)),
    "pulled": Condition("right", PULLED, direction=(1, 0)),
    "level": Condition("bottom", 0.0, direction=(0, 1)),
}
for formulation in (OnePoint(), Macro()):
    ply = Ply(mesh, fabrics, formulation)
    result = LoadStepper(ply, conditions, steps=2).run()
    strain = ply.law_strain(result.u)[0]
    low, high = float(strain.min()), float(strain.max())
    force = result.states[-1].reactions["pulled"][0] / 5.0
    print(f"{ply.formulation.name:10} strains {low:.5f} and {high:.5f}")
    # The force per width is T/λ in both; each is 10 mm long.
    assert abs(STIFF * low / np.exp(low) / force - 1) < 1e-6
    assert abs(SOFT * high / np.exp(high) / force - 1) < 1e-6
    assert abs(10 * (np.exp(low) + np.exp(high)) - 20 - PULLED) < 1e-6

# %%
# A bias-extension test of a ply with a patch ten times as stiff in shear.

scene = bias_extension("irregular", (10, 20), jitter=0.0, shear_angle=np.radians(30.0))


def inside(x):
    """Return True for points in the patch."""
    return (abs(x[0] - 25.0) < 10.0) & (abs(x[1] - 50.0) < 10.0)


patched = scene.mesh.with_subdomains({"patch": inside, "ply": lambda x: ~inside(x)})
directions = scene.warp, scene.weft
plain, patch = Fabric(1e5, 0.3, *directions), Fabric(1e5, 3.0, *directions)
results = [
    LoadStepper(Ply(patched, fabrics), scene.conditions, steps=6).run()
    for fabrics in ({"ply": plain, "patch": plain}, {"ply": plain, "patch": patch})
]
for result in results:
    print(f"load {scene.reaction(result.states[-1])[1]:.2f} N")
plot.shear_angle(*results, titles=["One fabric", "With a patch"], filename="patch.png")
