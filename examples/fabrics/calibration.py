"""From curves of three specimens to a law, a fabric on file, and a simulation of it.

The curves are made here, of a known law with noise.  Yours come from a machine.
"""

import numpy as np

from skfem_textile import (
    Fabric,
    LoadStepper,
    Ply,
    Polynomial,
)
from skfem_textile.calibration import BiasExtension, fit_shear, read_specimen
from skfem_textile.io import read_fabric, write_fabric
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.bias_extension import WIDTH

KNOWN = Polynomial((0.3, 0.0, -0.3, 0.0, 0.6))
TEST = BiasExtension(width=WIDTH, height=2 * WIDTH)


def write_curves():
    """Three files of a machine."""
    gamma = np.radians(np.linspace(1.0, 40.0, 60))
    force, rng = TEST.force(KNOWN, gamma), np.random.default_rng(1)
    for name in ("one.csv", "two.csv", "three.csv"):
        noisy = force + 0.02 * force.max() * rng.standard_normal(force.size)
        columns = np.transpose([TEST.displacement(gamma), noisy])
        header = "displacement (mm),force (N)"
        np.savetxt(name, columns, delimiter=",", header=header, comments="")
        yield name


def main():
    specimens = [read_specimen(name, TEST) for name in write_curves()]
    fit = fit_shear(specimens).fit
    names = zip(fit.model.parameters, fit.values, fit.intervals, strict=True)
    for name, value, (low, high) in names:
        print(f"{name} = {value:.3f} N/mm, 95 %: {low:.3f} to {high:.3f}")

    scene = bias_extension(size=(6, 12), shear_angle=np.radians(30.0))
    write_fabric("fabric.json", Fabric(1e6, fit.law, scene.warp, scene.weft))
    ply = Ply(scene.mesh, read_fabric("fabric.json").fabric)
    result = LoadStepper(ply, scene.conditions, steps=6).run()
    simulated = scene.reaction(result.states[-1])[1]
    known = TEST.force(KNOWN, np.radians(30.0))
    print(f"load at 30 degrees: {simulated:.2f} N, of the known law {known:.2f} N")
    assert abs(simulated / known - 1) < 0.03


if __name__ == "__main__":
    main()
