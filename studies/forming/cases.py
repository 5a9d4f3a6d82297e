"""Cases: the reference hemisphere, its tools as triangles, and random hemispheres."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from skfem_textile import Fabric, Macro, OnePoint
from skfem_textile.forming.contact import contacts
from skfem_textile.forming.shape import draw_in
from skfem_textile.scenes import Case, Scene, hemisphere_forming
from skfem_textile.solve.result import Result, StepError

from ..study import Row
from . import triangles

#: Kinds of cases.
REFERENCE, RANDOM, SLACK = "reference", "random", "slack"

# Length of the edges of tools as triangles in mm.
_EDGE = 1.0


@dataclass(frozen=True)
class Reference:
    """Hemisphere of R 75 mm, formed to 75 mm: elements a side, steps, and tools."""

    cells: int
    steps: int
    triangles: bool = False

    def __str__(self) -> str:
        tools = ", tools of triangles" if self.triangles else ""
        return f"{REFERENCE}, {2 * self.cells} parts, {self.steps} steps{tools}"

    def rows(self) -> list[Row]:
        """One row of figures of the last state."""
        scene = hemisphere_forming("aligned", size=(self.cells, self.cells))
        if self.triangles:
            scene = _of_triangles(scene)
        fabric = Fabric(1e4, 0.1, scene.warp, scene.weft, bending=(5.0, 5.0))
        result, refused = _run(scene, fabric, self.steps)
        given = {"kind": REFERENCE, "parts": 2 * self.cells, "steps": self.steps}
        tools = {"triangles": self.triangles}
        return [
            {
                "case": str(self),
                **given,
                **tools,
                **_figures(result),
                "refused": refused,
            }
        ]


@dataclass(frozen=True)
class Random:
    """Hemisphere drawn at random, in two numbers of steps and two formulations."""

    kind: str
    number: int
    seed: int

    def __str__(self) -> str:
        return f"{self.kind}, {self.number}"

    def rows(self) -> list[Row]:
        """One row with the input, and the results of the three runs."""
        rng = np.random.default_rng([self.seed, self.number, self.kind == SLACK])
        radius, fillet = float(rng.uniform(40, 120)), float(rng.uniform(5, 20))
        stiffness = float(10 ** rng.uniform(3, 6))
        low, high = (0.0, 1.0) if self.kind == SLACK else (5.0, 50.0)
        bending = float(rng.uniform(low, high))
        tension = 0.0 if self.kind == SLACK else float(rng.choice([0.05, 0.2, 1.0]))
        fibres = int(rng.choice([0, 45]))
        travel = float(rng.uniform(0.3, 1.0) * radius)
        cells, steps = int(rng.choice([6, 8, 10])), int(rng.choice([2, 4, 8]))
        scene = hemisphere_forming(
            *("aligned", radius, fillet, travel),
            size=(cells, cells),
            width=4 * radius,
            height=4 * radius,
            fibres=float(np.radians(fibres)),
            tension=tension,
        )
        fabric = Fabric(stiffness, 0.1, scene.warp, scene.weft, bending=(bending,) * 2)
        given: Row = {
            "case": str(self),
            "kind": self.kind,
            "radius": radius,
            "fillet": fillet,
            "stiffness": stiffness,
            "bending": bending,
            "tension": tension,
            "fibres": fibres,
            "travel": travel,
            "cells": cells,
            "steps": steps,
        }
        result, refused = _run(scene, fabric, steps)
        row = given | _figures(result) | {"refused": refused}
        again, refused = _run(scene, fabric, 2 * steps)
        off = np.abs(_centres(result) - _centres(again)).max()
        row |= {
            "refused_of_more_steps": refused,
            "off_in_more_steps": float(off),
            "force_in_more_steps": _force(again),
        }
        one, refused = _run(scene, fabric, steps, OnePoint())
        row |= {
            "refused_of_one_point": refused,
            "rms_of_one_point": float(np.sqrt(_mean_square(result, one))),
            "interval": _interval(result) + _interval(one),
            "force_of_one_point": _force(one),
        }
        return [row]


def all_cases(seed: int) -> list[Reference | Random]:
    """All cases; the random ones from a seed."""
    return [
        *(Reference(cells, 5) for cells in (6, 12, 18, 24)),
        *(Reference(12, steps) for steps in (1, 2, 10, 20)),
        Reference(12, 5, triangles=True),
        *(Random(RANDOM, i, seed) for i in range(150)),
        *(Random(SLACK, i, seed) for i in range(40)),
    ]


def _run(
    scene: Scene, fabric: Fabric, steps: int, formulation: Any = None
) -> tuple[Result, str]:
    """The result, and the reason why a run stopped."""
    case = Case(
        scene=scene, fabric=fabric, steps=steps, formulation=formulation or Macro()
    )
    try:
        return case.run(), ""
    except StepError as error:
        return error.result, str(error)


def _figures(result: Result) -> Row:
    """Largest angle, force, draw-in, balance, gap and solves of the last state."""
    ply, state = result.ply, result.states[-1]
    inwards = draw_in(ply, state.u)
    tools = contacts(ply)
    gaps = [tool.gaps(state.u, state.load_factor).min() for tool in tools]
    forces = np.array([state.reactions[tool.name] for tool in tools])
    load = ply.nodal(ply.load(state.u, state.load_factor, state.parameters))
    held = [state.reactions[k][i] for i, k in enumerate(("left", "bottom"))]
    off = load.sum(axis=1) + np.array([*held, 0.0])
    return {
        "load_factor": state.load_factor,
        "shear": float(np.degrees(np.abs(ply.shear_angle(state.u, ply.centre)).max())),
        "force": _force(result),
        "draw_in_axis": inwards.at(0.0),
        "draw_in_diagonal": inwards.at(np.pi / 4),
        "unbalanced": float(np.abs(off).max() / max(np.abs(forces).max(), 1e-300)),
        "gap": float(min(gaps)),
        "negative_pivots": state.verdict.negative_pivots,
        "path_resolved": result.path_resolved,
        "solves": result.linear_solves,
        "seconds": result.wall_time_s,
    }


def _force(result: Result) -> float:
    return float(result.states[-1].reactions["punch"][2])


def _centres(result: Result) -> np.ndarray:
    """Shear angles of the user's elements in degrees."""
    ply = result.ply
    angle = ply.on_users_elements(ply.shear_angle(result.u, ply.centre)[:, 0])
    return np.degrees(angle)


def _mean_square(one: Result, other: Result) -> float:
    return float(np.mean((_centres(one) - _centres(other)) ** 2))


def _interval(result: Result) -> float:
    """Estimated root mean square error of the shear angle in degrees."""
    angle = result.error.shear_angle
    return np.nan if angle is None else float(np.degrees(angle))


def _of_triangles(scene: Scene) -> Scene:
    """The same tools, punch and die as triangles."""
    punch, die, holder = scene.tools
    end: Any = punch.surface
    hole: Any = die.surface
    of_die = triangles.die(hole.radius, hole.fillet, float(hole.point[2]), _EDGE)
    tools = (
        replace(punch, surface=triangles.sphere(end.radius, end.point, _EDGE)),
        replace(die, surface=of_die),
        holder,
    )
    return replace(scene, tools=tools)
