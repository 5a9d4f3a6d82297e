"""
A load with its interval
========================

A bias extension on meshes along the singular fibres. Every summary contains an interval
of the discretisation error of the load. It becomes narrower on denser meshes, and a
`ToleranceStepper` makes the mesh as dense as a tolerance requires.
"""

import numpy as np

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    Outline,
    Ply,
    Quadratic,
    ToleranceStepper,
    mesh_outline,
)
from skfem_textile.plot.curves import curves

# %%
# A ply of 50 mm × 120 mm with fibres at 45° to its edges, on a mesh of any density.

outline = Outline([[0, 50, 50, 0], [0, 0, 120, 120]])
fabric = Fabric(7e3, 0.1, warp=(1, 1), weft=(-1, 1))  # N/mm
conditions = {"clamp": Condition("bottom"), "pull": Condition("top", (0.0, 20.0))}


def stepper_at(density):
    """Load stepper on a mesh of the outline."""
    mesh = mesh_outline(outline, fabric, conditions, density=density)
    ply = Ply(mesh, fabric, Quadratic(400, points=6))
    return LoadStepper(ply, conditions, steps=4)


# %%
# The load with half the width of its interval, at some densities.

densities = np.array([0.5, 0.7, 1.0, 1.4, 2.0, 2.8])
loads, half_widths = [], []
for density in densities:
    result = stepper_at(density).run()
    loads.append(result.states[-1].reactions["pull"][1])
    half_widths.append(result.error.load * loads[-1])
    print(
        f"density {density}: {result.ply.basis.N:6} unknowns, "
        f"{loads[-1]:.3f} ± {half_widths[-1]:.3f} N"
    )

# %%
# The same to a tolerance of 0.1 %; each round is one mesh.

precise = ToleranceStepper(stepper_at, tolerance=0.001, density=0.5).run()
for one in precise.rounds:
    print(one)
load = precise.states[-1].reactions["pull"][1]
assert precise.tolerance_met
within = np.abs(np.array(loads) - load) <= half_widths
assert within[1:].all()

# %%
# The band is the interval. The load to the tolerance lies in it at every density but
# the smallest.

band = densities, np.array(loads), np.array(half_widths)
line = densities, np.full(len(densities), load)
curves(
    {"": {"one mesh": band, "run to 0.1 %": line}},
    "Density",
    "Load (N)",
    "interval.png",
)
