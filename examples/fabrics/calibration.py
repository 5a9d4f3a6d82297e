"""
From test curves to a fabric
============================

A shear law with confidence intervals is fitted to three bias-extension tests and
written to a fabric file. A simulation with this fabric reproduces the load. The curves
are synthetic here, from a known law with noise; replace them with measured ones.
"""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from skfem_textile import Fabric, LoadStepper, Ply, Polynomial
from skfem_textile.calibration import BiasExtension, fit_tests, read_specimens
from skfem_textile.calibration.figure import draw
from skfem_textile.io import read_fabric, write_fabric
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.bias_extension import WIDTH

KNOWN = Polynomial((0.3, 0.0, -0.3, 0.0, 0.6))
TEST = BiasExtension(width=WIDTH, height=2 * WIDTH)

# %%
# Three test files.

folder = Path(mkdtemp())
gamma = np.radians(np.linspace(1.0, 40.0, 60))
force, rng = TEST.force(KNOWN, gamma), np.random.default_rng(1)
names = [folder / name for name in ("one.csv", "two.csv", "three.csv")]
for name in names:
    noisy = force + 0.02 * force.max() * rng.standard_normal(force.size)
    columns = np.transpose([TEST.displacement(gamma), noisy])
    header = "displacement (mm),force (N)"
    np.savetxt(name, columns, delimiter=",", header=header, comments="")

# %%
# The fitted law with 95 % confidence intervals.

calibration = fit_tests([one for name in names for one in read_specimens(name, TEST)])
fit = calibration.parts["shear"]
for name, value, (low, high) in zip(
    fit.model.parameters, fit.values, fit.intervals, strict=True
):
    print(f"{name} = {value:.3f} N/mm, 95 %: {low:.3f} to {high:.3f}")
draw(calibration, "fit.png")

# %%
# The fabric file, and a simulation with it.

scene = bias_extension(size=(6, 12), shear_angle=np.radians(30.0))
write_fabric(folder / "fabric.json", Fabric(1e6, fit.law, scene.warp, scene.weft))
ply = Ply(scene.mesh, read_fabric(folder / "fabric.json").fabric)
result = LoadStepper(ply, scene.conditions, steps=6).run()
simulated = scene.reaction(result.states[-1])[1]
known = TEST.force(KNOWN, np.radians(30.0))
print(f"load at 30°: {simulated:.2f} N, known law: {known:.2f} N")
assert abs(simulated / known - 1) < 0.03
