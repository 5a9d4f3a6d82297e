"""Bias extensions of the plain weave at two temperatures and two speeds."""

from dataclasses import dataclass

import numpy as np

from ..common.tables import Row
from .published import BIAS, curves

#: Shear angles in degrees at which forces are compared.
ANGLES = 10, 20, 30, 40


@dataclass(frozen=True)
class Temperature:
    """Forces of the specimens of one laboratory, point by point."""

    def __str__(self) -> str:
        return "temperature: HKUST"

    def rows(self) -> list[Row]:
        """Force of each specimen at the angles of an inextensible net."""
        found: list[Row] = []
        for angle in ANGLES:
            row: Row = {"test": BIAS, "angle": angle}
            for curve in curves("40"):
                moved = float(curve.test.displacement(np.radians(angle)))
                name = "_".join(curve.name.split()[2:]).replace("/", "_per_")
                known = moved <= curve.x[-1]
                row[name] = float(np.interp(moved, curve.x, curve.y)) if known else None
            found.append(row)
        return found
