"""Tests of one known fabric: strips, frame, bias extension, biaxial and cantilever."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy import ndarray

from skfem_textile import Linear, Locking
from skfem_textile.calibration import (
    BiasExtension,
    BiaxialCurve,
    CantileverTest,
    Choice,
    PictureFrame,
    Simulation,
    Specimen,
    Strip,
    Zeros,
    residuals,
)
from skfem_textile.calibration.choice import Test
from skfem_textile.calibration.simulation import SimulatedTest

#: Laws of the fabric by part, and their parameters.
TRUTH: dict[str, tuple[float, ...]] = {
    "warp": (2000.0,),
    "weft": (1500.0,),
    "shear": (0.08, 1.2),
    "bending warp": (5.0,),
    "bending weft": (3.0,),
}
LAWS: Mapping[str, Any] = {
    part: Locking(*values) if part == "shear" else Linear(*values)
    for part, values in TRUTH.items()
}
CHOICE = Choice(shear="locking", tension="linear")

#: Noise relative to the largest force or overhang, and rows of a curve.
NOISE, ROWS = 0.01, 400

#: Dimensions of the tests in mm.
BIAS, FRAME = BiasExtension(100.0, 200.0), PictureFrame(200.0, 160.0)
_STRIP, _BIAXIAL = (50.0, 200.0), (100.0, 100.0)

#: Largest shear angles in degrees of bias extension and frame, largest strain, and
#: ratios of the strains of biaxial tests.
REACH, CLOSED, STRAIN, RATIOS = 40.0, 55.0, 0.03, (0.5, 1.0, 2.0)

#: Readings of each family by cantilever, and their weight per area in N/mm².
READINGS, WEIGHT = 40, 6e-6

# Slack of a test, relative to its largest displacement.
_SLACK = 0.02

#: Mesh of the simulated bias extension.
SIMULATION = Simulation(across=12)


@cache
def simulated() -> SimulatedTest:
    """The bias extension of the known fabric."""
    return SIMULATION.test(LAWS, BIAS, np.radians(REACH + 2))


@dataclass(frozen=True)
class Drawn:
    """Tests of the fabric with noise of a seed."""

    seed: int
    noise: float = NOISE

    def tests(self) -> dict[str, list[Test]]:
        """Tests by kind."""
        rng = np.random.default_rng(self.seed)

        def noisy(values: ndarray) -> ndarray:
            most = np.abs(values).max(axis=-1, keepdims=True)
            return values + self.noise * most * rng.standard_normal(values.shape)

        return {
            "strip": [self._strip(name, noisy) for name in ("warp", "weft")],
            "picture frame": [self._frame(noisy)],
            "bias extension": [self._bias(noisy)],
            "biaxial": [self._biaxial(ratio, noisy) for ratio in RATIOS],
            "cantilever": [self._cantilever(name, rng) for name in ("warp", "weft")],
        }

    def _strip(self, family: str, noisy: Any) -> Strip:
        moved, slack = _displacements(STRAIN * _STRIP[1])
        strip = Strip(
            *(f"strip, {family}", family, *_STRIP, moved, np.zeros(ROWS)), None
        )
        force = residuals.strip(strip).predict(LAWS, slack)
        return Strip(*(strip.name, family, *_STRIP, moved, noisy(force)), None)

    def _frame(self, noisy: Any) -> Specimen:
        moved, slack = _displacements(float(FRAME.displacement(np.radians(CLOSED))))
        gamma = FRAME.shear_angle(np.maximum(moved - slack, 0.0))
        force = noisy(FRAME.force(LAWS["shear"], gamma))
        return Specimen("frame", FRAME, force, moved, zeros=Zeros(None, 0.0))

    def _bias(self, noisy: Any) -> Specimen:
        moved, slack = _displacements(float(BIAS.displacement(np.radians(REACH))))
        gamma = BIAS.shear_angle(np.maximum(moved - slack, 0.0))
        force = noisy(simulated().force(LAWS, gamma))
        return Specimen("bias", BIAS, force, moved, zeros=Zeros(None, 0.0))

    def _biaxial(self, ratio: float, noisy: Any) -> BiaxialCurve:
        elongation, slack = _displacements(STRAIN)
        scale = np.array([[1.0], [ratio]]) / max(1.0, ratio)
        strain = np.log1p(elongation * scale)
        name = f"biaxial {ratio:g}"
        curve = BiaxialCurve(name, strain, 0 * strain, _BIAXIAL, slack_is_unknown=True)
        force = np.array(
            [
                residuals.biaxial(curve, i).predict(LAWS, slack * float(scale[i, 0]))
                for i in range(2)
            ]
        )
        return BiaxialCurve(name, strain, noisy(force), _BIAXIAL, slack_is_unknown=True)

    def _cantilever(self, family: str, rng: np.random.Generator) -> CantileverTest:
        angle = np.radians(41.5)
        one = CantileverTest(family, np.ones(1), np.full(1, angle), WEIGHT)
        length = np.cbrt(LAWS[f"bending {family}"].stiffness / one.by_elastica[0])
        lengths = length * (1 + self.noise * rng.standard_normal(READINGS))
        name = f"cantilever, {family}"
        return CantileverTest(name, lengths, np.full(READINGS, angle), WEIGHT, family)


def _displacements(reach: float) -> tuple[ndarray, float]:
    """Equal steps up to a displacement beyond the slack, and the slack."""
    slack = _SLACK * reach
    return np.linspace(0.0, reach + slack, ROWS), slack
