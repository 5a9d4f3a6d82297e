"""Time of fits to ten repeats of a bias extension."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from skfem_textile import Law
from skfem_textile.calibration import (
    BiasExtension,
    Choice,
    Simulation,
    fit_tests,
    read_specimens,
)
from skfem_textile.calibration.choice import AUTO, SHEAR_LAWS

from ..study import Row

# The test, its largest shear angle in degrees, number of repeats, rows of each, and
# range of their slacks in mm.
_TEST, _REACH = BiasExtension(100.0, 200.0), 42.0
_REPEATS, _ROWS, _SLACK = 10, (80, 240), (0.5, 4.0)

# Parameters of the known laws, and shear angles in degrees at which laws are compared.
_KNOWN = {"polynomial": (0.3, -0.3, 0.6), "locking": (0.1, 0.9)}
_ANGLES = np.arange(5.0, 40.0, 5.0)

# Element edges across the width of a simulated specimen.
_ACROSS = 12


@dataclass(frozen=True)
class Repeats:
    """Ten repeats of a known law in one file, read and fitted."""

    known: str
    fitted: str
    noise: float
    simulated: bool = False

    def __str__(self) -> str:
        by = "simulation" if self.simulated else "closed forms"
        return f"repeats: {self.known}, {self.fitted} by {by}, noise {self.noise:.0%}"

    def rows(self) -> list[Row]:
        """Time to read, prepare and fit the file, and the error of the law."""
        law = SHEAR_LAWS[self.known](1.0, 5, 0).build(np.array(_KNOWN[self.known]))
        simulation = Simulation(across=_ACROSS) if self.simulated else None
        with TemporaryDirectory() as folder:
            path = Path(folder) / "pulls.csv"
            path.write_text(self._written(law))
            start = perf_counter()
            specimens = read_specimens(path, _TEST)
            fit = fit_tests(specimens, Choice(self.fitted), simulation)
            seconds = perf_counter() - start
        gamma = np.radians(_ANGLES)
        error = np.abs(fit.laws["shear"].value(gamma) / law.value(gamma) - 1)
        return [
            {
                "known": self.known,
                "fitted": self.fitted,
                "chosen": fit.parts["shear"].model.name,
                "simulated": self.simulated,
                "noise": self.noise,
                "specimens": len(specimens),
                "seconds": seconds,
                "error": float(error.max()),
            }
        ]

    def _written(self, law: Law) -> str:
        """Content of the file: displacement and force, one repeat below the other."""
        rng = np.random.default_rng(7)
        lines = []
        for _ in range(_REPEATS):
            slack = rng.uniform(*_SLACK)
            end = slack + float(_TEST.displacement(np.radians(_REACH)))
            moved = np.linspace(0.0, end, int(rng.integers(*_ROWS)))
            force = _TEST.force(law, _TEST.shear_angle(np.maximum(moved - slack, 0.0)))
            force = force + self.noise * force.max() * rng.standard_normal(force.size)
            lines.append("displacement (mm),force (N)")
            lines += [f"{x:.4f},{y:.4f}" for x, y in zip(moved, force, strict=True)]
        return "\n".join(lines)


def repeats_cases() -> Sequence[Repeats]:
    """Closed forms at several noises, the choice of a law, and a simulation."""
    return [
        *(Repeats("polynomial", "polynomial", noise) for noise in (0.01, 0.03, 0.05)),
        Repeats("locking", "locking", 0.03),
        Repeats("polynomial", AUTO, 0.03),
        Repeats("polynomial", "polynomial", 0.03, simulated=True),
    ]
