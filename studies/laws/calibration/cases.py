"""Known laws, specimens with noise, and the cases of the study."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy import ndarray

from skfem_textile.calibration import BiasExtension, PictureFrame, ShearTest, Specimen
from skfem_textile.calibration.regression import Model
from skfem_textile.calibration.shear import SHEAR_LAWS

#: Noise of forces over the largest, and points of a curve.
NOISE, POINTS = 0.02, 60

#: Shear angle in degrees up to which the kinematics hold, and of inverse fits.
HOLD, BEYOND = 40.0, 50.0

#: Angles in degrees at which laws and loads are compared.
ANGLES = (10, 20, 30, 40)

#: Parameters of known laws.  The polynomial softens up to 20 degrees and is twice as
#: stiff at 40 degrees as at rest.
KNOWN: dict[str, tuple[float, ...]] = {
    "polynomial": (0.3, -0.3, 0.6),
    "linear": (0.1,),
    "sin2": (0.1,),
    "locking": (0.05, 1.0),
    "tabulated": (0.010, 0.020, 0.030, 0.042, 0.060, 0.095),
}

#: Seeds of fits by closed forms.
SEEDS = 1000

#: Seeds of inverse fits by their element edges across.  Data come from simulations with
#: twice as many.
INVERSE_SEEDS = {12: range(1, 11), 24: range(1, 4)}

#: Fibre stiffness in N/mm of inverse fits: E/G is 2e5 at 40 degrees.
SOFT = 1e5

#: Fibre stiffness of comparisons with the closed form: E/G is 2e6 at 40 degrees.
STIFF = 1.2e6

#: Sizes in mm of the benchmark's specimens, and C in N·mm/mm² at `ANGLES`.
BENCHMARK: dict[tuple[float, float], tuple[float, ...]] = {
    (115.0, 230.0): (0.0051, 0.0093, 0.0117, 0.0145),
    (150.0, 450.0): (0.0061, 0.0074, 0.0130, 0.0196),
}


def bias(degrees: float, width: float = 100.0, over: float = 1.0) -> BiasExtension:
    """A strip whose fibres are at an angle, higher than it must be by a factor."""
    theta = float(np.radians(degrees))
    return BiasExtension(width, 2 * over * width * float(np.tan(theta)), theta)


#: Three specimens of each test.
TESTS: dict[str, tuple[ShearTest, ...]] = {
    "bias 45°": (bias(45, 115), bias(45, 150, 1.5), bias(45, 100)),
    "bias 35°": (bias(35, 115), bias(35, 150, 1.5), bias(35, 100)),
    "bias 55°": (bias(55, 115), bias(55, 150, 1.5), bias(55, 100)),
    "frame": (PictureFrame(200.0, 160.0),) * 3,
}


def known(law: str) -> tuple[Model, ndarray]:
    """A kind of law, and its parameters."""
    values = np.array(KNOWN[law])
    return SHEAR_LAWS[law](np.radians(HOLD), 5, values.size), values


def specimens(
    tests: Sequence[ShearTest],
    moved: Sequence[ndarray],
    forces: Sequence[ndarray],
    seed: int,
    noise: float,
) -> list[Specimen]:
    """Specimens whose forces at displacements have noise."""
    rng, found = np.random.default_rng(seed), []
    for i, test in enumerate(tests):
        own = noise * forces[i].max() * rng.standard_normal(forces[i].size)
        name = f"specimen {i + 1}"
        found.append(Specimen(name, test, forces[i] + own, moved[i]))
    return found


def steps(test: ShearTest, n: int = POINTS, degrees: float = HOLD) -> ndarray:
    """Equal steps of the displacement up to a theoretical shear angle."""
    end = test.displacement(np.radians(degrees))
    return np.linspace(0.0, float(end), n + 1)[1:]


@dataclass(frozen=True)
class Coverage:
    """Fits of a known law to three specimens with noise, with many seeds."""

    test: str
    law: str
    seeds: int = SEEDS

    @property
    def name(self) -> str:
        """What to call it."""
        return f"coverage: {self.test}, {self.law}"


@dataclass(frozen=True)
class Inverse:
    """An inverse fit to three specimens of a simulated fabric."""

    across: int
    seed: int

    @property
    def name(self) -> str:
        """What to call it."""
        return f"inverse: {self.across} across, seed {self.seed}"


@dataclass(frozen=True)
class Agreement:
    """A law from a picture frame and from a bias extension, both simulated."""

    name: str = "agreement"


@dataclass(frozen=True)
class RoundTrip:
    """Data of a known law, the law that is found, and its simulation."""

    degrees: float

    @property
    def name(self) -> str:
        """What to call it."""
        return f"round trip: {self.degrees:g}°"


@dataclass(frozen=True)
class Benchmark:
    """A copy of the benchmark's curves in a folder."""

    width: float
    height: float
    folder: Path = field(compare=False)

    @property
    def name(self) -> str:
        """What to call it."""
        return f"benchmark: {self.width:g}x{self.height:g}"

    @cached_property
    def file(self) -> Path:
        """The file of the curve."""
        return self.folder / f"glass_plain_{self.width:g}_{self.height:g}.csv"


Case = Coverage | Inverse | Agreement | RoundTrip | Benchmark


def all_cases(benchmark: Path | None) -> list[Case]:
    """Every case; those of the benchmark where a folder has its curves.

    Raises
    ------
    FileNotFoundError
        If the folder lacks a curve.
    """
    found: list[Case] = [
        *(Coverage(test, "polynomial") for test in TESTS),
        *(Coverage("bias 45°", law) for law in KNOWN if law != "polynomial"),
        *(Inverse(n, seed) for n, seeds in INVERSE_SEEDS.items() for seed in seeds),
        Agreement(),
        *(RoundTrip(degrees) for degrees in (35.0, 45.0, 55.0)),
    ]
    if benchmark is not None:
        curves = [Benchmark(*sides, benchmark) for sides in BENCHMARK]
        for curve in curves:
            if not curve.file.is_file():
                raise FileNotFoundError(f"there is no {curve.file}")
        found += curves
    return found
