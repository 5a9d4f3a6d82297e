"""Cases: plies on shapes of the tests, and plies draped from the net and by growth."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cache
from time import process_time

import numpy as np

from skfem_textile import Fabric, LoadStepper
from skfem_textile.drape import TriangleMesh
from skfem_textile.scenes import (
    Case,
    Scene,
    cylinder,
    double_dome,
    drape,
    hemisphere,
    saddle,
)
from skfem_textile.solve.result import Result, StepError
from tests.helpers import tool_shapes

from ..common.tables import Row

#: Kinds of cases.
SHAPE, PAIR = "shape", "from the net and by growth"

# Default stiffnesses of fibres and shear in N/mm, and default number of load steps of
# the command line.
_STRETCH, _SHEAR, _STEPS = 1e4, 0.1, 4


@cache
def _tool(name: str) -> TriangleMesh:
    shapes: dict[str, Callable] = {
        "hemisphere with flange": lambda: tool_shapes.hemisphere_with_flange(
            radius=50.0, fillet=8.0, flange=170.0
        ),
        "hat": tool_shapes.hat,
        "saddle": tool_shapes.saddle,
        "bonnet": tool_shapes.bonnet,
        "askew bonnet": lambda: tool_shapes.bonnet(askew=True),
    }
    return TriangleMesh(*shapes[name]())


#: Sides of the ply in mm and contact point on each shape; None for the highest one.
SHAPES: dict[str, tuple[float, tuple[float, float, float] | None]] = {
    "hemisphere with flange": (300.0, None),
    "hat": (180.0, None),
    "saddle": (180.0, (0.0, 0.0, 0.0)),
    "bonnet": (180.0, None),
}

#: Scenes of pairs, by name.
SCENES: dict[str, Callable[..., Scene]] = {
    "hemisphere": hemisphere,
    "cylinder": cylinder,
    "saddle": saddle,
    "double dome": double_dome,
    "askew bonnet": lambda **ply: drape(_tool("askew bonnet"), **ply),
}


@dataclass(frozen=True)
class Shape:
    """A ply on a shape with the default options of the command line.

    Attributes
    ----------
    shape
        Name in `SHAPES`.
    cells
        Elements per side.
    fibres
        Inclination of the warp in degrees.
    """

    shape: str
    cells: int
    fibres: float
    kind: str = SHAPE

    def __str__(self) -> str:
        return f"{SHAPE}, {self.shape}, {self.cells}×{self.cells}, {self.fibres:g}°"

    def rows(self) -> list[Row]:
        """One row: load factor reached, solves, largest shear and reactions."""
        side, point = SHAPES[self.shape]
        began = process_time()
        scene = drape(
            *(_tool(self.shape), "irregular", point),
            size=(self.cells, self.cells),
            width=side,
            height=side,
            fibres=float(np.radians(self.fibres)),
        )
        fabric = Fabric(_STRETCH, _SHEAR, scene.warp, scene.weft)
        try:
            result = Case(scene=scene, fabric=fabric, steps=_STEPS).run()
        except StepError as error:
            result = error.result
        return [
            {
                "case": str(self),
                "refused": result.not_on_tool,
                **asdict(self),
                "load_factor": result.states[-1].load_factor,
                "solves": result.linear_solves,
                "shear": _largest_shear(result),
                "held": _held(scene, result),
                "seconds": process_time() - began,
            }
        ]


@dataclass(frozen=True)
class Pair:
    """The same ply draped from the net and by growth.

    Attributes
    ----------
    scene
        Name in `SCENES`.
    fibres
        Inclination of the warp in degrees.
    tension, bending
        Tension on the edges in N/mm, and D of both families in N·mm.
    """

    scene: str
    fibres: float
    tension: float
    bending: float
    kind: str = PAIR

    def __str__(self) -> str:
        by = f"q={self.tension:g}, D={self.bending:g}"
        return f"{PAIR}, {self.scene}, {self.fibres:g}°, {by}"

    def rows(self) -> list[Row]:
        """One row: solves of both, and the largest difference of the shear angles."""
        fibres = float(np.radians(self.fibres))
        scene = SCENES[self.scene](fibres=fibres, tension=self.tension)
        bending = self.bending, self.bending
        fabric = Fabric(_STRETCH, _SHEAR, scene.warp, scene.weft, bending=bending)
        case = Case(scene=scene, fabric=fabric)
        begun = case.run()
        ply = case.ply()
        row = {
            "case": str(self),
            "refused": "",
            **asdict(self),
            "shear": _largest_shear(begun),
            "held": _held(scene, begun),
            "solves": begun.linear_solves,
        }
        for steps in (1, _STEPS):
            try:
                grown = LoadStepper(ply, scene.conditions, steps).run()
            except StepError as error:
                row["refused"] = f"growth: {error}"
                return [row]
            off = ply.shear_angle(grown.u) - begun.ply.shear_angle(begun.u)
            row[f"solves_of_{steps}_steps"] = grown.linear_solves
            row[f"off_{steps}_steps"] = float(np.degrees(np.abs(off).max()))
        return [row]


def _largest_shear(result: Result) -> float:
    return float(np.degrees(np.abs(result.ply.shear_angle(result.u)).max()))


def _held(scene: Scene, result: Result) -> float | None:
    """Largest reaction of a support along the tool, relative to the sum of the loads.

    None without supports at single nodes, or without loads.
    """
    state, ply = result.states[-1], result.ply
    load = np.abs(ply.load(state.u, state.load_factor, state.parameters)).sum()
    force = scene.measured(result).get("max_holding_force_N")
    return float(force / load) if isinstance(force, float) and load else None


def all_cases() -> list[Shape | Pair]:
    """All cases in report order."""
    shapes = [
        Shape(name, cells, fibres)
        for name in SHAPES
        for cells in (12, 24)
        for fibres in (0.0, 30.0, 45.0)
    ]
    pairs = [
        Pair(name, fibres, tension, bending)
        for name in SCENES
        for fibres in (0.0, 30.0)
        for tension, bending in ((2.0, 0.0), (0.0, 5.0))
    ]
    return [*shapes, *pairs]
