"""
Fibres with crimp
=================

Woven fibres are crimped: they are compliant until straight, and carry no compression.
Two fabrics with the same final stiffness are stretched along the warp and in a
bias-extension test. Crimp reduces the force along the warp. In bias extension fibres
hardly stretch, and the load is nearly the same.
"""

import matplotlib.pyplot as plt
import numpy as np
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    CrimpToe,
    Fabric,
    LoadStepper,
    Ply,
    TensionOnly,
    plot,
)
from skfem_textile.scenes import bias_extension

# %%
# The initial stiffness is 10 N/mm; beyond a toe of 0.4 % strain it is 5·10⁴ N/mm.

crimped = TensionOnly(CrimpToe(5e4, toe=0.004, initial_stiffness=10.0))
fibres = {"Straight": 5e4, "Crimped": crimped}

plt.rcParams["font.size"] = 8
figure, axes = plt.subplots(figsize=(3.35, 2.2), layout="constrained")
strain = np.linspace(-0.005, 0.015, 201)
axes.plot(100 * strain, crimped.value(strain))
axes.set(xlabel="Fibre strain (%)", ylabel="Tension (N/mm)")
axes.grid(alpha=0.3)
figure.savefig("law.png", dpi=300)

# %%
# A 10 mm square is stretched along the warp by 1 %. The weft is stretched by 0.1 %:
# without tension it would have no stiffness in compression.

mesh = MeshQuad().scaled(10.0).refined(1).with_defaults()
pull = {
    "held": Condition("left", 0.0, direction=(1, 0)),
    "pulled": Condition("right", 0.1, direction=(1, 0)),
    "level": Condition("bottom", 0.0, direction=(0, 1)),
    "stretched": Condition("top", 0.01, direction=(0, 1)),
}
along = {}
for name, law in fibres.items():
    states = LoadStepper(Ply(mesh, Fabric(law, 0.2)), pull, steps=10).run().states
    strain = [state.load_factor for state in states]
    along[name] = strain, [state.reactions["pulled"][0] for state in states]
exact = 10.0 * crimped.value(np.log([1.01]))[0] / 1.01  # W T/λ
print(f"force at 1 %: {along['Crimped'][1][-1]:.1f} N, exact value: {exact:.1f} N")
assert abs(along["Crimped"][1][-1] / exact - 1) < 1e-6

plot.curves({"": along}, "Strain (%)", "Force along the warp (N)", "along.png")

# %%
# A bias-extension test up to a shear angle of 30°.

scene = bias_extension(size=(6, 12), shear_angle=np.radians(30.0))
loads = []
for name, law in fibres.items():
    ply = Ply(scene.mesh, Fabric(law, 0.2, scene.warp, scene.weft))
    state = LoadStepper(ply, scene.conditions, steps=5).run().states[-1]
    loads.append(state.reactions["top"][1])
    print(f"{name:9} {loads[-1]:6.2f} N")
assert abs(loads[1] / loads[0] - 1) < 0.03
