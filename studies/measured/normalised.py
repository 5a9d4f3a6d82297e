"""Shear forces of bias extensions as published, against their formula."""

from dataclasses import dataclass

import numpy as np

from ..common.tables import Row
from .published import BIAS, FABRICS, curves

#: Shear angles in degrees at which the factors are compared.
ANGLES = tuple(range(5, 50, 5))


@dataclass(frozen=True)
class Normalised:
    """Published shear forces of a fabric against the published forces.

    Eq. 18 of Cao et al. (2008) is F_sh(γ) cos γ (2H − 3W) = (H/W − 1) (cos γ/2 − sin
    γ/2) F − W F_sh(γ/2) cos γ/2.  The last term is not negative, so that k = F_sh cos γ
    (2H − 3W)/((H/W − 1) F) is at most cos γ/2 − sin γ/2.
    """

    fabric: str

    def __str__(self) -> str:
        return f"normalised: {self.fabric}"

    def rows(self) -> list[Row]:
        """The factor k of each specimen, and its limit."""
        _, forces, shear_forces = FABRICS[self.fabric]
        published = {curve.name: curve for curve in curves(shear_forces)}
        found: list[Row] = []
        for curve in curves(forces):
            test, other = curve.test, published[curve.name]
            W, H = test.width, test.height  # type: ignore[attr-defined]
            for angle in ANGLES:
                gamma = np.radians(angle)
                moved = float(test.displacement(gamma))
                if moved > curve.x[-1] or angle > other.x[-1]:
                    continue
                F = np.interp(moved, curve.x, curve.y)
                F_sh = np.interp(angle, other.x, other.y)
                k = F_sh * np.cos(gamma) * (2 * H - 3 * W) / ((H / W - 1) * F)
                limit = np.cos(gamma / 2) - np.sin(gamma / 2)
                found.append(
                    {
                        "fabric": self.fabric,
                        "test": BIAS,
                        "name": curve.name,
                        "angle": angle,
                        "force": float(F),
                        "shear_force": float(F_sh),
                        "factor": float(k),
                        "limit": float(limit),
                    }
                )
        return found


def normalised_cases() -> list[Normalised]:
    """One case for each fabric."""
    return [*map(Normalised, FABRICS)]
