"""Converged load of the bias extension at the stiffnesses of the study.

Two formulations on meshes along the fibres, whose cells are halved three times.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skfem_textile.ply.formulations import Full, Quadratic
from skfem_textile.ply.terms import Formulation

from ..angles.cases import Reference as AlignedPly
from ..angles.cases import Specimen
from ..angles.runs import stepper
from ..study import Row

#: The ply: 45°, linear law, E/G = 2·10⁵; its last load step ends at 40°.
SPECIMEN = Specimen(45.0, "linear", 2e5)

#: Formulations, and cells along a side of a rhombus.
FORMULATIONS: dict[str, Formulation] = {"Quadratic()": Quadratic(), "Full()": Full()}
CELLS = (8, 16, 32, 64)

#: What rows of the reference have as their code.
CODE = "reference"


@dataclass(frozen=True)
class Reference:
    """A formulation on a mesh along the fibres with so many cells."""

    element: str
    cells: int

    @property
    def name(self) -> str:
        """What to call it."""
        return f"reference, {self.element}, {self.cells} cells"

    def computed(self) -> Row:
        """The load in N, and the load of inextensible fibres."""
        scene = SPECIMEN.scene(AlignedPly(SPECIMEN).mesh(self.cells))
        result = stepper(scene, SPECIMEN, FORMULATIONS[self.element]).run()
        assert scene.load is not None
        return {
            "scene": "bias_extension",
            "code": CODE,
            "element": self.element,
            "across": self.cells,
            "elements": scene.mesh.nelements,
            "unknowns": result.ply.basis.N,
            "load": float(scene.reaction(result.states[-1])[1]),
            "inextensible": float(scene.load(SPECIMEN.shear_law, 1.0)),
        }


class Load(NamedTuple):
    """A load in N, its uncertainty in N, and the load of inextensible fibres in N."""

    load: float
    uncertainty: float
    inextensible: float


def converged(rows: Sequence[Row]) -> Load | None:
    """The converged load; None unless every mesh of both formulations has a row.

    The mean of the extrapolated loads of both formulations.  Its uncertainty is the
    largest of their difference and of the changes when cells were halved last.
    """
    known = {
        (row["element"], row["across"]): row for row in rows if row["code"] == CODE
    }
    if len(known) < len(FORMULATIONS) * len(CELLS):
        return None
    loads = {e: [known[e, n]["load"] for n in CELLS] for e in FORMULATIONS}
    ends = [extrapolated(series) for series in loads.values()]
    changes = [abs(series[-1] - series[-2]) for series in loads.values()]
    uncertainty = max(np.ptp(ends), *changes)
    inextensible = next(iter(known.values()))["inextensible"]
    return Load(float(np.mean(ends)), float(uncertainty), inextensible)


def extrapolated(series: Sequence[float]) -> float:
    """Richardson's extrapolation by the order of the last two changes.

    The last value where these do not have the same sign and do not become smaller.

    Examples
    --------
    >>> extrapolated([5.0, 2.0, 1.25, 1.0625])
    1.0
    >>> extrapolated([2.0, 1.0, 1.5])
    1.5
    """
    before, last = np.diff(series[-3:])
    if last == 0 or before / last <= 1:
        return series[-1]
    return float(series[-1] + last / (before / last - 1))
