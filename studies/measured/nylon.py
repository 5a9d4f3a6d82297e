"""Woven nylon in seven directions: laws of three, predictions of four."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy import ndarray

from skfem_textile import Condition, Fabric, LoadStepper, Ply
from skfem_textile.calibration import (
    BiasExtension,
    Choice,
    FabricFit,
    Simulation,
    Specimen,
    Strip,
    fit_tests,
    load_band,
)
from skfem_textile.calibration.choice import Test
from skfem_textile.scenes.rectangle import rectangle

from ..common.running import errors_only
from ..common.tables import Row
from .published import columns

#: Directions in degrees: fitted, and predicted.
FITTED, DIRECTIONS = (0, 45, 90), (15, 30, 60, 75)

#: Width and length of a strip in mm, and number of strips that share the force.
WIDTH, LENGTH, STRIPS = 2.25, 97.0, 12

# Error in degrees of the direction of a cut, for the sensitivity to it.
_CUT = 1.0

# Elements across and along a strip, and load steps.
_MESH, _STEPS = (2, 86), 6


@cache
def measured() -> dict[str, ndarray]:
    """Displacement in mm, and forces of all strips by direction in N."""
    return columns("nylon/forces.csv")


@cache
def fitted() -> FabricFit:
    """Tension laws of strips at 0° and 90°, and the shear law of one at 45°.

    Tables for the tension, which stiffens along one family and softens along the
    other; the strip at 45° is simulated, because its fibres stretch.
    """
    data = measured()
    moved = data["displacement_mm"]
    tests: list[Test] = [
        *(
            Strip(
                *(f"{angle}°", family, WIDTH, LENGTH, moved),
                data[f"measured_{angle}"] / STRIPS,
            )
            for angle, family in ((0, "warp"), (90, "weft"))
        ),
        Specimen(
            *("45°", BiasExtension(WIDTH, LENGTH), data["measured_45"] / STRIPS, moved)
        ),
    ]
    with errors_only():
        choice = Choice(tension="tabulated", extrapolation="linear")
        return fit_tests(tests, choice, Simulation(across=4))


def forces(fabric: Fabric, degrees: float) -> ndarray:
    """Forces of all strips in N at equal steps of the displacement, from 0 on."""
    theta = np.radians(degrees)
    mesh = rectangle(WIDTH, LENGTH, _MESH, "irregular")
    turned = Fabric(
        fabric.tension,
        fabric.shear,
        warp=(np.sin(theta), np.cos(theta)),
        weft=(-np.cos(theta), np.sin(theta)),
    )
    end = float(measured()["displacement_mm"][-1])
    conditions = {"bottom": Condition("bottom"), "top": Condition("top", (0.0, end))}
    with errors_only():
        result = LoadStepper(Ply(mesh, turned), conditions, _STEPS).run()
    times = [state.load_factor for state in result.states]
    along = [state.reactions["top"][1] for state in result.states[1:]]
    return STRIPS * np.interp(np.linspace(0, 1, _STEPS + 1), times, [0.0, *along])


@dataclass(frozen=True)
class Direction:
    """A direction that was fitted or predicted."""

    degrees: int

    def __str__(self) -> str:
        return f"nylon: {self.degrees}°"

    def rows(self) -> list[Row]:
        """Measured and predicted forces, with the band of the laws."""
        data = measured()
        band = load_band(fitted(), Fabric(), lambda x: forces(x, self.degrees))
        moved = data["displacement_mm"]
        at = np.linspace(0.0, moved[-1], _STEPS + 1)
        force = np.interp(at, moved, data[f"measured_{self.degrees}"])
        lamina = np.interp(at, moved, data[f"abaqus_{self.degrees}"])
        cut = [
            forces(fitted().fabric(Fabric()), self.degrees + x) for x in (-_CUT, _CUT)
        ]
        per_degree = (cut[1] - cut[0])[1:] / (2 * _CUT * band.force[1:])
        return [
            {
                "direction": self.degrees,
                "fitted": self.degrees in FITTED,
                "displacement": float(at[i]),
                "measured": float(force[i]),
                "predicted": float(band.force[i]),
                "mean_half": float(band.pointwise[i]),
                "lamina": float(lamina[i]),
                "per_degree": float(per_degree[i - 1]),
            }
            for i in range(1, at.size)
        ]


def nylon_cases() -> list[Direction]:
    """All seven directions."""
    return [*map(Direction, sorted(FITTED + DIRECTIONS))]
