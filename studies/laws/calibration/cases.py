"""Known laws, specimens with noise, and the calibration cases."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from numpy import ndarray
from scipy.interpolate import CubicSpline

from skfem_textile import (
    Fabric,
    Full,
    LoadStepper,
    Ply,
    Quadratic,
    ToleranceStepper,
)
from skfem_textile.calibration import (
    BiasExtension,
    Choice,
    FabricFit,
    Format,
    PictureFrame,
    Preparation,
    ShearTest,
    Simulation,
    Specimen,
    fit_tests,
    read_specimens,
)
from skfem_textile.calibration.choice import SHEAR_LAWS
from skfem_textile.calibration.models import Model
from skfem_textile.fabric import Law
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, bias_extension, picture_frame
from skfem_textile.scenes.bias_extension import WIDTH
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.scenes.trellis import SIDE

from ...angles.cases import graded_mesh
from ...common.running import errors_only, run
from ...common.tables import Row

#: Noise relative to the largest force, and points of a curve.
NOISE, POINTS = 0.02, 60

#: Shear angle in degrees up to which the kinematics hold, and for inverse fits.
HOLD, BEYOND = 40.0, 50.0
_HELD = np.radians(HOLD)

#: Angles in degrees at which laws and loads are compared.
ANGLES = (10, 20, 30, 40)

#: Parameters of known laws.  The polynomial softens up to 20 degrees; its stiffness at
#: 40 degrees is twice the initial one.
KNOWN: dict[str, tuple[float, ...]] = {
    "polynomial": (0.3, -0.3, 0.6),
    "linear": (0.1,),
    "sin2": (0.1,),
    "locking": (0.05, 1.0),
    "tabulated": (0.010, 0.020, 0.030, 0.042, 0.060, 0.095),
}

#: Number of seeds of closed-form fits.
SEEDS = 1000

#: Seeds of inverse fits by element edges across.  The data come from simulations with
#: twice as many edges.
INVERSE_SEEDS = {12: range(1, 11), 24: range(1, 4)}

#: Fibre stiffness in N/mm for inverse fits: E/G is 2e5 at 40 degrees.
SOFT = 1e5

#: Fibre stiffness for comparisons with the closed form: E/G is 2e6 at 40 degrees.
STIFF = 1.2e6

#: Sizes in mm of the benchmark specimens, and C in N·mm/mm² at `ANGLES`.
BENCHMARK: dict[tuple[float, float], tuple[float, ...]] = {
    (115.0, 230.0): (0.0051, 0.0093, 0.0117, 0.0145),
    (150.0, 450.0): (0.0061, 0.0074, 0.0130, 0.0196),
}

#: Ranges of the normalised shear force in N/mm at `ANGLES`, read from the lines of
#: figures of Cao et al. (2008): all curves of plain weave.
PUBLISHED: dict[str, tuple[tuple[float, float], ...]] = {
    "bias extensions, Fig. 39": (
        *((0.009, 0.019), (0.016, 0.036)),
        *((0.029, 0.078), (0.055, 0.158)),
    ),
    "picture frames, Fig. 28": (
        *((0.000, 0.033), (0.005, 0.044)),
        *((0.027, 0.065), (0.059, 0.136)),
    ),
}

# 97.5 % quantile of the normal distribution, for two-sided 95 % bands.
_TWO_SIDED = 1.959963984540054

# Load tolerance and load steps of simulations on nets.
_TOLERANCE, _STEPS = 0.02, 4

# Load steps of other simulations.
_FINE_STEPS = 20

# Cells along a rhombus side of the fibre-aligned mesh.
_CELLS = 16

# Jitter of meshes.
_JITTER = 0.25


def bias(degrees: float, width: float = 100.0, over: float = 1.0) -> BiasExtension:
    """A strip with inclined fibres; ``over`` scales the minimum height."""
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
    """The model of a law, and its parameters."""
    values = np.array(KNOWN[law])
    return SHEAR_LAWS[law](np.radians(HOLD), 5, values.size), values


def specimens(
    tests: Sequence[ShearTest],
    moved: Sequence[ndarray],
    forces: Sequence[ndarray],
    seed: int,
    noise: float,
) -> list[Specimen]:
    """Specimens with noise added to their forces."""
    rng, specimens_of_test = np.random.default_rng(seed), []
    for i, test in enumerate(tests):
        error = noise * forces[i].max() * rng.standard_normal(forces[i].size)
        name = f"specimen {i + 1}"
        specimens_of_test.append(Specimen(name, test, forces[i] + error, moved[i]))
    return specimens_of_test


def steps(test: ShearTest, n: int = POINTS, degrees: float = HOLD) -> ndarray:
    """Equal steps of the displacement up to a theoretical shear angle."""
    end = test.displacement(np.radians(degrees))
    return np.linspace(0.0, float(end), n + 1)[1:]


def _curves(
    tests: Sequence[ShearTest], law: Law
) -> tuple[list[ndarray], list[ndarray]]:
    """Displacements of each test, and the corresponding forces of a law."""
    moved = [steps(test) for test in tests]
    return moved, [
        test.force(law, test.shear_angle(displacement))
        for test, displacement in zip(tests, moved, strict=True)
    ]


@dataclass(frozen=True)
class Coverage:
    """Fits of a known law to three specimens with noise, for many seeds."""

    test: str
    law: str
    seeds: int = SEEDS

    def __str__(self) -> str:
        return f"coverage: {self.test}, {self.law}"

    def rows(self) -> list[Row]:
        """Coverage and width of the confidence band of each parameter."""
        tests, (model, truth) = TESTS[self.test], known(self.law)
        law = model.build(truth)
        moved, forces = _curves(tests, law)
        inside, widths = [], []
        for seed in range(self.seeds):
            data = specimens(tests, moved, forces, seed, NOISE)
            choice = Choice(self.law, points=truth.size)
            fit = fit_tests(data, choice).parts["shear"]
            low, high = fit.intervals.T
            inside.append((low <= truth) & (truth <= high))
            widths.append(high - low)
        least = 2 * _TWO_SIDED * self.cramer_rao(forces)
        columns = np.mean(inside, axis=0), np.median(widths, axis=0), least
        rows = zip(model.parameters, *columns, strict=True)
        return [
            {
                "task": "coverage",
                "test": self.test,
                "law": self.law,
                "parameter": name,
                "seeds": self.seeds,
                "inside": float(share),
                "width_over_cramer_rao": float(width / bound),
            }
            for name, share, width, bound in rows
        ]

    def cramer_rao(self, forces: list[ndarray]) -> ndarray:
        """Cramér–Rao standard deviations, by finite differences of the true forces."""
        tests, (model, truth) = TESTS[self.test], known(self.law)
        information = np.zeros((truth.size, truth.size))
        for test, force in zip(tests, forces, strict=True):
            gamma = test.shear_angle(steps(test)) * (1 - 1e-12)  # within a table
            columns = []
            for i, parameter in enumerate(truth):
                ends = np.repeat(truth[None], 2, axis=0)
                ends[:, i] += np.array([-1e-5, 1e-5]) * parameter
                low, high = (test.force(model.build(end), gamma) for end in ends)
                columns.append((high - low) / (ends[1, i] - ends[0, i]))
            J = np.transpose(columns)
            information += J.T @ J / (NOISE * force.max()) ** 2
        return np.sqrt(np.diag(np.linalg.inv(information)))


@cache
def _fine_curve(across: int) -> tuple[BiasExtension, CubicSpline]:
    """A test simulated beyond the range of the kinematics."""
    test, (model, truth) = bias(45), known("polynomial")
    fine = Simulation(SOFT, across, _FINE_STEPS, seed=100)
    angles, forces, _ = fine.curve(model.build(truth), test, np.radians(BEYOND))
    return test, CubicSpline(angles, forces)


@dataclass(frozen=True)
class Inverse:
    """An inverse fit to three specimens of a simulated fabric."""

    across: int
    seed: int

    def __str__(self) -> str:
        return f"inverse: {self.across} across, seed {self.seed}"

    def rows(self) -> list[Row]:
        """Fit on a coarse mesh to data from a finer mesh."""
        test, curve = _fine_curve(2 * self.across)
        moved = steps(test, POINTS, BEYOND)
        gamma = test.shear_angle(moved)
        truth = curve(gamma)
        data = specimens((test,) * 3, (moved,) * 3, (truth,) * 3, self.seed, NOISE)
        simulation = Simulation(SOFT, self.across, seed=self.seed)
        fit = fit_tests(data, simulation=simulation).parts["shear"]
        law = fit.law
        coarse = Simulation(SOFT, self.across, _FINE_STEPS, seed=self.seed)
        angles, forces, stabilisation = coarse.curve(law, test, np.radians(BEYOND))
        off = CubicSpline(angles, forces)(gamma) - truth
        late = gamma > np.radians(ANGLES[0])
        model, values = known("polynomial")
        at = np.radians(ANGLES)
        moments = law.value(at) / model.build(values).value(at) - 1
        low, high = fit.intervals.T
        return [
            {
                "task": "inverse",
                "across": self.across,
                "seed": self.seed,
                "stabilisation": stabilisation,
                "off_over_largest": float(np.abs(off).max() / truth.max()),
                "off_past_10": float(np.abs(off[late] / truth[late]).max()),
                "inside": int(np.sum((low <= values) & (values <= high))),
                **{
                    f"moment_{a}": float(m)
                    for a, m in zip(ANGLES, moments, strict=True)
                },
            }
        ]


@dataclass(frozen=True)
class Agreement:
    """Laws fitted to a simulated picture frame and a simulated bias extension."""

    def __str__(self) -> str:
        return "agreement"

    def rows(self) -> list[Row]:
        """C from a picture frame and a bias extension of the same fabric."""
        model, truth = known("polynomial")
        law = model.build(truth)
        from_frame = fit_tests([_simulated_frame(law)]).laws["shear"]
        from_bias = fit_tests([_simulated_strip(law)]).laws["shear"]
        angles = np.arange(5, 45, 5)
        at = np.radians(angles)
        moments = (one.value(at) for one in (from_frame, from_bias, law))
        rows = zip(angles, *moments, strict=True)
        return [
            {
                "task": "agreement",
                "angle": int(angle),
                "frame": float(one),
                "bias": float(two),
                "apart": float(two / one - 1),
                "frame_off": float(one / true - 1),
            }
            for angle, one, two, true in rows
        ]


def _simulated_frame(law: Law) -> Specimen:
    """A picture frame on a mesh of elements of equal height."""
    test = PictureFrame(SIDE, SIDE)
    mesh = rectangle(SIDE, SIDE, (8, 8), "horizontal", _JITTER, 1)
    gamma, (x, y) = _sheared(picture_frame(mesh, shear_angle=_HELD), law, Full())
    along = x * np.cos(gamma) - y * np.sin(gamma)  # force along the rotated fibres
    force = along / np.sin(np.pi / 4 - gamma / 2)
    return Specimen("frame", test, force, test.displacement(gamma))


def _simulated_strip(law: Law) -> Specimen:
    """A bias extension on a fibre-aligned mesh, as in the study of angles."""
    test, mesh = BiasExtension(WIDTH, 2 * WIDTH), graded_mesh(np.pi / 4, _CELLS)
    scene = bias_extension(mesh, shear_angle=_HELD)
    gamma, (_, force) = _sheared(scene, law, Quadratic())
    return Specimen("bias", test, force, test.displacement(gamma))


def _sheared(
    scene: Scene, law: Law, formulation: Formulation
) -> tuple[ndarray, ndarray]:
    """Shear angles in radians and reactions at the end of each step."""
    ply = Ply(scene.mesh, Fabric(STIFF, law, scene.warp, scene.weft), formulation)
    states = LoadStepper(ply, scene.conditions, _FINE_STEPS).run().states[1:]
    gamma = np.array([state.load_factor for state in states]) * _HELD
    return gamma, np.transpose([scene.reaction(state) for state in states])


@dataclass(frozen=True)
class RoundTrip:
    """Data from a known law, the fitted law, and a simulation with it."""

    degrees: float

    def __str__(self) -> str:
        return f"round trip: {self.degrees:g}°"

    def rows(self) -> list[Row]:
        """Loads simulated with the fitted law, against the data."""
        model, truth = known("polynomial")
        strips = TESTS[f"bias {self.degrees:g}°"]
        law = model.build(truth)
        data = specimens(strips, *_curves(strips, law), 1, NOISE)
        strip, shear_law = bias(self.degrees), fit_tests(data).laws["shear"]
        W, H, theta = strip.width, strip.height, strip.inclination
        mesh = rectangle(W, H, (1, 1))
        scene = bias_extension(mesh, warp=theta, weft=np.pi - theta, shear_angle=_HELD)
        fabric = Fabric(STIFF, shear_law, scene.warp, scene.weft)

        def on_net(density: float) -> LoadStepper:
            graded = scene.graded(fabric, density)
            ply = Ply(graded.mesh, fabric, Quadratic(400.0, points=6))
            return LoadStepper(ply, graded.conditions, _STEPS)

        with errors_only():
            result, refused = run(ToleranceStepper(on_net, _TOLERANCE))
        angles = [state.load_factor * _HELD for state in result.states]
        forces = [scene.reaction(state)[1] for state in result.states]
        curve, at = CubicSpline(angles, forces), np.radians(ANGLES)
        loads = strip.force(law, at)
        return [
            {
                "task": "round trip",
                "degrees": self.degrees,
                "angle": angle,
                "data": float(known_load),
                "simulated": float(load),
                "off": float(load / known_load - 1),
                "off_over_largest": float((load - known_load) / loads.max()),
                "unknowns": int(result.ply.basis.N),
                "seconds": float(result.wall_time_s),
                "refused": refused,
            }
            for angle, known_load, load in zip(ANGLES, loads, curve(at), strict=True)
        ]


def example() -> FabricFit:
    """A fit to three specimens extended beyond the range of the kinematics."""
    model, truth = known("polynomial")
    tests, law = TESTS["bias 45°"], model.build(truth)
    moved = [steps(test, POINTS, BEYOND) for test in tests]
    forces = [t.force(law, t.shear_angle(m)) for t, m in zip(tests, moved, strict=True)]
    return fit_tests(specimens(tests, moved, forces, 1, NOISE))


@dataclass(frozen=True)
class Benchmark:
    """A benchmark curve from a folder."""

    width: float
    height: float
    folder: Path = field(compare=False)

    def __str__(self) -> str:
        return f"benchmark: {self.width:g}x{self.height:g}"

    @cached_property
    def file(self) -> Path:
        """File of the curve."""
        return self.folder / f"glass_plain_{self.width:g}_{self.height:g}.csv"

    def rows(self) -> list[Row]:
        """C = F_sh cos γ of a benchmark curve, point by point, and F_sh by a fit."""
        form = Format(units={"displacement": "mm", "force": "N"})
        test = BiasExtension(self.width, self.height)
        choices = Preparation(slack=0.0, force_at_rest=0.0)
        (specimen,) = read_specimens(self.file, test, form, choices)
        gamma, C = specimen.pointwise(np.radians(BEYOND))
        moments = np.interp(np.radians(ANGLES), gamma, C)
        expected = BENCHMARK[self.width, self.height]
        fit, at = fit_tests([specimen]).parts["shear"], np.radians(ANGLES)

        def shear_force(law: Law) -> ndarray:
            return law.value(at) / np.cos(at)

        low, high = fit.band(shear_force)
        columns = moments, expected, shear_force(fit.law), 0.5 * (high - low)
        return [
            {
                "task": "benchmark",
                "specimen": f"{self.width:g} × {self.height:g}",
                "angle": angle,
                "moment": float(one),
                "expected": other,
                "off": float(one / other - 1),
                "shear_force": float(fitted),
                "half_width": float(half),
            }
            for angle, one, other, fitted, half in zip(ANGLES, *columns, strict=True)
        ]


Case = Coverage | Inverse | Agreement | RoundTrip | Benchmark


def all_cases(benchmark: Path | None) -> list[Case]:
    """All cases; benchmark cases only if a folder with the curves is given.

    Raises
    ------
    FileNotFoundError
        If the folder lacks a curve.
    """
    cases: list[Case] = [
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
                raise FileNotFoundError(f"the file {curve.file} is missing")
        cases += curves
    return cases
