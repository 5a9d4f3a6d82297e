"""Laws of one set of shear tests, and predictions of the tests of the other set."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy import ndarray

from skfem_textile import Law, LoadStepper, Ply, Quadratic
from skfem_textile.calibration import (
    Choice,
    FabricFit,
    Fit,
    ShearTest,
    Simulation,
    fit_tests,
)
from skfem_textile.calibration.simulation import SimulatedTest
from skfem_textile.calibration.validation import predict_near
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.rectangle import rectangle

from ..common.running import errors_only
from ..common.tables import Row
from .published import BIAS, FABRICS, FRAMES, Curve, fibre_stiffnesses, of_fabric

#: Shear angle in degrees up to which laws are fitted and tests predicted: the range
#: of the kinematics of a bias extension by default.
UP_TO = 40.0

#: Shear angles in degrees at which moments are stated.
ANGLES = (5, 10, 20, 30, 40)

#: Multiples of the assumed tension stiffness with which predictions are repeated.
STIFFNESSES = (0.5, 2.0)

# Density of the mesh along the singular fibres, numerical stiffness and points of the
# default formulation on such meshes, and load steps.
_DENSITY, _DEVIATION, _POINTS, _STEPS = 1.5, 400.0, 6, 8


def choice(law: str = "polynomial") -> Choice:
    """Default options of a fit, or another law."""
    extrapolation = "linear" if law == "tabulated" else None
    return Choice(law, up_to=np.radians(UP_TO), extrapolation=extrapolation)


@cache
def fitted(
    fabric: str, test: str, without: str = "", law: str = "polynomial"
) -> FabricFit:
    """Law of all first loadings of a test, or without one of them."""
    used = [
        curve.specimen
        for curve in of_fabric(fabric, test)
        if curve.first_loading and curve.name != without
    ]
    with errors_only():
        return fit_tests(used, choice(law))


def further(fit: Fit, test: ShearTest | None, gamma: ndarray) -> ndarray:
    """Half-width of the scatter of a further specimen: of its force, or of moments."""

    def value(law: Law) -> ndarray:
        return law.value(gamma) if test is None else test.force(law, gamma)

    band = fit.scatter(value)
    assert band is not None  # at least three specimens
    return 0.5 * np.ptp(band, axis=0)


@dataclass(frozen=True)
class LawCase:
    """Law of the picture frames or of the bias extensions of a fabric."""

    fabric: str
    test: str

    def __str__(self) -> str:
        return f"law: {self.fabric}, {self.test}s"

    def rows(self) -> list[Row]:
        """Moments with bands, and by a table instead of a polynomial."""
        result = fitted(self.fabric, self.test)
        fit, gamma = result.parts["shear"], np.radians(ANGLES)
        low, high = fit.band(lambda law: law.value(gamma))
        table = fitted(self.fabric, self.test, law="tabulated").laws["shear"]
        moments = {
            "moment": fit.law.value(gamma),
            "mean_half": 0.5 * (high - low),
            "specimen_half": further(fit, None, gamma),
            "tabulated": table.extrapolated.value(gamma),
        }
        return [
            {
                "fabric": self.fabric,
                "test": self.test,
                "specimens": len(result.tests),
                "angle": angle,
                **{name: float(x[i]) for name, x in moments.items()},
            }
            for i, angle in enumerate(ANGLES)
        ]


def simulated(
    test: ShearTest, laws: dict[str, Law], tension: tuple[float, float]
) -> SimulatedTest:
    """Simulation of a test; of bias extensions on triangles along singular fibres."""
    settings, end = Simulation(tension), float(np.radians(UP_TO))
    with errors_only():
        if test.imposes_angle:
            return settings.test(laws, test, end)
        mesh = rectangle(test.width, test.height, (1, 1))  # type: ignore[attr-defined]
        scene = bias_extension(mesh, shear_angle=end)
        fabric = replace(settings.fabric(laws), warp=scene.warp, weft=scene.weft)
        graded = scene.graded(fabric, _DENSITY)
        ply = Ply(graded.mesh, fabric, Quadratic(_DEVIATION, points=_POINTS))
        result = LoadStepper(ply, graded.conditions, _STEPS).run()
    return SimulatedTest(settings, test, graded, result, laws, end)


@dataclass(frozen=True)
class Predicted:
    """A test predicted with the law of other tests of the fabric.

    Attributes
    ----------
    fabric, test, name
        The predicted test.
    law
        Tests of the law: the other kind, or the other specimens of this kind.
    """

    fabric: str
    test: str
    name: str
    law: str

    def __str__(self) -> str:
        others = "other " if self.law == self.test else ""
        return f"predicted: {self.fabric}, {self.name}, from {others}{self.law}s"

    @property
    def curve(self) -> Curve:
        """The measured curve."""
        of_test = of_fabric(self.fabric, self.test)
        (curve,) = (curve for curve in of_test if curve.name == self.name)
        return curve

    def rows(self) -> list[Row]:
        """Measured and predicted force at each measured point, with all bands."""
        without = self.name if self.law == self.test else ""
        result = fitted(self.fabric, self.law, without)
        one = self.curve.specimen
        used = one.used(np.radians(UP_TO)) & (one.angle > 0)
        gamma, force = one.angle[used], one.force[used]
        tension = fibre_stiffnesses(self.fabric)
        found = simulated(one.test, result.laws, tension)
        prediction = predict_near(result, found, gamma)
        of_laws = {
            "predicted": prediction.force,
            "mean_half": prediction.pointwise,
            "specimen_half": further(result.parts["shear"], one.test, gamma),
            "mesh_half": prediction.discretisation,
        }
        for times in STIFFNESSES:
            warp, weft = (times * E for E in tension)
            other = simulated(one.test, result.laws, (warp, weft))
            at = other.force(other.laws, gamma)
            of_laws[f"stiffness_{times:g}"] = at / prediction.force - 1
        return [
            {
                "fabric": self.fabric,
                "test": self.test,
                "name": self.name,
                "law": self.law,
                "x": float(self.curve.x[used][i]),
                "angle": float(np.degrees(gamma[i])),
                "measured": float(force[i]),
                **{name: float(x[i]) for name, x in of_laws.items()},
            }
            for i in range(gamma.size)
        ]


def shear_cases() -> Sequence[LawCase | Predicted]:
    """Laws, bias extensions by both kinds of laws, and picture frames."""
    pairs = ((BIAS, FRAMES), (BIAS, BIAS), (FRAMES, BIAS))
    return [
        *(LawCase(fabric, test) for fabric in FABRICS for test in (FRAMES, BIAS)),
        *(
            Predicted(fabric, test, curve.name, law)
            for fabric in FABRICS
            for test, law in pairs
            for curve in of_fabric(fabric, test)
        ),
    ]
