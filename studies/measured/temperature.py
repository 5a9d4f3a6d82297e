"""Bias extensions of the plain weave at two temperatures and speeds, and Fig. 38."""

from dataclasses import dataclass

import numpy as np

from ..common.tables import Row
from .published import BIAS, FABRICS, Curve, curves

#: Shear angles in degrees at which forces are compared.
ANGLES = 10, 20, 30, 40

#: The specimen of the same laboratory and size in Fig. 38.
SAME = "115x230 HKUST"


@dataclass(frozen=True)
class Temperature:
    """Forces of the specimens of one laboratory, point by point."""

    def __str__(self) -> str:
        return "temperature: HKUST"

    def rows(self) -> list[Row]:
        """Force of each specimen at the angles of an inextensible net."""
        found: list[Row] = []
        (same,) = (x for x in curves(FABRICS["plain"][1]) if x.name == SAME)
        for angle in ANGLES:
            row: Row = {"test": BIAS, "angle": angle}
            for curve in curves("40"):
                name = "_".join(curve.name.split()[2:]).replace("/", "_per_")
                row[name] = _force(curve, angle)
            found.append({**row, "fig_38": _force(same, angle)})
        return found


def _force(curve: Curve, angle: float) -> float | None:
    """Force in N at an angle in degrees; None beyond the curve."""
    moved = float(curve.test.displacement(np.radians(angle)))
    known = moved <= curve.x[-1]
    return float(np.interp(moved, curve.x, curve.y)) if known else None
