"""Shear tests with inextensible fibres: shear zones and machine quantities."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, TypeVar

import numpy as np
from numpy import ndarray

from ..fabric import Law
from ..fabric.law import number

Angle = TypeVar("Angle", float, ndarray)


def force_of_moments(
    gamma: Angle, width: float, height: float, inclination: float = np.pi / 4
) -> tuple[Angle, Angle]:
    """Factors of C(γ) and C(γ/2) in the force at the clamps, in mm.

    They are the areas of the zones divided by the derivative dδ/dγ of the elongation δ.

    Parameters
    ----------
    gamma
        Shear angle in the middle of the ply in radians, a number or an array.
    width, height
        Sides W and H of the ply in mm, H ≥ 2W tan θ.
    inclination
        Angle θ between warp and clamps in radians.
    """
    W, H, tan = width, height, np.tan(inclination)
    rate = free_length(W, H, inclination) * np.cos(inclination + gamma / 2)
    return W * (H - 1.5 * W * tan) / rate, 0.5 * W**2 * tan / rate


def free_length(width: float, height: float, inclination: float) -> float:
    """Length L in mm of the fibres with both ends free."""
    return float((height / np.sin(inclination) - width / np.cos(inclination)) / 2)


# Angle in radians up to which a ply is regarded as undeformed: round-off.
_AT_REST = 1e-9


class ShearTest(ABC):
    """Test that shears inextensible fibres.

    Angles are in radians, lengths in mm, forces in N, moments in N·mm/mm².

    Attributes
    ----------
    imposes_angle
        True if the machine imposes the shear angle, also where fibres stretch.
    """

    imposes_angle: ClassVar[bool] = False

    @property
    @abstractmethod
    def largest_angle(self) -> float:
        """Shear angle at the end of the motion."""

    @abstractmethod
    def shear_angle(self, displacement: ndarray) -> ndarray:
        """Theoretical shear angle γ; nan beyond the end of the motion."""

    @abstractmethod
    def displacement(self, gamma: ndarray) -> ndarray:
        """Displacement at the theoretical shear angle."""

    @abstractmethod
    def arms(self, gamma: ndarray) -> tuple[tuple[float, ndarray], ...]:
        """Pairs of a factor s and a length a: the force is Σ a C(s γ)."""

    @abstractmethod
    def moment(self, gamma: ndarray, force: ndarray) -> ndarray:
        """C(γ), point by point, from forces at increasing shear angles.

        NaN where force or angle is NaN, and where the angle does not increase.
        """

    def normalised(self, gamma: ndarray, force: ndarray) -> ndarray:
        """Shear force per length in N/mm, C/cos γ; see `moment`."""
        return self.moment(gamma, force) / np.cos(gamma)

    def force(self, law: Law, gamma: ndarray) -> ndarray:
        """Force of a shear law at shear angles, linear in the law."""
        parts = (arm * law.value(share * gamma) for share, arm in self.arms(gamma))
        return sum(parts, np.zeros(np.shape(gamma)))


@dataclass(frozen=True)
class PictureFrame(ShearTest):
    """Square of fabric in a hinged frame, loaded along its diagonal.

    Parameters
    ----------
    frame
        L_frame, the side of the frame from hinge to hinge, in mm.
    fabric
        L_fabric, the side of the sheared square, in mm.

    Raises
    ------
    ValueError
        If a side is not a positive finite number, or the fabric is larger than the
        frame.

    Examples
    --------
    >>> from skfem_textile import Linear
    >>> test, gamma = PictureFrame(frame=200.0, fabric=150.0), np.radians([20.0, 40.0])
    >>> forces = test.force(Linear(0.1), gamma)
    >>> test.moment(gamma, forces) / gamma
    array([0.1, 0.1])
    """

    frame: float
    fabric: float
    imposes_angle: ClassVar[bool] = True

    def __post_init__(self) -> None:
        number("the side of the frame", self.frame, above=0)
        number("the side of the fabric", self.fabric, above=0)
        if self.fabric > self.frame:
            raise ValueError(
                f"the side of the fabric, {self.fabric:g} mm, is longer than the side "
                f"of the frame, {self.frame:g} mm"
            )

    @property
    def largest_angle(self) -> float:
        """Right angle, at which the frame is closed."""
        return np.pi / 2

    def shear_angle(self, displacement: ndarray) -> ndarray:
        """γ = π/2 − 2 acos(1/√2 + δ/(2 L_frame))."""
        with np.errstate(invalid="ignore"):
            half = np.arccos(np.sqrt(0.5) + displacement / (2 * self.frame))
        return np.pi / 2 - 2 * half

    def displacement(self, gamma: ndarray) -> ndarray:
        """δ = 2 L_frame (cos(π/4 − γ/2) − cos(π/4))."""
        return 2 * self.frame * (np.cos(np.pi / 4 - gamma / 2) - np.sqrt(0.5))

    def arms(self, gamma: ndarray) -> tuple[tuple[float, ndarray], ...]:
        """L_fabric² over dδ/dγ = L_frame sin(π/4 − γ/2)."""
        return ((1.0, self.fabric**2 / (self.frame * np.sin(np.pi / 4 - gamma / 2))),)

    def moment(self, gamma: ndarray, force: ndarray) -> ndarray:
        """C = F_n cos γ, F_n = F_s L_frame/L_fabric², F_s = F/(2 cos(π/4 − γ/2))."""
        F_s = force / (2 * np.cos(np.pi / 4 - gamma / 2))
        F_n = F_s * self.frame / self.fabric**2
        return F_n * np.cos(gamma)


@dataclass(frozen=True)
class BiasExtension(ShearTest):
    """Strip stretched along the bisector of its fibres, clamped at both ends.

    Parameters
    ----------
    width, height
        W and H in mm, H ≥ 2W tan θ between the clamps.
    inclination
        Angle θ between fibres and clamps in radians.

    Raises
    ------
    ValueError
        If a number is not positive and finite, θ is not below a right angle, or the
        strip is too short.

    Examples
    --------
    >>> from skfem_textile import Linear
    >>> BiasExtension(50.0, 100.0).force(Linear(0.5), np.radians([40.0])).round(2)
    array([43.8])
    """

    width: float
    height: float
    inclination: float = np.pi / 4

    def __post_init__(self) -> None:
        number("the width", self.width, above=0)
        number("the height", self.height, above=0)
        theta = self.inclination
        if not 0 < theta < np.pi / 2:
            raise ValueError(
                "the angle between fibres and clamps must be between 0 and 90 degrees, "
                f"got {np.degrees(theta):g} degrees"
            )
        low = 2 * self.width * np.tan(theta)
        if self.height < low * (1 - 1e-6):
            raise ValueError(
                f"a strip {self.width:g} mm wide with fibres at {np.degrees(theta):g} "
                f"degrees must be at least {low:g} mm high, not {self.height:g} mm, "
                "because otherwise no zone between the clamps is in full shear"
            )

    @property
    def largest_angle(self) -> float:
        """π − 2θ, at which fibres are parallel to the loading direction."""
        return np.pi - 2 * self.inclination

    @property
    def _length(self) -> float:
        return free_length(self.width, self.height, self.inclination)

    def shear_angle(self, displacement: ndarray) -> ndarray:
        """γ = 2 (asin(sin θ + δ/(2L)) − θ)."""
        theta = self.inclination
        with np.errstate(invalid="ignore"):
            turned = np.arcsin(np.sin(theta) + displacement / (2 * self._length))
        return 2 * (turned - theta)

    def displacement(self, gamma: ndarray) -> ndarray:
        """δ = 2L (sin(θ + γ/2) − sin θ)."""
        theta = self.inclination
        return 2 * self._length * (np.sin(theta + gamma / 2) - np.sin(theta))

    def arms(self, gamma: ndarray) -> tuple[tuple[float, ndarray], ...]:
        """Pairs for the middle, and for the zones sheared by γ/2."""
        sides = self.width, self.height, self.inclination
        middle, between = force_of_moments(gamma, *sides)
        return (1.0, middle), (0.5, between)

    def moment(self, gamma: ndarray, force: ndarray) -> ndarray:
        """C(γ) by recursion in γ/2, which begins with C(0) = 0.

        C(γ/2) is interpolated linearly between the points, including the new one.
        """
        (_, middle), (_, between) = self.arms(gamma)
        known, moments = [0.0], [0.0]
        moment = np.where(np.abs(gamma) <= _AT_REST, 0.0, np.nan)
        for i, angle in enumerate(gamma):
            last, half = known[-1], angle / 2
            if not (angle > max(last, _AT_REST) and np.isfinite(force[i])):
                continue
            arm, known_moment = middle[i], np.interp(half, known, moments)
            if half > last:  # between the last point and the new one
                new = (half - last) / (angle - last)
                arm, known_moment = arm + between[i] * new, (1 - new) * moments[-1]
            moment[i] = (force[i] - between[i] * known_moment) / arm
            known.append(angle)
            moments.append(moment[i])
        return moment


@dataclass(frozen=True)
class BiasTest(BiasExtension):
    """Simulated bias extension, as if the ply had no hole.

    Parameters
    ----------
    width, height, inclination
        See `BiasExtension`.
    share
        Computed fraction of the ply.
    """

    share: float = 1.0

    def measured(self, moved: ndarray, force: ndarray) -> tuple[ndarray, ndarray]:
        """Displacement and force of the machine in mm and N, along y.

        Parameters
        ----------
        moved, force
            Displacements of the driven edge in mm, and the forces on it in N, for each
            state from the undeformed one on, shape (n, 2).
        """
        return moved[:, 1], force[:, 1] / self.share


@dataclass(frozen=True)
class FrameTest(PictureFrame):
    """Simulated picture frame: the fabric is sheared over its whole square."""

    def measured(self, moved: ndarray, force: ndarray) -> tuple[ndarray, ndarray]:
        """Displacement and force of the machine in mm and N, along the diagonal.

        The top side has the force L C (cos γ, −sin γ), with the shear moment C per area
        and the side L of the fabric; the machine force is L²/L_frame C/sin(π/4 − γ/2).

        Parameters
        ----------
        moved, force
            See `BiasTest.measured`.
        """
        gamma = np.arctan2(moved[:, 0], self.fabric + moved[:, 1])
        along = force[:, 0] * np.cos(gamma) - force[:, 1] * np.sin(gamma)
        pull = self.fabric / self.frame * along / np.sin(np.pi / 4 - gamma / 2)
        return self.displacement(gamma), pull
