"""The load that fibre stretch costs: its estimate, and what converged loads give."""

from typing import NamedTuple

import numpy as np

from skfem_textile import Fabric, Law, Linear, LoadStepper, Ply, Quadratic, Sin2
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.bias_extension import WIDTH

from ..angles.aligned_mesh import graded_mesh
from ..angles.cases import GRADING, G
from .documented import Results

# Cells along a side of a rhombus, and load steps.  Chosen: with 16 cells the shares
# differ by a tenth of them at most, at E/G = 2e6.
_CELLS, _STEPS = 24, 4

_LAWS: dict[str, Law] = {"linear": Linear(G), "sin²": Sin2(G)}


class Stretched(NamedTuple):
    """A bias extension: angles in degrees, a shear law, and E/G of warp and weft."""

    inclination: float
    shear_angle: float
    ratios: tuple[float, float]
    law: str = "linear"

    @property
    def name(self) -> str:
        """What to call it."""
        ratios = " and ".join(f"{x:.0e}".replace("e+0", "e") for x in self.distinct)
        angles = f"{self.inclination:g}°, γ = {self.shear_angle:g}°"
        return f"fibre stretch at {angles}, {self.law}, E/G = {ratios}"

    @property
    def distinct(self) -> list[float]:
        """The ratios E/G that differ."""
        return sorted(set(self.ratios))


def results_of(ply: Stretched) -> Results:
    """The estimated share of the load, and the share at the converged load."""
    theta, gamma = np.radians([ply.inclination, ply.shear_angle])
    scene = bias_extension(
        graded_mesh(theta, WIDTH, _CELLS, GRADING),
        warp=theta,
        weft=np.pi - theta,
        shear_angle=gamma,
    )
    warp, weft = ply.ratios
    stiffnesses = G * warp, G * weft
    fabric = Fabric(stiffnesses, _LAWS[ply.law], scene.warp, scene.weft)
    along = Ply(scene.mesh, fabric, Quadratic())
    summary = scene.summary(LoadStepper(along, scene.conditions, _STEPS).run())
    return {
        "estimate": float(summary["load_lost_to_fibre_stretch"]),
        "measured": 1 - float(summary["load_over_exact"]),
    }


def _both(ratio: float) -> tuple[float, float]:
    return ratio, ratio


#: The cases by name.
STRETCHED = {
    ply.name: ply
    for ply in (
        Stretched(30, 40, _both(2e4)),
        Stretched(30, 40, _both(2e5)),
        Stretched(35, 70, _both(2e5)),
        Stretched(45, 20, _both(2e5)),
        Stretched(45, 40, _both(2e4)),
        Stretched(45, 40, _both(2e5)),
        Stretched(45, 40, _both(2e6)),
        Stretched(45, 40, (2e4, 2e5)),
        Stretched(45, 40, _both(2e3), "sin²"),
        Stretched(45, 40, _both(2e5), "sin²"),
        Stretched(52.5, 40, _both(2e4)),
        Stretched(52.5, 40, _both(2e6)),
        Stretched(60, 20, _both(2e4)),
        Stretched(60, 40, _both(2e4)),
        Stretched(60, 40, _both(2e5)),
    )
}
