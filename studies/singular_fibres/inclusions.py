"""Plies with an inclusion: a disc, an ellipse or a rectangle of another fabric."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from typing import Any

import numpy as np
from numpy import ndarray

from skfem_textile import Fabric, LoadStepper, Outline, Ply, mesh_outline
from skfem_textile.ply.formulations import ON_FIBRES
from skfem_textile.solve.interval import work_of

from ..study import Row
from .cases import WIDTH, G, box
from .irregular import HEIGHT, Curved, straight

# Seeds of the plies that judge and of others, and their number.
_JUDGING, _CHOOSING, _NUMBER = 20261201, 7, 12

# Corners of a disc or an ellipse.
_CORNERS = 64

# Elements across √area of the reference meshes, refined once at the singular fibres.
_FINE = 18, 24

# Load steps.
_STEPS = 4


@dataclass(frozen=True)
class Inclusion:
    """A ply with an inclusion, on the default mesh.

    Attributes
    ----------
    case
        Name.
    kind
        Shape of the inclusion, and how it differs from the ply.
    plate
        The ply.
    """

    case: str
    kind: str
    plate: Curved

    def __str__(self) -> str:
        return self.case

    def rows(self) -> list[Row]:
        """Error and interval of the load."""
        plate, conditions = self.plate, self.plate.conditions()
        coarse, load = (plate.converged(across, 1, _STEPS) for across in _FINE)
        mesh = mesh_outline(
            plate.outline, plate.fabric, conditions, fabrics=plate.fabrics
        )
        fabrics = {"rest": plate.fabric, **plate.fabrics}
        stepper = LoadStepper(Ply(mesh, fabrics, ON_FIBRES), conditions, steps=_STEPS)
        result = stepper.run()
        found = work_of(stepper.problem.at(1.0), result.states[-1]) / plate.travel
        return [
            {
                "case": self.case,
                "kind": self.kind,
                "unknowns": int(stepper.ply.basis.N),
                "reference": load,
                "spread": coarse / load - 1,
                "error": found / load - 1,
                "half_width": result.error.load,
                "reason": result.error.reason,
            }
        ]


def inclusions() -> Iterator[Inclusion]:
    """Plies that judge, and others with which constants were chosen."""
    for name, seed in (("inclusion", _JUDGING), ("choosing inclusion", _CHOOSING)):
        for i, (kind, plate) in enumerate(islice(_drawn(seed), _NUMBER), start=1):
            yield Inclusion(f"{name} {i}", kind, plate)


def _drawn(seed: int) -> Iterator[tuple[str, Curved]]:
    random, i = np.random.default_rng(seed), 0
    while True:
        degrees, travel = random.uniform(36, 46), random.uniform(5, 9)
        E = G * 10 ** random.uniform(4.3, 5.7)
        shape = ("disc", "ellipse", "rectangle")[i % 3]
        a, b = np.sort(random.uniform(6, 13, 2))
        a = b if shape == "disc" else a
        ring = _turned(shape, a, b, random.uniform(0, np.pi))
        corner = np.array([[WIDTH], [HEIGHT]])
        # The inclusion keeps a distance of 4 mm from the sides.
        low, high = 4 - ring.min(axis=1), corner[:, 0] - 4 - ring.max(axis=1)
        centre = random.uniform(low, high)
        stiffer, turn = 20 ** random.uniform(1, 2), random.uniform(20, 70)
        if _connects(ring + centre[:, None], degrees):
            continue
        stiff = i % 2 == 0
        own = Fabric(
            E,
            G * (stiffer if stiff else 1.0),
            *straight(degrees) if stiff else _rotated(degrees, turn),
        )
        what = f"{stiffer:.0f} times as stiff" if stiff else f"turned by {turn:.0f}°"
        outline = Outline(
            np.transpose(box(HEIGHT)), regions={"inclusion": ring + centre[:, None]}
        )
        base = Fabric(E, G, *straight(degrees))
        kind = f"{shape}, {2 * a:.0f} × {2 * b:.0f} mm, {what}"
        yield kind, Curved(kind, outline, base, float(travel), {"inclusion": own})
        i += 1


def _connects(ring: ndarray, degrees: float) -> bool:
    """True if fibres connect both clamps through an inclusion."""
    x, y = np.abs(ring[0] - WIDTH / 2) + WIDTH / 2, ring[1]
    across = x * np.tan(np.radians(degrees))  # height of the fibres from a clamp
    return bool((y < across).any() and (HEIGHT - y < across).any())


def _rotated(degrees: float, turn: float) -> Any:
    """Warp and weft at ± an angle to the clamps, both rotated by an angle."""
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    return tuple((c * x - s * y, s * x + c * y) for x, y in straight(degrees))


def _turned(shape: str, a: float, b: float, angle: float) -> ndarray:
    """Corners of a shape of half the size a by b, turned by an angle."""
    at = 2 * np.pi * np.arange(_CORNERS) / _CORNERS
    x = np.stack([a * np.cos(at), b * np.sin(at)])
    if shape == "rectangle":
        x = np.array([[-a, a, a, -a], [-b, -b, b, b]])
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]]) @ x
