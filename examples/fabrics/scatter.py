"""
Band of nine specimens
======================

A fabric of the catalogue has the laws of nine specimens. The load of a bias extension
is computed with the law fitted to all of them, and with twenty further specimens drawn
from their scatter. The band of the fabric stands beside the error interval of the mesh.
"""

import numpy as np

from skfem_textile import plot
from skfem_textile.cases import case_from_tables
from skfem_textile.io import read_fabric
from skfem_textile.scenes import run_samples

# %%
# The file of the fabric states its sources, and the tension, which was not measured.

cloth = read_fabric("cao2008-plain-weave")
print(cloth.origin.sources["shear"])
print(cloth.origin.assumed["tension"])
plot.fabric_laws(cloth.fabric, cloth.origin, "laws.png")

# %%
# A run with the fitted law, and its error interval.

case = case_from_tables(
    {
        "scene": {"name": "bias_extension"},
        "fabric": {"file": "cao2008-plain-weave"},
        "mesh": {"density": 0.5},
        "stepping": {"steps": 5},
    }
)
result = case.run()
displacement, force = case.scene.driven_curve(result)
half = [0.0, *(result.interval(x).load for x in result.states[1:])] * force

# %%
# The same case with the laws of further specimens. An executor distributes the samples
# to processes or to a cluster.

samples = run_samples(case, cloth.samples(20))
factors = np.array([state.load_factor for state in result.states])
low, high = samples.force_band(factors)
plot.curves(
    {
        "Mesh": {"Run": (displacement, force, half)},
        "Fabric": {"Run": (displacement, force, low, high)},
    },
    "Displacement (mm)",
    "Force (N)",
    "bands.png",
    same_scales=True,
)
print(f"{force[-1]:.2f} N, interval of the mesh ± {half[-1]:.2f} N")
print(f"band of the fabric: {low[-1]:.2f} to {high[-1]:.2f} N")
assert half[-1] < high[-1] - force[-1]
