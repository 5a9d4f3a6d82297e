"""Joint fits of five tests of one fabric, and predictions of a held-out test."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy import ndarray

from skfem_textile import Fabric, LoadStepper, Ply, Quadratic
from skfem_textile.calibration import (
    BiasExtension,
    FabricFit,
    Prediction,
    Simulation,
    fit_tests,
    predict,
)
from skfem_textile.calibration.choice import Test
from skfem_textile.calibration.fitting import fit_near
from skfem_textile.calibration.simulation import SimulatedTest
from skfem_textile.calibration.validation import predict_near
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.rectangle import rectangle

from ..study import Row
from .fabric import BIAS, CHOICE, LAWS, SIMULATION, TRUTH, Drawn, simulated

#: Seeds of joint fits.
JOINT_SEEDS = range(1, 4)

#: Seeds of predictions, and those whose fit and prediction are fully simulated.
HELD_OUT_SEEDS, FULL_SEEDS = range(1, 101), range(1, 4)

#: The held-out test, its largest shear angle in degrees, and number of points.
HELD_OUT, REACH, POINTS = BiasExtension(80.0, 240.0), 38.0, 60
_GAMMA = np.linspace(0.0, np.radians(REACH), POINTS + 1)[1:]

#: Mesh of the prediction: another one than in the fit.
_OTHER = Simulation(across=16, seed=7)

# Density of the mesh along the singular fibres on which the load is converged, its
# numerical stiffness in N/mm and points, as in the study of calibration, and steps.
_DENSITY, _STIFFNESS, _INTEGRATION, _STEPS = 2.0, 400.0, 6, 12


@dataclass(frozen=True)
class Joint:
    """Five tests of one fabric, fitted jointly and by kind."""

    seed: int

    def __str__(self) -> str:
        return f"joint: seed {self.seed}"

    def rows(self) -> list[Row]:
        """Errors and half-widths of all parameters, relative to the known ones."""
        tests = Drawn(self.seed).tests()
        every = [test for of_kind in tests.values() for test in of_kind]
        joint = fit_tests(every, CHOICE, SIMULATION)
        alone = {kind: _alone(kind, of_kind) for kind, of_kind in tests.items()}
        rows: list[Row] = []
        for part, truth in TRUTH.items():
            fit, half = joint.parts[part], _half_widths(joint, part)
            for i, name in enumerate(fit.model.parameters):
                row: Row = {"seed": self.seed, "parameter": f"{part}, {name}"}
                row["error"] = float(fit.values[i] / truth[i] - 1)
                row["joint"] = half[i]
                for kind, result in alone.items():
                    if part in result.parts:
                        row[kind] = _half_widths(result, part)[i]
                rows.append(row)
        return rows


def _alone(kind: str, tests: Sequence[Test]) -> FabricFit:
    """Fit of one kind of test; of a bias extension with the known tension laws."""
    if kind != "bias extension":
        return fit_tests(tests, CHOICE)
    known = Simulation((LAWS["warp"], LAWS["weft"]), SIMULATION.across)
    return fit_tests(tests, CHOICE, known)


def _half_widths(result: FabricFit, part: str) -> list[float]:
    """Half-widths of the bands of the parameters, relative to the known ones."""
    bands = np.ptp(result.parts[part].intervals, axis=1)
    return [float(0.5 * x / y) for x, y in zip(bands, TRUTH[part], strict=True)]


@dataclass(frozen=True)
class HeldOut:
    """Predictions of a held-out bias extension by fits of many seeds.

    Fits and predictions share the simulations of the known fabric: the laws are near
    the known ones.  `FullySimulated` verifies this.
    """

    def __str__(self) -> str:
        return "held out: all seeds"

    def rows(self) -> list[Row]:
        """Comparison of the converged load with the bands, by seed."""
        return [_judged(seed, _near(seed)) for seed in HELD_OUT_SEEDS]


@dataclass(frozen=True)
class FullySimulated:
    """A fit and a prediction with simulations of the fitted laws."""

    seed: int

    def __str__(self) -> str:
        return f"held out: fully simulated, seed {self.seed}"

    def rows(self) -> list[Row]:
        """Comparison with the bands, and with shared simulations."""
        result = fit_tests(_tests(self.seed), CHOICE, SIMULATION)
        full = predict(result, Fabric(), HELD_OUT, _GAMMA, _OTHER)
        near = _near(self.seed)
        difference = np.abs(full.force / near.force - 1).max()
        width = np.abs(full.deviation / near.deviation - 1).max()
        more = {"force_apart": float(difference), "band_apart": float(width)}
        return [_judged(self.seed, full) | more]


def _tests(seed: int) -> list[Test]:
    return [test for of_kind in Drawn(seed).tests().values() for test in of_kind]


def _near(seed: int) -> Prediction:
    """Prediction by the shared simulations."""
    start = np.concatenate([np.array(values) for values in TRUTH.values()])
    result = fit_near(_tests(seed), CHOICE, {BIAS: simulated()}, start)
    return predict_near(result, _held_out(), _GAMMA)


def _judged(seed: int, one: Prediction) -> Row:
    """Comparison of curves of the known fabric with the bands of a prediction.

    The converged load in the whole band; the load on the mesh of the prediction in the
    band of the parameters alone.
    """
    row: Row = {"seed": seed}
    same = _held_out().force(LAWS, _GAMMA)
    for name, truth, more in (
        ("converged", _converged(), one.discretisation),
        ("same_mesh", same, np.zeros(POINTS)),
    ):
        off = np.abs(truth - one.force)
        row[f"{name}_inside"] = bool(np.all(off <= _whole(one) + more))
        row[f"{name}_share"] = float(np.mean(off <= one.pointwise + more))
        row[f"{name}_error"] = float((off / truth).max())
    row["parameters"] = float((one.pointwise / one.force).max())
    row["discretisation"] = float((one.discretisation / one.force).max())
    return row


def _whole(one: Prediction) -> ndarray:
    """Half-width of the band of the parameters for the whole curve."""
    return one.simultaneous * one.deviation


@cache
def _held_out() -> SimulatedTest:
    """The held-out test of the known fabric on the mesh of the prediction."""
    return _OTHER.test(LAWS, HELD_OUT, np.radians(REACH))


@cache
def _converged() -> ndarray:
    """Converged forces of the held-out test of the known fabric."""
    mesh = rectangle(HELD_OUT.width, HELD_OUT.height, (1, 1))
    scene = bias_extension(mesh, shear_angle=np.radians(REACH))
    tension = LAWS["warp"], LAWS["weft"]
    fabric = Fabric(tension, LAWS["shear"], scene.warp, scene.weft)
    graded = scene.graded(fabric, _DENSITY)
    ply = Ply(graded.mesh, fabric, Quadratic(_STIFFNESS, points=_INTEGRATION))
    result = LoadStepper(ply, graded.conditions, _STEPS).run()
    settings = Simulation(tension)
    on_net = SimulatedTest(
        *(settings, HELD_OUT, graded, result, LAWS, float(np.radians(REACH)))
    )
    return on_net.force(LAWS, _GAMMA)


JointCase = Joint | HeldOut | FullySimulated


def joint_cases() -> list[JointCase]:
    """Joint fits, and predictions of a held-out test."""
    return [
        *map(Joint, JOINT_SEEDS),
        HeldOut(),
        *map(FullySimulated, FULL_SEEDS),
    ]
