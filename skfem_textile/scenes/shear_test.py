"""What machines of shear tests measure, and the shear force that it tells of."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy import ndarray

from .zones import free_length

# Angle in radians up to which a ply is at rest: rounding.
_ROUND_OFF = 1e-9


class ShearTest(Protocol):
    """A test that shears a fabric, in the terms of its machine."""

    def measured(self, moved: ndarray, force: ndarray) -> tuple[ndarray, ndarray]:
        """Displacement and force of the machine in mm and N, each of shape (n,).

        Parameters
        ----------
        moved, force
            Displacements of the driven edge in mm, and the forces on it in N, of each
            state from the undeformed one on, shape (n, 2).
        """
        ...

    def angle(self, displacement: ndarray) -> ndarray:
        """Shear angle in radians that a displacement means if no fibre stretches.

        NaN beyond what such fibres reach.
        """
        ...

    def normalised(self, angle: ndarray, force: ndarray) -> ndarray:
        """Shear force per length in N/mm: the shear moment per area over cos γ.

        Parameters
        ----------
        angle
            Shear angles in radians, from zero on.
        force
            Forces of the machine in N.
        """
        ...


@dataclass(frozen=True)
class BiasTest:
    """A rectangle pulled along the bisector of its fibres, as if it had no hole.

    Parameters
    ----------
    inclination
        Angle θ in radians between warp and clamps.
    width, height
        Sides W and H of the ply in mm, H ≥ 2W tan θ.
    share
        Share of the ply that is computed.
    """

    inclination: float
    width: float
    height: float
    share: float = 1.0

    def measured(self, moved: ndarray, force: ndarray) -> tuple[ndarray, ndarray]:
        """The pull along y, of the whole ply."""
        return moved[:, 1], force[:, 1] / self.share

    def angle(self, displacement: ndarray) -> ndarray:
        """γ = 2 (asin(sin θ + δ/(2L)) − θ)."""
        theta = self.inclination
        with np.errstate(invalid="ignore"):
            turned = np.arcsin(np.sin(theta) + displacement / (2 * self._free_length))
        return 2 * (turned - theta)

    def normalised(self, angle: ndarray, force: ndarray) -> ndarray:
        """From the force of `bias_extension.force`: γ/2 is looked up on the curve.

        At θ = 45° that is Eq. 16 of Cao et al., Composites A 39 (2008) 1037–1053.
        """
        theta, W, H = self.inclination, self.width, self.height
        work = force * self._free_length * np.cos(theta + angle / 2)
        whole = W * (H - 1.5 * W * np.tan(theta))
        half = 0.5 * W**2 * np.tan(theta)
        return _with_half(angle, work, whole, half) / np.cos(angle)

    @property
    def _free_length(self) -> float:
        return free_length(self.width, self.height, self.inclination)


@dataclass(frozen=True)
class FrameTest:
    """A square in a hinged frame, two opposite corners of which are pulled apart.

    Parameters
    ----------
    side
        Length L of the frame in mm.
    """

    side: float

    def measured(self, moved: ndarray, force: ndarray) -> tuple[ndarray, ndarray]:
        """The pull along the diagonal.

        The top bar has the force L C (cos γ, −sin γ), with the shear moment C per area;
        the machine pulls by L C/sin(π/4 − γ/2), and the corners move apart by
        2 L (cos(π/4 − γ/2) − cos(π/4)).
        """
        L = self.side
        gamma = np.arctan2(moved[:, 0], L + moved[:, 1])
        along = force[:, 0] * np.cos(gamma) - force[:, 1] * np.sin(gamma)
        half = np.pi / 4 - gamma / 2
        return 2 * L * (np.cos(half) - np.sqrt(0.5)), along / np.sin(half)

    def angle(self, displacement: ndarray) -> ndarray:
        """γ = π/2 − 2 acos(1/√2 + δ/(2L))."""
        with np.errstate(invalid="ignore"):
            half = np.arccos(np.sqrt(0.5) + displacement / (2 * self.side))
        return np.pi / 2 - 2 * half

    def normalised(self, angle: ndarray, force: ndarray) -> ndarray:
        """F sin(π/4 − γ/2)/(L cos γ)."""
        return force * np.sin(np.pi / 4 - angle / 2) / (self.side * np.cos(angle))


def _with_half(gamma: ndarray, work: ndarray, whole: float, half: float) -> ndarray:
    """The C of whole C(γ) + half C(γ/2) = work, straight between the states.

    C is zero at rest.  NaN where an angle is not above all before.
    """
    known, moment = [0.0], [0.0]
    found = np.full(gamma.shape, np.nan)
    for i, (angle, W) in enumerate(zip(gamma, work, strict=True)):
        if abs(angle) <= _ROUND_OFF:
            found[i] = 0.0
            continue
        last = known[-1]
        if not (angle > last and np.isfinite(W)):
            continue
        if angle / 2 <= last:
            C = (W - half * np.interp(angle / 2, known, moment)) / whole
        else:  # between the state before and this one
            share = (angle / 2 - last) / (angle - last)
            C = (W - half * (1 - share) * moment[-1]) / (whole + half * share)
        known.append(angle)
        moment.append(C)
        found[i] = C
    return found
