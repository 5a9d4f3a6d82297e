"""A shear law from bias extensions beyond the range of their kinematics.

The tests are simulated.  The load of the simulation over that of the closed form, which
has fibre stretch and all that the closed form leaves out in it, changes little with the
law: the closed form times this ratio is fitted, and the simulation repeated with the
law that was found, until the loads no longer change.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from scipy.interpolate import PchipInterpolator

from ..fabric import Fabric, Law, Tabulated
from ..ply import Ply
from ..scenes.bias_extension import bias_extension
from ..scenes.rectangle import rectangle
from ..scenes.shear_test import BiasExtension, ShearTest
from ..solve.result import StepError
from ..solve.stepper import LoadStepper
from .shear import ShearFit, Specimen, fit_shear

log = logging.getLogger(__name__)

# The loads no longer change: by less than this share of the largest.  Chosen: a tenth
# of what a curve with a noise of 1 % tells of a load.
_SETTLED = 1e-3

# Simulations of each test at most; four are usual.
_MOST_ROUNDS = 10


class Simulated(NamedTuple):
    """The curve of a simulated test.

    Attributes
    ----------
    angles, forces
        Theoretical shear angles in radians and forces in N, from 0 on, shape (n,).
    stabilisation
        Largest share of the stabilisation in the energy.
    """

    angles: ndarray
    forces: ndarray
    stabilisation: float


@dataclass(frozen=True)
class Simulation:
    """How tests are simulated.

    Parameters
    ----------
    tension
        Fibre stiffness in N/mm or tension law, as of `Fabric`.
    across
        Element edges across the width.
    steps
        Load steps, equal in the shear angle.
    seed
        Of the irregular mesh.
    """

    tension: Any = 1e5
    across: int = 12
    steps: int = 12
    seed: int = 1

    def __post_init__(self) -> None:
        if self.across < 2 or self.across % 2:
            raise ValueError(
                f"the number of elements across must be even and >= 2: {self.across}"
            )

    def curve(self, law: Law, test: BiasExtension, largest: float) -> Simulated:
        """The curve of a shear law from 0 up to a theoretical shear angle in radians.

        Raises
        ------
        ValueError
            If the simulation does not get there.
        """
        W, H, theta = test.width, test.height, test.inclination
        fibres = theta, np.pi - theta
        nx = self.across // 2  # elements are split into four
        size = nx, max(round(nx * H / W), 2)
        mesh = rectangle(W, H, size, "irregular", 0.25, self.seed, *fibres)
        warp, weft = fibres
        scene = bias_extension(mesh, warp=warp, weft=weft, shear_angle=largest)
        fabric = Fabric(self.tension, law, scene.warp, scene.weft)
        stepper = LoadStepper(Ply(mesh, fabric), scene.conditions, self.steps)
        try:
            states = stepper.run().states
        except StepError as error:
            raise ValueError(f"a simulation of the test fails: {error}") from None
        angles = np.array([state.load_factor for state in states]) * largest
        forces = np.array([scene.reaction(state)[1] for state in states])
        shares = [state.shares["energy"]["stabilisation"] for state in states[1:]]
        return Simulated(angles, forces, max(shares))


def fit_by_simulation(
    specimens: Sequence[Specimen],
    law: str = "polynomial",
    simulation: Simulation | None = None,
    *,
    degree: int = 5,
    points: int = 8,
    extrapolation: str | None = None,
    up_to: float | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> ShearFit:
    """Find a shear law with which simulated bias extensions have the measured loads.

    Parameters
    ----------
    specimens
        Curves of bias extensions, with displacements.
    law, degree, points, extrapolation, bounds
        As for `fit_shear`.
    simulation
        How the tests are simulated.
    up_to
        Theoretical shear angle in radians at the displacement beyond which points are
        left out; all points are taken without one.

    Raises
    ------
    ValueError
        As from `fit_shear`; if a specimen is no bias extension or has no displacements;
        or if a simulation fails, or the laws do not settle.
    """
    simulation = simulation or Simulation()
    for specimen in specimens:
        bias = isinstance(specimen.test, BiasExtension)
        if not bias or specimen.displacement is None:
            raise ValueError(
                f"{specimen.name}: only bias extensions with displacements are fitted "
                "by simulation"
            )
    driven = [replace(specimen, measured_angle=None) for specimen in specimens]
    end = np.inf if up_to is None else up_to
    how: dict[str, Any] = {"degree": degree, "points": points, "bounds": bounds}
    how["extrapolation"] = extrapolation
    found = fit_shear(driven, law, up_to=end, **how)
    largest = [float(s.angle[s.used(end)].max()) for s in driven]
    before = [np.full(1, np.inf) for _ in driven]
    for n in range(_MOST_ROUNDS):
        law_now = found.fit.law
        curves = _simulated(simulation, law_now, driven, largest)
        ratios = [_ratio(s.test, law_now, curves[s.test]) for s in driven]
        found = fit_shear(driven, law, up_to=end, **how, ratios=ratios)
        loads = [sample.predict(found.fit.law) for sample in found.fit.samples]
        change = max(
            float(np.abs(now - then).max() / np.abs(now).max())
            for now, then in zip(loads, before, strict=True)
        )
        log.info("simulation %d: loads change by %.3g of the largest", n + 1, change)
        if change < _SETTLED:
            shares = (curve.stabilisation for curve in curves.values())
            return replace(found, stabilisation=max(shares))
        before = loads
    raise ValueError(
        f"after {_MOST_ROUNDS} simulations the loads still change by {change:.2%}: "
        "take a law with fewer parameters, or --up-to a smaller angle"
    )


def _simulated(
    simulation: Simulation,
    law: Law,
    specimens: Sequence[Specimen],
    largest: Sequence[float],
) -> dict[Any, Simulated]:
    """The curve of each test; specimens of one size share a simulation."""
    if isinstance(law, Tabulated):  # some elements shear by more than the middle
        law = replace(law, extrapolation="linear")
    ends: dict[Any, float] = {}
    for specimen, end in zip(specimens, largest, strict=True):
        ends[specimen.test] = max(end, ends.get(specimen.test, 0.0))
    return {test: simulation.curve(law, test, end) for test, end in ends.items()}


def _ratio(test: ShearTest, law: Law, curve: Simulated) -> Callable[[ndarray], ndarray]:
    """The simulated load over that of the closed form."""
    ratio = curve.forces[1:] / test.force(law, curve.angles[1:])
    return PchipInterpolator(curve.angles, np.concatenate([ratio[:1], ratio]))
