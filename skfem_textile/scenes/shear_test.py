"""What machines of shear tests measure, and the shear force that it tells of."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy import ndarray

# Shares of the largest fall of the pull beyond which a bias test is none: rounding.
_ROUND_OFF = 1e-9


class Measured(NamedTuple):
    """The curve of a shear test, a row for each state; each of shape (n,).

    Attributes
    ----------
    displacement, force
        Of the machine, in mm and N.
    angle
        Shear angle in radians that the displacement means where no fibre stretches.
    normalised
        Shear force per length in N/mm that the force means then: the shear moment per
        area over cos γ.
    """

    displacement: ndarray
    force: ndarray
    angle: ndarray
    normalised: ndarray


class ShearTest(Protocol):
    """A test that shears a fabric."""

    def measured(self, moved: ndarray, force: ndarray) -> Measured:
        """What the machine measures.

        Parameters
        ----------
        moved, force
            Displacements of the driven edge in mm, and the forces on it in N, of each
            state from the undeformed one on, shape (n, 2).
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

    def measured(self, moved: ndarray, force: ndarray) -> Measured:
        """The pull along y.

        The shear angle is γ = 2 (asin(sin θ + δ/(2L)) − θ), and the shear moment that
        of `bias_extension.force`, of which γ/2 is looked up on the curve itself
        (Cao et al., Composites A 39, 2008, 1037–1053, Eq. 16, at θ = 45°).
        """
        theta, W, H = self.inclination, self.width, self.height
        L = (H / np.sin(theta) - W / np.cos(theta)) / 2
        pulled, F = moved[:, 1], force[:, 1] / self.share
        with np.errstate(invalid="ignore"):  # of a ply pulled further than it goes
            gamma = 2 * (np.arcsin(np.sin(theta) + pulled / (2 * L)) - theta)
        work = F * L * np.cos(theta + gamma / 2)
        whole = W * (H - 1.5 * W * np.tan(theta))
        half = 0.5 * W**2 * np.tan(theta)
        moment = _with_half(gamma, work, whole, half)
        return Measured(pulled, F, gamma, moment / np.cos(gamma))


@dataclass(frozen=True)
class FrameTest:
    """A square in a hinged frame, two opposite corners of which are pulled apart.

    Parameters
    ----------
    side
        Length L of the frame in mm.
    """

    side: float

    def measured(self, moved: ndarray, force: ndarray) -> Measured:
        """The pull along the diagonal.

        The top bar has the force L C (cos γ, −sin γ), with the shear moment C per area;
        the machine pulls by L C/sin(π/4 − γ/2), and the corners move apart by
        2 L (cos(π/4 − γ/2) − cos(π/4)).
        """
        L = self.side
        gamma = np.arctan2(moved[:, 0], L + moved[:, 1])
        along = force[:, 0] * np.cos(gamma) - force[:, 1] * np.sin(gamma)
        half = np.pi / 4 - gamma / 2
        apart = 2 * L * (np.cos(half) - np.sqrt(0.5))
        return Measured(apart, along / np.sin(half), gamma, along / L / np.cos(gamma))


def _with_half(gamma: ndarray, work: ndarray, whole: float, half: float) -> ndarray:
    """The C of whole C(γ) + half C(γ/2) = work, straight between the states.

    C is zero at rest.  NaN where the angles do not rise.
    """
    known, moment = [0.0], [0.0]
    found = np.full(gamma.shape, np.nan)
    for i, (angle, W) in enumerate(zip(gamma, work, strict=True)):
        if abs(angle) <= _ROUND_OFF:
            found[i] = 0.0
            continue
        last = known[-1]
        if not angle > last:
            break
        if angle / 2 <= last:
            C = (W - half * np.interp(angle / 2, known, moment)) / whole
        else:  # between the state before and this one
            share = (angle / 2 - last) / (angle - last)
            C = (W - half * (1 - share) * moment[-1]) / (whole + half * share)
        known.append(angle)
        moment.append(C)
        found[i] = C
    return found
