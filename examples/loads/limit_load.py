"""
Limit load
==========

A dead force shears a square of fabric with fibres along its sides L and the shear law
w = G sin²Γ/2. The limit load along (1, −1)/√2 is F = G L/2, at 45°. Beyond this limit
point there is no equilibrium nearby: the load stepper raises an error that contains the
last state.
"""

import matplotlib.pyplot as plt
import numpy as np
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Force,
    Full,
    LoadStepper,
    Ply,
    Sin2,
    StepError,
)

L, G, E = 10.0, 0.5, 1e5  # mm, N/mm, N/mm
LIMIT = G * L / 2
mesh = MeshQuad().refined(2).scaled(L).with_defaults()
down = np.array([1.0, -1.0]) / np.sqrt(2)


def stopped(applied, steps):
    """The error of a run with a load given as a multiple of the limit."""
    load = Force("top", applied * LIMIT * down)
    ply = Ply(mesh, Fabric(E, Sin2(G)), Full(), [load])
    try:
        LoadStepper(ply, {"clamp": Condition("bottom")}, steps=steps).run()
    except StepError as error:
        return error
    raise AssertionError("the load exceeded its limit")


# %%
# The computed limit is accurate to half a percent, for any step length.

for applied in (1.5, 20.0):
    error = stopped(applied, steps=10)
    print(error)
    last = error.result.states[-1]
    angle = np.degrees(np.abs(error.result.ply.shear_angle(last.u)).max())
    found = last.load_factor * applied
    print(f"largest stable load: {found:.4f} times the limit load, at {angle:.1f}°")
    assert abs(found - 1) < 0.005
    assert last.verdict.stable

# %%
# Force against shear angle, up to the limit.

error = stopped(1.5, steps=30)
result = error.result
angles = [
    np.degrees(np.abs(result.ply.shear_angle(state.u)).mean())
    for state in result.states
]
forces = [1.5 * LIMIT * state.load_factor for state in result.states]
angle = np.radians(np.linspace(0.0, 70.0, 141))
exact = np.sqrt(2) * G * L * np.sin(angle) * np.cos(angle)
exact /= np.sin(angle) + np.cos(angle)

plt.rcParams["font.size"] = 8
figure, axes = plt.subplots(figsize=(3.35, 2.4), layout="constrained")
axes.plot(np.degrees(angle), exact, label="Equilibria in closed form")
axes.plot(angles, forces, "o", markersize=3, label="Load steps")
axes.set(xlabel="Shear angle (°)", ylabel="Force (N)", xlim=0, ylim=0)
axes.legend(frameon=False, loc="lower right")
figure.savefig("limit.png", dpi=300)
