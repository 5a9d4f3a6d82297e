"""Shear angle of a bias extension: predicted, measured, and where yarns may slip."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy import ndarray

from skfem_textile import LoadStepper, Ply, Quadratic, Result, Yarns
from skfem_textile.calibration import BiasExtension, Simulation, Specimen, Zeros
from skfem_textile.calibration.specimens import APART
from skfem_textile.ply.slip import slip_figures
from skfem_textile.scenes import bias_extension
from skfem_textile.scenes.rectangle import rectangle

from ..common.running import errors_only
from ..common.tables import Row
from .published import BIAS, columns, fibre_stiffnesses, property_of
from .shear import STIFFNESSES, fitted

#: The measured specimen, and its fabric.
FABRIC, NAME, TEST = "plain", "150x450 INSA-NU", BiasExtension(150.0, 450.0)

#: Theoretical shear angle in degrees at the end.
END = 50.0

# Radius in mm of the disc at the centre over which the angle is averaged: a quarter of
# the width.
_RADIUS = 37.5

# Densities of the meshes, and load steps.
_DENSITIES, _STEPS = (4.0, 2.0), 20


def measured() -> tuple[ndarray, ndarray]:
    """Displacement in mm, and measured shear angle in radians."""
    data = columns("cao2008/shear_angle_150x450.csv")
    return data["displacement_mm"], np.radians(data["measured_deg"])


def yarns() -> Yarns:
    """Yarns of the plain weave: counts and widths of its table."""
    families = "warp", "weft"
    counts = [property_of(FABRIC, f"{family} count /cm") for family in families]
    widths = [property_of(FABRIC, f"{family} yarn width mm") for family in families]
    return Yarns((10 / counts[0], 10 / counts[1]), (widths[0], widths[1]))


def specimen(slack: float | None) -> Specimen:
    """The measured angles; a slack of None follows from them."""
    moved, angle = measured()
    zeros = Zeros(slack, 0.0)
    return Specimen(NAME, TEST, np.ones(moved.size), moved, angle, zeros)


@dataclass(frozen=True)
class Angle:
    """Prediction with the law of the other bias extensions, on a mesh."""

    density: float

    def __str__(self) -> str:
        return f"angle: density {self.density:g}"

    def rows(self) -> list[Row]:
        """Angles in the middle and slip index, by the displacement."""
        result = simulated(self.density, 1.0)
        others = {x: simulated(self.density, x) for x in STIFFNESSES}
        found: list[Row] = []
        for i, state in enumerate(result.states[1:], 1):
            gamma = np.radians(END) * state.load_factor
            found.append(
                {
                    "density": self.density,
                    "pin_jointed": float(np.degrees(gamma)),
                    "displacement": float(TEST.displacement(gamma)),
                    "centre": _angle(result, i, _centre(result)),
                    "zone": _angle(result, i, _zone(result, float(gamma))),
                    **slip_figures(result.ply, state.u, state.parameters),
                    **{
                        f"{name}_{times:g}": _at(other, of, state.load_factor)
                        for times, other in others.items()
                        for name, of in (("stiffness", _of_centre), ("slip", _slip))
                    },
                }
            )
        return found


def simulated(density: float, times: float) -> Result:
    """The bias extension with a multiple of the assumed tension stiffness."""
    law = fitted(FABRIC, BIAS, without=NAME).laws["shear"]
    warp, weft = (times * E for E in fibre_stiffnesses(FABRIC))
    scene = bias_extension(
        rectangle(TEST.width, TEST.height, (1, 1)), shear_angle=np.radians(END)
    )
    fabric = Simulation((warp, weft)).fabric({"shear": law})
    fabric = replace(fabric, warp=scene.warp, weft=scene.weft, yarns=yarns())
    with errors_only():
        graded = scene.graded(fabric, density)
        ply = Ply(graded.mesh, fabric, Quadratic(400.0, points=6))
        return LoadStepper(ply, graded.conditions, _STEPS).run()


def _centre(result: Result) -> ndarray:
    """Elements near the centre of the specimen."""
    x, y = result.ply.mesh.p[:, result.ply.mesh.t].mean(axis=1)
    return np.hypot(x - 0.5 * TEST.width, y - 0.5 * TEST.height) < _RADIUS


def _zone(result: Result, gamma: float) -> ndarray:
    """Elements in the zone that inextensible fibres shear by the whole angle."""
    x = result.ply.mesh.p[:, result.ply.mesh.t].mean(axis=1)
    scene = bias_extension(
        rectangle(TEST.width, TEST.height, (1, 1)), shear_angle=gamma
    )
    assert scene.shear_angle is not None
    return np.asarray(scene.shear_angle(x, 1.0) > 0.75 * gamma)


def _angle(result: Result, i: int, elements: ndarray) -> float:
    """Mean shear angle of some elements in a state, in degrees."""
    ply = result.ply
    angle = (ply.shear_angle(result.states[i].u) * ply.basis.dx)[elements]
    return float(np.degrees(angle.sum() / ply.basis.dx[elements].sum()))


def _of_centre(result: Result, i: int) -> float:
    """Angle at the centre in a state."""
    return _angle(result, i, _centre(result))


def _slip(result: Result, i: int) -> float:
    """Slip index that is exceeded on the area of one crossing in a state."""
    state = result.states[i]
    return slip_figures(result.ply, state.u, state.parameters)["max_slip_index"]


def _at(
    result: Result, of: Callable[[Result, int], float], load_factor: float
) -> float:
    """Value of the states of a result, at a load factor."""
    values = [of(result, i) for i in range(len(result.states))]
    times = [state.load_factor for state in result.states]
    return float(np.interp(load_factor, times, values))


@dataclass(frozen=True)
class Departures:
    """Angles of an inextensible net at which the measured angle departs, in degrees.

    Attributes
    ----------
    slack, model_slack
        Slack in mm by the kinematics of the net, and by the angles of the model.
    raw, net, model
        Departure by 2° from the net without a slack, from the net with its slack, and
        from the angle at the centre of the model with its slack.
    """

    slack: float
    model_slack: float
    raw: float
    net: float
    model: float


def departures(rows: list[Row]) -> Departures:
    """Departures of the measured angle, from rows of one mesh."""
    moved, angle = measured()
    centre = np.radians([0.0, *(row["centre"] for row in rows)])
    at = np.array([0.0, *(row["displacement"] for row in rows)])
    early = angle <= angle.max() / 3
    slack = float(np.median(moved[early] - np.interp(angle[early], centre, at)))
    known = moved - slack <= at[-1]
    off = np.interp(moved[known] - slack, at, centre) - angle[known]
    first = int(np.argmax(off > APART))
    beyond = float(TEST.shear_angle(np.array([moved[first] - slack]))[0])
    by_net = specimen(None)
    raw, net = specimen(0.0).departure, by_net.departure
    degrees = (float(np.degrees(x)) for x in (raw, net, beyond))
    return Departures(by_net.slack, slack, *degrees)


def onset(rows: list[Row], column: str, limit: float) -> float:
    """Angle of an inextensible net in degrees at which a column exceeds a limit."""
    values = [0.0, *(row[column] for row in rows)]
    angles = [0.0, *(row["pin_jointed"] for row in rows)]
    first = int(np.argmax(np.array(values) > limit))
    around = slice(first - 1, first + 1)
    return float(np.interp(limit, values[around], angles[around]))


def angle_cases() -> list[Angle]:
    """Two meshes."""
    return [*map(Angle, _DENSITIES)]
