"""Laws of real fabrics: of tension, whose slope is about E at 1 %, and of shear."""

from collections.abc import Callable, Mapping

import numpy as np

from skfem_textile.fabric import (
    Asymmetric,
    BiaxialLaw,
    CrimpInterchange,
    CrimpToe,
    Law,
    Linear,
    Locking,
    Polynomial,
    Pretensioned,
    Sin2,
    Tabulated,
    TensionOnly,
)

# Strain within which crimped fibres straighten, and pretension as a share of E.
_TOE, _PRETENSION = 0.004, 1e-3

# Points of a table of tension: strains, and tensions over the stiffness at its end.
_STRAINS = -0.1, -0.05, 0.0, 0.002, 0.005, 0.01, 0.03
_TENSIONS = -1e-4, -5e-5, 0.0, 1e-4, 1e-3, 5e-3, 2.5e-2

# Points of a table of shear: degrees, and moments in N/mm, a hundredfold from 30 to 55.
_DEGREES = 0, 10, 20, 30, 40, 50, 55, 65
_MOMENTS = 0.0, 0.02, 0.04, 0.1, 0.6, 4.0, 10.0, 30.0


def _crimp_toe(initial_stiffness: float) -> Callable[[float], Law]:
    return lambda E: CrimpToe(E, _TOE, initial_stiffness)


#: Laws of tension by their names, each a function of the stiffness E in N/mm.
TENSIONS: Mapping[str, Callable[[float], Law | BiaxialLaw]] = {
    "crimp toe, k = 1": _crimp_toe(1.0),
    "crimp toe, k = 10": _crimp_toe(10.0),
    "crimp toe, k = 1000": _crimp_toe(1000.0),
    "tension only": lambda E: TensionOnly(Linear(E)),
    "asymmetric": lambda E: Asymmetric(Linear(E), Linear(1e-3 * E)),
    "pretensioned": lambda E: Pretensioned(TensionOnly(Linear(E)), _PRETENSION * E),
    "interchange": lambda E: CrimpInterchange(E, (0.01, 0.003), 1e-4 * E, 1e-3, 1.0),
    "table": lambda E: Tabulated(_STRAINS, E * np.array(_TENSIONS)),
    "polynomial": lambda E: Polynomial((0.01 * E, 0.0, 3e3 * E)),
}

#: Laws of shear by their names.
SHEARS: Mapping[str, Law] = {
    "locking": Locking(0.5, np.radians(65)),
    "shear table": Tabulated(np.radians(_DEGREES), _MOMENTS, odd=True),
    "sin²": Sin2(0.5),
    "shear polynomial": Polynomial((0.2, -0.4, 0.9), odd=True),
}
