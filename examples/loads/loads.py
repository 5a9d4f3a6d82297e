"""
Forces, weight and time-dependent loads
=======================================

The reaction of the clamp balances the total load, to the accuracy of the solver. The
figures show the displacement and the weft tension.
"""

from math import pi, sin
from pathlib import Path

import numpy as np

from skfem_textile import (
    BodyForce,
    Condition,
    Fabric,
    Force,
    LoadStepper,
    OnePoint,
    Ply,
    Traction,
    plot,
)
from skfem_textile.io import read_mesh

WEIGHT = 5e-4  # N/mm²

mesh = read_mesh(Path(__file__).parents[1] / "meshes" / "strip.msh")
ply = Ply(mesh, Fabric(tension=1e4, shear=1.0), OnePoint())
conditions = {"clamp": Condition("bottom")}
area, length = ply.basis.dx.sum(), np.ptp(mesh.p[1])


def off(state, load):
    """Relative imbalance of the clamp reaction and a load."""
    return np.abs(state.reactions["clamp"] + load).max() / np.abs(load).max()


# %%
# A force of 10 N across and 40 N along the weft, distributed over the right side.

force = np.array([10.0, 40.0])
pulled = ply.with_terms(Force("right", force))
result = LoadStepper(pulled, conditions, steps=4).run()
print(f"force: relative imbalance {off(result.states[-1], force):.0e}")
assert off(result.states[-1], force) < 1e-9

# %%
# A constant weight, and a growing traction on the right side.

weight = BodyForce((0.0, -WEIGHT), factor=1.0)
hung = ply.with_terms(weight, Traction("right", (0.0, 0.5)))
states = LoadStepper(hung, conditions, steps=4).run().states
down = np.array([0.0, -WEIGHT * area])
print(f"weight: {-down[1]:.3f} N, balanced at load factor {states[0].load_factor}")
assert off(states[0], down) < 1e-9
assert off(states[-1], down + np.array([0.0, 0.5 * length])) < 1e-9

# %%
# A load proportional to sin²(πt/2).

wave = Traction("right", (0.0, 0.5), factor=lambda t: sin(pi * t / 2) ** 2)
states = LoadStepper(ply.with_terms(wave), conditions, steps=4).run().states
for state in states[1:]:
    load = np.array([0.0, 0.5 * length * sin(pi * state.load_factor / 2) ** 2])
    assert off(state, load) < 1e-9
print(f"traction: {len(states) - 1} steps along sin², each balanced")

# %%
# The ply under the force: the free right side moves; the weft tension is largest there.

plot.field(
    result, field="displacement", titles=["Displacement"], filename="displacement.png"
)

# %%

plot.field(
    result, field="weft_tension", titles=["Tension of the weft"], filename="weft.png"
)
