"""
From raw files to a load
========================

Files of testing machines, as they are exported, are read and fitted jointly: tensile
tests of warp and weft, and a picture frame. The band of the fitted parameters is then
the band of the load of a ply with its own mesh and conditions. The files are written
here from known laws with noise; replace them with yours.
"""

from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np

from skfem_textile import Condition, Fabric, Linear, LoadStepper, Locking, Ply
from skfem_textile.calibration import (
    Choice,
    PictureFrame,
    fit_tests,
    load_band,
    read_specimens,
    read_strips,
)
from skfem_textile.scenes.rectangle import rectangle

WARP, WEFT, SHEAR = Linear(2000.0), Linear(1500.0), Locking(0.08, np.radians(70.0))
FRAME = PictureFrame(frame=200.0, fabric=160.0)
folder, rng = Path(mkdtemp()), np.random.default_rng(1)

# %%
# Three files in the style of a machine: a preamble, semicolons, decimal commas, kN, and
# a clamp that moves before it pulls.


def export(name, moved, force, toe):
    """Write a file, with a noise of 2 % of the largest force."""
    force = force + 0.02 * force.max() * rng.standard_normal(force.size)
    before = np.arange(0.0, toe, 0.1)
    x, f = np.append(before, moved + toe), np.append(0.0 * before, force / 1e3)
    rows = [f"{a:.4f};{b:.6f}".replace(".", ",") for a, b in zip(x, f, strict=True)]
    head = ["Sample;one", "Operator;", "", "Extension;Load", "(mm);(kN)"]
    (folder / name).write_text("\r\n".join([*head, *rows]), encoding="cp1252")


pull = np.linspace(0.0, 4.0, 150)
for name, law in (("warp.txt", WARP), ("weft.txt", WEFT)):
    strain = np.log1p(pull / 200.0)
    export(name, pull, 50.0 * law.value(strain) / np.exp(strain), toe=0.5)
gamma = np.radians(np.linspace(0.0, 50.0, 150))
export("frame.txt", FRAME.displacement(gamma), FRAME.force(SHEAR, gamma), toe=2.0)

# %%
# The content as read, and the laws with 95 % intervals of their parameters.

tests = [
    *read_strips(folder / "warp.txt", "warp", width=50.0, length=200.0),
    *read_strips(folder / "weft.txt", "weft", width=50.0, length=200.0),
    *read_specimens(folder / "frame.txt", FRAME),
]
for test in tests:
    print(f"{test.name}: {'; '.join(test.statements)}")
fitted = fit_tests(tests, Choice(shear="locking", tension="linear"))
joint = fitted.fit.joint
for name, value, (low, high) in zip(
    joint.model.parameters, joint.values, joint.intervals, strict=True
):
    print(f"{name} = {value:.4g}, 95 %: {low:.4g} to {high:.4g}")

# %%
# A ply of 60 × 120 mm with fibres at 60° and 150°, clamped at both ends, one of which
# moves by 8 mm. `load_band` solves it for the fitted parameters and near them.

mesh = rectangle(60.0, 120.0, (10, 20), "irregular", 0.25, 1)
angle = np.radians(60.0)
base = Fabric(warp=(np.cos(angle), np.sin(angle)), weft=(-np.sin(angle), np.cos(angle)))
conditions = {
    "bottom": Condition("bottom", (0.0, 0.0)),
    "top": Condition("top", (0.0, 8.0)),
}


def loads(fabric):
    """Force of the moving end at each load step."""
    run = LoadStepper(Ply(mesh, fabric), conditions, steps=4).run()
    return np.array([state.forces["top"][1] for state in run.states[1:]])


band = load_band(fitted, base, loads)
truth = loads(Fabric((WARP, WEFT), SHEAR, base.warp, base.weft))
moved = np.linspace(2.0, 8.0, 4)
for x, force, half, known in zip(moved, band.force, band.pointwise, truth, strict=True):
    print(f"{x:.0f} mm: {force:.1f} N ± {half:.1f} N, known laws: {known:.1f} N")
wide = band.simultaneous * band.deviation
assert np.all(np.abs(truth - band.force) <= wide)

# %%
# The band of the load.

figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
axes.fill_between(moved, band.force - wide, band.force + wide, alpha=0.3, label="95 %")
axes.plot(moved, band.force, label="fitted laws")
axes.plot(moved, truth, "k.", label="known laws")
axes.set(xlabel="displacement (mm)", ylabel="force (N)")
axes.legend()
figure.savefig("load_band.png")
