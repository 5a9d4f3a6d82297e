"""What is measured of each case."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy import ndarray
from scipy.interpolate import CubicSpline

from skfem_textile import AdaptiveStepper, Fabric, Full, LoadStepper, Ply, Quadratic
from skfem_textile.calibration import (
    BiasExtension,
    PictureFrame,
    ShearFit,
    ShearTest,
    Simulation,
    Specimen,
    fit_by_simulation,
    fit_shear,
    read_specimen,
)
from skfem_textile.fabric import Law
from skfem_textile.scenes import bias_extension, picture_frame
from skfem_textile.scenes.bias_extension import WIDTH
from skfem_textile.scenes.rectangle import rectangle
from skfem_textile.scenes.trellis import SIDE
from skfem_textile.solve.result import Result, StepError

from ...angles.aligned_mesh import graded_mesh
from ...angles.cases import GRADING
from ...common.log import errors_only
from ...study import Row
from .cases import (
    ANGLES,
    BENCHMARK,
    BEYOND,
    HOLD,
    NOISE,
    POINTS,
    SOFT,
    STIFF,
    TESTS,
    Benchmark,
    Coverage,
    Inverse,
    RoundTrip,
    bias,
    known,
    specimens,
    steps,
)

# Probability that a number of a normal distribution is within 1.96 deviations: 95 %.
_TWO_SIDED = 1.959963984540054

# Tolerance of the load of simulations on adaptive meshes, and their load steps.
_TOLERANCE, _STEPS = 0.02, 4

# Load steps of other simulations.
_FINE_STEPS = 20

# Cells along a side of a rhombus of the mesh along the fibres.
_CELLS = 16

# Largest jitter of meshes.
_JITTER = 0.25


def covered(case: Coverage) -> list[Row]:
    """How often each parameter is inside its band, and how wide the band is."""
    tests, (model, truth) = TESTS[case.test], known(case.law)
    law = model.build(truth)
    moved, forces = _curves(tests, law)
    inside, widths = [], []
    for seed in range(case.seeds):
        data = specimens(tests, moved, forces, seed, NOISE)
        fit = fit_shear(data, case.law, points=truth.size).fit
        low, high = fit.intervals.T
        inside.append((low <= truth) & (truth <= high))
        widths.append(high - low)
    least = 2 * _TWO_SIDED * _cramer_rao(case, forces)
    found = np.mean(inside, axis=0), np.median(widths, axis=0), least
    rows = zip(model.parameters, *found, strict=True)
    return [
        {
            "task": "coverage",
            "test": case.test,
            "law": case.law,
            "parameter": name,
            "seeds": case.seeds,
            "inside": float(share),
            "width_over_cramer_rao": float(width / bound),
        }
        for name, share, width, bound in rows
    ]


def _curves(
    tests: Sequence[ShearTest], law: Law
) -> tuple[list[ndarray], list[ndarray]]:
    """Displacements of each test, and the forces of a law there."""
    moved = [steps(test) for test in tests]
    return moved, [
        test.force(law, test.shear_angle(own))
        for test, own in zip(tests, moved, strict=True)
    ]


def _cramer_rao(case: Coverage, forces: list[ndarray]) -> ndarray:
    """Least deviations of unbiased estimates, by differences of the true forces."""
    tests, (model, truth) = TESTS[case.test], known(case.law)
    information = np.zeros((truth.size, truth.size))
    for test, force in zip(tests, forces, strict=True):
        gamma = test.shear_angle(steps(test)) * (1 - 1e-12)  # inside of a table
        columns = []
        for i, own in enumerate(truth):
            ends = np.repeat(truth[None], 2, axis=0)
            ends[:, i] += np.array([-1e-5, 1e-5]) * own
            low, high = (test.force(model.build(end), gamma) for end in ends)
            columns.append((high - low) / (ends[1, i] - ends[0, i]))
        J = np.transpose(columns)
        information += J.T @ J / (NOISE * force.max()) ** 2
    return np.sqrt(np.diag(np.linalg.inv(information)))


@cache
def _fine_curve(across: int) -> tuple[BiasExtension, CubicSpline]:
    """A simulated test beyond the kinematics, with element edges across."""
    test, (model, truth) = bias(45), known("polynomial")
    fine = Simulation(SOFT, across, _FINE_STEPS, seed=100)
    angles, forces, _ = fine.curve(model.build(truth), test, np.radians(BEYOND))
    return test, CubicSpline(angles, forces)


def inverse(case: Inverse) -> list[Row]:
    """An inverse fit on a coarse mesh to data of a finer one."""
    test, curve = _fine_curve(2 * case.across)
    moved = steps(test, POINTS, BEYOND)
    gamma = test.shear_angle(moved)
    truth = curve(gamma)
    data = specimens((test,) * 3, (moved,) * 3, (truth,) * 3, case.seed, NOISE)
    simulation = Simulation(SOFT, case.across, seed=case.seed)
    found = fit_by_simulation(data, "polynomial", simulation)
    law = found.fit.law
    coarse = Simulation(SOFT, case.across, _FINE_STEPS, seed=case.seed)
    angles, forces, stabilisation = coarse.curve(law, test, np.radians(BEYOND))
    off = CubicSpline(angles, forces)(gamma) - truth
    late = gamma > np.radians(ANGLES[0])
    model, values = known("polynomial")
    at = np.radians(ANGLES)
    moments = law.value(at) / model.build(values).value(at) - 1
    low, high = found.fit.intervals.T
    return [
        {
            "task": "inverse",
            "across": case.across,
            "seed": case.seed,
            "stabilisation": stabilisation,
            "off_over_largest": float(np.abs(off).max() / truth.max()),
            "off_past_10": float(np.abs(off[late] / truth[late]).max()),
            "inside": int(np.sum((low <= values) & (values <= high))),
            **{f"moment_{a}": float(m) for a, m in zip(ANGLES, moments, strict=True)},
        }
    ]


def agreement() -> list[Row]:
    """C from a frame and from a bias extension that are simulated with one fabric."""
    model, truth = known("polynomial")
    law = model.build(truth)
    from_frame = fit_shear([_simulated_frame(law)]).fit.law
    from_bias = fit_shear([_simulated_strip(law)]).fit.law
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
    """A picture frame on a mesh whose elements are equally high."""
    test = PictureFrame(SIDE, SIDE)
    mesh = rectangle(SIDE, SIDE, (8, 8), "horizontal", _JITTER, 1)
    scene = picture_frame(mesh, shear_angle=np.radians(HOLD))
    ply = Ply(scene.mesh, Fabric(STIFF, law, scene.warp, scene.weft), Full())
    states = LoadStepper(ply, scene.conditions, _FINE_STEPS).run().states[1:]
    gamma = np.array([state.load_factor for state in states]) * np.radians(HOLD)
    x, y = np.transpose([scene.reaction(state) for state in states])
    along = x * np.cos(gamma) - y * np.sin(gamma)  # the force in the turned fibres
    force = along / np.sin(np.pi / 4 - gamma / 2)
    return Specimen("frame", test, force, test.displacement(gamma))


def _simulated_strip(law: Law) -> Specimen:
    """A bias extension on a mesh along its fibres, as those of the study of angles."""
    test, theta = BiasExtension(WIDTH, 2 * WIDTH), np.pi / 4
    mesh = graded_mesh(theta, WIDTH, _CELLS, GRADING)
    scene = bias_extension(mesh, shear_angle=np.radians(HOLD))
    ply = Ply(mesh, Fabric(STIFF, law, scene.warp, scene.weft), Quadratic())
    states = LoadStepper(ply, scene.conditions, _FINE_STEPS).run().states[1:]
    gamma = np.array([state.load_factor for state in states]) * np.radians(HOLD)
    forces = np.array([scene.reaction(state)[1] for state in states])
    return Specimen("bias", test, forces, test.displacement(gamma))


class Simulated(NamedTuple):
    """A bias extension, its run, its force over the shear angle, and a complaint."""

    strip: BiasExtension
    result: Result
    force: CubicSpline
    refused: str


def simulated(degrees: float, law: Law) -> Simulated:
    """A bias extension on an adaptive mesh, and its force over the shear angle."""
    strip = bias(degrees)
    W, H, theta = strip.width, strip.height, strip.inclination
    size = 8, round(8 * H / W)
    mesh = rectangle(W, H, size, "irregular", _JITTER, 1)
    end = np.radians(HOLD)
    scene = bias_extension(mesh, warp=theta, weft=np.pi - theta, shear_angle=end)
    ply = Ply(mesh, Fabric(STIFF, law, scene.warp, scene.weft))
    stepper = AdaptiveStepper(ply, scene.conditions, _TOLERANCE, _STEPS)
    refused = ""
    with errors_only():
        try:
            result: Result = stepper.run()
        except StepError as error:  # the tolerance is not met, and it is judged here
            result, refused = error.result, str(error)
    angles = [state.load_factor * end for state in result.states]
    forces = [scene.reaction(state)[1] for state in result.states]
    return Simulated(strip, result, CubicSpline(angles, forces), refused)


def round_trip(case: RoundTrip) -> list[Row]:
    """Loads of the simulation with the law that was found, beside the data's."""
    model, truth = known("polynomial")
    strips = TESTS[f"bias {case.degrees:g}°"]
    law = model.build(truth)
    data = specimens(strips, *_curves(strips, law), 1, NOISE)
    found = fit_shear(data).fit.law
    strip, result, curve, refused = simulated(case.degrees, found)
    at = np.radians(ANGLES)
    loads = strip.force(law, at)
    return [
        {
            "task": "round trip",
            "degrees": case.degrees,
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


def example() -> ShearFit:
    """A fit to three specimens that were pulled beyond the kinematics."""
    model, truth = known("polynomial")
    tests, law = TESTS["bias 45°"], model.build(truth)
    moved = [steps(test, POINTS, BEYOND) for test in tests]
    forces = [t.force(law, t.shear_angle(m)) for t, m in zip(tests, moved, strict=True)]
    return fit_shear(specimens(tests, moved, forces, 1, NOISE))


def benchmark(case: Benchmark) -> list[Row]:
    """C = F_sh cos γ of a curve of the benchmark, point by point."""
    units = {"displacement": "mm", "force": "N"}
    test = BiasExtension(case.width, case.height)
    specimen = read_specimen(case.file, test, units)
    gamma, C = specimen.pointwise(np.radians(BEYOND))
    found = np.interp(np.radians(ANGLES), gamma, C)
    expected = BENCHMARK[case.width, case.height]
    return [
        {
            "task": "benchmark",
            "specimen": f"{case.width:g} × {case.height:g}",
            "angle": angle,
            "moment": float(one),
            "expected": other,
            "off": float(one / other - 1),
        }
        for angle, one, other in zip(ANGLES, found, expected, strict=True)
    ]
