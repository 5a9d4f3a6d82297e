"""
Results as glTF files
=====================

A bias-extension test in the plane, a ply draped on a double dome, and a ply that a
hemisphere forms. The script writes one glTF file for each, which the documentation
shows in 3D. A build of the documentation runs it if ``docs/models`` does not exist:

    python examples/media/results_in_3d.py docs/models
"""

import sys
from pathlib import Path

import numpy as np

from skfem_textile import Fabric, Result, plot
from skfem_textile.scenes import (
    Case,
    Scene,
    bias_extension,
    double_dome,
    hemisphere_forming,
)

# %%
# Fibres of the draped ply are at 45° to its long side, and the ply is computed as a
# whole.


def run(scene: Scene, bending: float = 0.0, steps: int = 5) -> Result:
    """Equilibrium of a fabric in a scene."""
    fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, (bending, bending))
    return Case(scene=scene, fabric=fabric, steps=steps).run()


def results(size: int = 12) -> dict[str, Result]:
    """Results by the name of their file, with as many elements along the sides."""
    sides = (size, size)
    draped = double_dome(
        part="whole", fibres=np.radians(45), tension=2.0, size=(2 * size, size)
    )
    formed = hemisphere_forming(part="whole", tension=0.5, size=sides)
    return {
        "bias_extension": run(bias_extension(size=(size, 2 * size))),
        "draped": run(draped),
        "formed": run(formed, bending=5.0, steps=10),
    }


if __name__ == "__main__":
    for name, result in results().items():
        plot.export_gltf(result, Path(sys.argv[1]) / f"{name}.gltf")
