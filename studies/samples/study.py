"""Coverage of the band of samples by repeated synthetic tests.

A trial draws the laws of some specimens from a population, fits their bias extensions
with noise, draws 20 samples, and predicts the load of a part. Further specimens of the
population are the repeated tests. ``--seed N`` draws other trials.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy import ndarray

from skfem_textile import Fabric, Law, Locking, Polynomial
from skfem_textile.calibration import BiasExtension, Choice, Specimen, fit_tests
from skfem_textile.fabric.scatter import sampled, sampled_laws
from skfem_textile.scenes import Case, bias_extension, run_samples
from skfem_textile.scenes.samples import CONFIDENCE, band_of

from ..common.tables import grouped, having, markdown_table, percent
from ..study import Part, Row, Study
from .part import PartRun, draw, figures

# Number of samples of a trial, and of repeated tests.
_SAMPLES, _TESTS = 20, 10

# Numbers of trials with the closed form of the part, and with its simulation.
_TRIALS, _SIMULATED = 300, 40

# Numbers of specimens of a fit.
_SPECIMENS = 3, 5, 9

# Noise of a force, relative to the largest one; angles of the points in radians.
_NOISE, _ANGLES = 0.02, np.radians(np.linspace(1.0, 40.0, 40))

# Specimen of the fit, and the part, in mm; shear angle of the part in radians.
_TEST, _PART, _LARGEST = (
    BiasExtension(100.0, 200.0),
    BiasExtension(50.0, 120.0),
    float(np.radians(38.0)),
)

# Stiffness of the fibres of a simulated part in N/mm.
_FIBRES = 2000.0

# Seed of the published results.
_SEED = 1


def _log_normal(rng: np.random.Generator) -> Law:
    """Parameters with a correlated log-normal scatter of 25 % and 35 %."""
    common, own = rng.standard_normal(2)
    low, high = 0.25 * common, 0.35 * (0.8 * common + 0.6 * own)
    return Polynomial((0.03 * np.exp(low), 0.0, 0.0, 0.0, 0.15 * np.exp(high)))


def _normal(rng: np.random.Generator) -> Law:
    """A locking law with a normal scatter of 15 % and 1.5°."""
    stiffness, angle = rng.standard_normal(2)
    return Locking(0.03 * (1 + 0.15 * stiffness), np.radians(65.0 + 1.5 * angle))


def _two_batches(rng: np.random.Generator) -> Law:
    """Two batches, of which one is half as stiff as the other, with 10 % each."""
    stiffness = 0.03 * rng.choice([1.0, 0.5]) * np.exp(0.1 * rng.standard_normal())
    return Polynomial((stiffness, 0.0, 2 * stiffness))


#: Populations of specimens; the first one is of the kind that samples assume.
POPULATIONS: dict[str, Callable[[np.random.Generator], Law]] = {
    "log-normal": _log_normal,
    "normal, another law": _normal,
    "two batches": _two_batches,
}


@dataclass(frozen=True)
class Trials:
    """Trials with a number of specimens of a population.

    Attributes
    ----------
    population
        Name of the population.
    specimens
        Number of specimens of a fit.
    seed
        Seed of the first trial.
    simulated
        True if the part is simulated; otherwise its load has a closed form.
    """

    population: str
    specimens: int
    seed: int
    simulated: bool = False

    def __str__(self) -> str:
        part = " simulated" * self.simulated
        return f"{self.population}, {self.specimens} specimens{part}"

    def rows(self) -> list[Row]:
        """Number of repeated tests within the band of each trial."""
        number = _SIMULATED if self.simulated else _TRIALS
        kind = [*POPULATIONS].index(self.population)
        rows = []
        for trial in range(number):
            rng = np.random.default_rng((self.seed, kind, self.specimens, trial))
            low, high, loads = self._trial(rng, trial)
            inside = int(np.sum((low <= loads) & (loads <= high)))
            rows.append(
                {
                    "population": self.population,
                    "specimens": self.specimens,
                    "part": "simulated" if self.simulated else "closed form",
                    "trial": trial,
                    "inside": inside,
                    "width": float(np.log(high / low)),
                }
            )
        return rows

    def _trial(
        self, rng: np.random.Generator, seed: int
    ) -> tuple[float, float, ndarray]:
        """Band of the load of the part, and loads of the repeated tests."""
        law_of = POPULATIONS[self.population]
        tests = [_measured(f"{i}", law_of(rng), rng) for i in range(self.specimens)]
        origin = fit_tests(tests, Choice("polynomial")).origin()
        repeated = [law_of(rng) for _ in range(_TESTS)]
        if not self.simulated:
            laws = [one["shear"] for one in sampled_laws(origin, _SAMPLES, seed)]
            loads = np.array([_closed_form(law) for law in repeated])
            return *band_of(np.array([_closed_form(law) for law in laws])), loads
        case = _case()
        fabrics = sampled(case.fabric, origin, _SAMPLES, seed)
        low, high = run_samples(case, fabrics).bands["load_N"]
        further = [replace(case.fabric, shear=law) for law in repeated]
        return low, high, run_samples(case, further).figures["load_N"]


def _measured(name: str, law: Law, rng: np.random.Generator) -> Specimen:
    """Bias extension with noise."""
    force = _TEST.force(law, _ANGLES)
    force += _NOISE * force.max() * rng.standard_normal(force.size)
    return Specimen(name, _TEST, force, displacement=_TEST.displacement(_ANGLES))


def _closed_form(law: Law) -> float:
    """Load of the part in N, for inextensible fibres."""
    return float(_PART.force(law, np.array([_LARGEST]))[0])


def _case() -> Case:
    """The part on a coarse mesh."""
    scene = bias_extension(
        "irregular",
        size=(2, 5),
        width=_PART.width,
        height=_PART.height,
        shear_angle=_LARGEST,
    )
    fabric = Fabric(_FIBRES, 0.03, scene.warp, scene.weft)
    return Case(scene=scene, fabric=fabric, steps=3)


def coverage(rows: list[Row]) -> str:
    """Share of the repeated tests within the bands, by population and specimens."""
    lines = []
    for group, own in grouped(rows, "population", "specimens", "part").items():
        width = np.exp(np.median([row["width"] for row in own]))
        share, error = _share(own)
        lines.append(
            [
                *group,
                len(own) * _TESTS,
                f"{percent(share, '.1f')} ± {percent(error, '.1f')}",
                f"{width:.2g}",
            ]
        )
    head = "population", "specimens", "part", "tests", "inside", "highest / lowest"
    return markdown_table(head, lines)


def _share(rows: Sequence[Row]) -> tuple[float, float]:
    """Share of tests inside, and its standard error: trials are independent."""
    each = np.array([row["inside"] for row in rows]) / _TESTS
    return float(each.mean()), float(each.std(ddof=1) / np.sqrt(each.size))


class Coverage(Study[Trials | PartRun]):
    """Coverage of bands of samples."""

    parts = (
        Part("coverage.csv", {"coverage.md": coverage}, cases=("*specimens*",)),
        Part("part.csv", {"part.md": figures}, {"samples.png": draw}, ("part",)),
    )
    sample = "part"

    def add_options(self, parser: argparse.ArgumentParser) -> None:
        text = "seed of the trials"
        parser.add_argument("--seed", type=int, default=_SEED, help=text)

    def cases(self, options: argparse.Namespace) -> Sequence[Trials | PartRun]:
        seed = getattr(options, "seed", _SEED)
        closed = [Trials(p, m, seed) for p in POPULATIONS for m in _SPECIMENS]
        return [*closed, Trials("log-normal", 5, seed, simulated=True), PartRun()]

    def line(self, rows: list[Row]) -> str:
        if "inside" not in rows[0]:
            return f"{rows[0]['case']}: {len(having(rows, of='figure'))} figures"
        share, error = _share(rows)
        return f"{rows[0]['case']}: {percent(share, '.1f')} ± {percent(error, '.1f')}"

    def complaint(self, rows: list[Row]) -> str:
        assumed = having(rows, population="log-normal")
        share = _share(assumed)[0] if assumed else 1.0
        if share >= CONFIDENCE:
            return ""
        return f"only {percent(share, '.1f')} of the repeated tests are within the band"


STUDY = Coverage()
