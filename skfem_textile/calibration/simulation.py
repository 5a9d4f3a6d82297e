"""Simulated shear tests, as functions of the laws of the fabric.

A simulation takes the stretch of the fibres into account, and everything else that the
closed form for inextensible fibres neglects.  The ratio of the simulated load to the
closed form depends only weakly on the laws: the closed form times this ratio is fitted,
and the simulation is repeated with the resulting laws until the loads converge.  How
the ratio depends on tension laws with unknown parameters follows from the estimate of
the load that is lost to the stretch of fibres, `lost_to_stretch`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy  # whose modules are imported on first use
from numpy import ndarray

from ..fabric import Fabric, Law, Tabulated
from ..fabric.origin import tension_of
from ..ply import Ply
from ..scenes.bias_extension import bias_extension, lost_to_stretch
from ..scenes.rectangle import rectangle
from ..scenes.scene import Scene
from ..scenes.shear_test import BiasExtension, PictureFrame, ShearTest
from ..scenes.trellis import picture_frame
from ..solve.result import Result, StepError
from ..solve.stepper import LoadStepper
from .solving import Laws

#: Default fibre stiffness in N/mm.
FIBRES = 1e5

# Distortion of the irregular meshes, relative to an element.
_JITTER = 0.25


class Simulated(NamedTuple):
    """Theoretical shear angles and forces of a simulated test, from 0 on, shape (n,).

    ``stabilisation`` is its largest share of the energy.
    """

    angles: ndarray
    forces: ndarray
    stabilisation: float


@dataclass(frozen=True)
class Simulation:
    """Settings of simulated tests.

    Parameters
    ----------
    tension
        Fibre stiffness in N/mm or tension law, see `Fabric`.
    across
        Number of element edges across the width.
    steps
        Number of load steps, equal in the shear angle.
    seed
        Seed of the irregular mesh.
    """

    tension: Any = FIBRES
    across: int = 12
    steps: int = 12
    seed: int = 1

    def __post_init__(self) -> None:
        if self.across < 2 or self.across % 2:
            raise ValueError(
                "the number of elements across must be even and at least 2, got "
                f"{self.across}"
            )

    def curve(self, law: Law, test: BiasExtension, largest: float) -> Simulated:
        """Curve of a shear law from 0 up to a theoretical shear angle in radians.

        Raises
        ------
        ValueError
            If the simulation does not reach the angle.
        """
        found = self.test({"shear": law}, test, largest)
        return Simulated(found.angles, found.forces, found.stabilisation)

    def fabric(self, laws: Laws) -> Fabric:
        """Fabric of laws by part, with the tension of the settings for missing ones."""
        law, tension = laws["shear"], tension_of(laws, Fabric(self.tension))
        if isinstance(law, Tabulated):  # some elements shear more than the middle
            law = law.extrapolated
        return Fabric(tension, law)

    def _scene(self, test: ShearTest, largest: float) -> Scene:
        """Scene of a test on an irregular mesh."""
        nx = self.across // 2  # elements are split into four
        if isinstance(test, PictureFrame):
            L = test.fabric
            # equally high elements: see `picture_frame`
            mesh = rectangle(L, L, (nx, nx), "horizontal", _JITTER, self.seed)
            return picture_frame(mesh, shear_angle=largest)
        assert isinstance(test, BiasExtension)
        W, H, theta = test.width, test.height, test.inclination
        warp, weft = theta, np.pi - theta
        size = nx, max(round(nx * H / W), 2)
        mesh = rectangle(W, H, size, "irregular", _JITTER, self.seed)
        return bias_extension(mesh, warp=warp, weft=weft, shear_angle=largest)

    def test(self, laws: Laws, test: ShearTest, largest: float) -> "SimulatedTest":
        """Simulation from 0 up to a theoretical shear angle in radians.

        Raises
        ------
        ValueError
            If the simulation does not reach the angle.
        """
        scene = self._scene(test, largest)
        fabric = replace(self.fabric(laws), warp=scene.warp, weft=scene.weft)
        stepper = LoadStepper(Ply(scene.mesh, fabric), scene.conditions, self.steps)
        try:
            result = stepper.run()
        except StepError as error:
            raise ValueError(f"the simulation of the test failed: {error}") from None
        return SimulatedTest(self, test, scene, result, dict(laws), largest)


@dataclass(frozen=True, eq=False)
class SimulatedTest:
    """Simulated bias extension or picture frame.

    Attributes
    ----------
    settings
        Settings of the simulation.
    test
        Dimensions of the test.
    scene, result
        The scene and its states.
    laws
        Laws of the simulation, by part.
    largest
        Theoretical shear angle in radians at the end.
    """

    settings: Simulation
    test: ShearTest
    scene: Scene
    result: Result
    laws: Laws
    largest: float

    @cached_property
    def angles(self) -> ndarray:
        """Theoretical shear angle of each state in radians, (n,)."""
        return self.largest * np.array([one.load_factor for one in self.result.states])

    @cached_property
    def forces(self) -> ndarray:
        """Force of the machine at each state in N, (n,)."""
        _, along = self.scene.driven_curve(self.result)
        if isinstance(self.test, PictureFrame):  # arms longer than the fabric
            return along * self.test.fabric / self.test.frame
        return along

    @property
    def stabilisation(self) -> float:
        """Largest share of the stabilisation in the energy."""
        states = self.result.states[1:]
        return max(one.shares["energy"]["stabilisation"] for one in states)

    def force(self, laws: Laws, gamma: ndarray) -> ndarray:
        """Forces in N at theoretical shear angles, for laws near the simulated ones."""
        ratio = self._ratio
        if {"warp", "weft", "both"} & set(laws):
            ratio = _through(self.angles, self._ratios * self._kept(laws) / self._own)
        return ratio(gamma) * self.test.force(laws["shear"], gamma)

    @cached_property
    def _ratios(self) -> ndarray:
        """Ratio of the force to the closed form, at each state but the first, (n,)."""
        return self.forces[1:] / self.test.force(self.laws["shear"], self.angles[1:])

    @cached_property
    def _ratio(self) -> Callable[[ndarray], ndarray]:
        """Ratio of the force to the closed form at shear angles."""
        return _through(self.angles, self._ratios)

    @cached_property
    def _own(self) -> ndarray:
        return self._kept(self.laws)

    @cached_property
    def half_widths(self) -> ndarray:
        """Half-width of the discretisation error of each force in N, (n,).

        NaN where there is none.
        """
        found = [self.result.interval(one).load for one in self.result.states]
        relative = np.array([np.nan if x is None else x for x in found])
        return np.concatenate([[0.0], relative[1:] * np.abs(self.forces[1:])])

    @property
    def lost(self) -> ndarray:
        """Estimated share of the closed form lost to the stretch of fibres, (n,)."""
        return 1 - np.concatenate([self._own[:1], self._own])

    def _kept(self, laws: Laws) -> ndarray:
        """Estimated share of the force kept by the fibres of each state, (n,)."""
        if not isinstance(self.test, BiasExtension):
            return np.ones(self.angles.size - 1)
        W, H, theta = self.test.width, self.test.height, self.test.inclination
        fabric = self.settings.fabric(laws)
        return 1 - lost_to_stretch(fabric, self.angles[1:], W, H, theta)


def _through(angles: ndarray, values: ndarray) -> Callable[[ndarray], ndarray]:
    """Smooth function with the values at the angles; at rest with the first one."""
    return scipy.interpolate.PchipInterpolator(
        angles, np.concatenate([values[:1], values])
    )


def simulated(
    simulation: Simulation,
    laws: Laws,
    tests: Sequence[ShearTest],
    largest: Sequence[float],
) -> dict[ShearTest, SimulatedTest]:
    """Simulation of each test; specimens of one size share a simulation."""
    ends: dict[ShearTest, float] = {}
    for test, end in zip(tests, largest, strict=True):
        ends[test] = max(end, ends.get(test, 0.0))
    return {test: simulation.test(laws, test, end) for test, end in ends.items()}
