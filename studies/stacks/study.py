"""Stacks of plies between hemispherical tools, and pulled out of each other."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    Holder,
    LoadStepper,
    Ply,
    Stack,
    Tool,
    drape,
)
from skfem_textile.scenes import hemisphere_forming
from skfem_textile.solve.result import Result, StepError

from ..common.tables import markdown_table
from ..study import Part, Row, Study

# Fibre and shear stiffness in N/mm and bending stiffness in N·mm, edge tension in N/mm.
_FABRIC, _TENSION = (1e4, 0.1, 5.0), 0.2

# Pressure in N/mm² on pulled strips of 40 mm × 20 mm, and their motion in mm.
_PRESSURE, _LENGTH, _WIDTH, _MOVED = 0.01, 40.0, 20.0, 0.3


@dataclass(frozen=True)
class Formed:
    """Plies at angles in degrees, formed by 75 mm in five steps.

    ``parts`` of the sides of a quarter; ``stiffness`` as a multiple of one ply.
    """

    parts: int
    angles: tuple[float, ...]
    friction: float = 0.0
    stiffness: float = 1.0
    elastic_slip: float = 0.02

    def __str__(self) -> str:
        plies = "/".join(f"{angle:g}" for angle in self.angles)
        more = f", friction {self.friction:g}" if self.friction else ""
        more += f", {self.stiffness:g} × as stiff" if self.stiffness > 1 else ""
        return f"formed, {plies}, {self.parts} parts{more}"

    def result(self) -> Result:
        """Result of the run; of its part before a stop."""
        n, stiffness = len(self.angles), self.stiffness
        tension, size = stiffness * _TENSION, (self.parts // 2, self.parts // 2)
        scene = hemisphere_forming("aligned", size=size, tension=tension)
        terms, plies = [*scene.loads, *scene.tools], []
        E, G, D = stiffness * np.array(_FABRIC)
        for angle in np.radians(self.angles):
            c, s = np.cos(angle), np.sin(angle)
            fabric = Fabric(E, G, (c, s), (-s, c), bending=(D, D))
            given: Any = {"terms": terms} if n == 1 else {}
            ends = scene.fibre_ends
            plies.append(Ply(scene.mesh, fabric, dimension=3, fibre_ends=ends, **given))
        whole = plies[0]
        if n > 1:
            slip = self.elastic_slip
            options: Any = {"friction": self.friction, "elastic_slip": slip}
            whole = Stack(plies, terms=terms, **options)
        try:
            return LoadStepper(whole, scene.conditions, steps=5).run()
        except StepError as stop:
            return stop.result

    def rows(self) -> list[Row]:
        """Force, largest angle of each ply, solves and processor time."""
        began = process_time()
        result = self.result()
        seconds, ply, last = process_time() - began, result.ply, result.states[-1]
        angles = np.degrees(np.abs(ply.shear_angle(last.u, ply.centre)))[:, 0]
        each = np.split(angles, len(self.angles))
        return [
            {
                "plies": len(self.angles),
                "parts": self.parts,
                "friction": self.friction,
                "load_factor": last.load_factor,
                "force": float(last.reactions["punch"][2]),
                "angles": " ".join(f"{x.max():.4f}" for x in each),
                "linear_solves": result.linear_solves,
                "resolved": result.path_resolved,
                "cpu_s": round(seconds, 2),
            }
        ]


@dataclass(frozen=True)
class Pulled:
    """Every second of some pressed strips, pulled along its length."""

    plies: int
    friction: float = 0.3

    def __str__(self) -> str:
        return f"pulled out, {self.plies} plies"

    def rows(self) -> list[Row]:
        """Force in N, and the pressing force times μ of all interfaces."""
        lines = (np.linspace(0, end, n) for end, n in ((_LENGTH, 5), (_WIDTH, 3)))
        mesh, fabric = MeshQuad.init_tensor(*lines), Fabric(1e3, 0.5, bending=(5, 5))
        plies = [Ply(mesh.with_defaults(), fabric, dimension=3)] * self.plies
        top = drape.Plane((0.0, 0.0, 0.5))
        terms = (
            Tool(top, side=-1, name="top"),
            Holder(top, pressure=_PRESSURE, side=-1, name="holder"),
        )
        thickness = 1.0 / self.plies
        given: Any = {"friction": self.friction, "thickness": thickness}
        held = {}
        for i in range(1, self.plies + 1):
            side, far = ("right", _MOVED) if i % 2 == 0 else ("left", 0.0)
            held[f"strip {i}"] = Condition(f"ply {i}: {side}", (far, 0.0, None))
        result = LoadStepper(Stack(plies, terms=terms, **given), held, steps=2).run()
        last = result.states[-1].reactions
        pulled = range(2, self.plies + 1, 2)
        force = sum(float(last[f"strip {i}"][0]) for i in pulled)
        exact = self.friction * _PRESSURE * _LENGTH * _WIDTH * (self.plies - 1)
        solves = result.linear_solves
        return [{"force": force, "exact": exact, "linear_solves": solves}]


_EQUAL = [Formed(parts, (0.0,) * n) for n, parts in ((2, 12), (3, 12), (4, 12))]
_EQUAL += [Formed(24, (0.0,) * n) for n in (2, 3, 4)]
_ALONE = [Formed(parts, (0.0,)) for parts in (12, 24)]
_STIFF = [Formed(12, (0.0,), stiffness=2.0)]
_STUCK = [Formed(12, (0.0, 0.0), 5.0, elastic_slip=0.001)]
_CROSSED = [Formed(24, (0.0, 45.0), mu) for mu in (0.0, 0.2, 0.5)]
_PULLED = [Pulled(n) for n in (2, 3, 4, 5)]


def formed(rows: list[Row]) -> str:
    """Forces, angles, solves and times of formed plies."""
    body = []
    for row in (x for x in rows if x["case"].startswith("formed")):
        name = row["case"].removeprefix("formed, ")
        end = "" if row["load_factor"] == 1 else f" (at {row['load_factor']:.2f})"
        body.append(
            [
                f"{name}{end}",
                f"{row['force']:.3f}",
                str(row["angles"]).replace(" ", ", "),
                row["linear_solves"],
                f"{row['cpu_s']:.1f}",
            ]
        )
    head = ["plies", "force in N", "largest shear angles in °", "solves", "CPU s"]
    return markdown_table(head, body) if body else ""


def pulled(rows: list[Row]) -> str:
    """Forces that pull plies out."""
    body = [
        [row["case"], f"{row['force']:.6f}", f"{row['exact']:.6f}"]
        for row in rows
        if row["case"].startswith("pulled")
    ]
    return markdown_table(["strips", "force in N", "exact"], body) if body else ""


def _angles(row: Row) -> list[float]:
    return [float(x) for x in str(row["angles"]).split()]


class Stacks(Study[Formed | Pulled]):
    """Stacks against one ply, with friction, at other angles, and pulled out."""

    parts = (Part("stacks.csv", {"formed.md": formed, "pulled.md": pulled}),)
    shown = "{force}"
    sample = str(_PULLED[0])

    def cases(self, options: argparse.Namespace) -> Sequence[Formed | Pulled]:
        every = _PULLED, _ALONE, _STIFF, _EQUAL, _STUCK, _CROSSED
        return [case for group in every for case in group]

    def figures(self, rows: list[Row]) -> dict[str, str]:
        by = {row["case"]: row for row in rows}
        angles, forces = [], []
        for case in _EQUAL:
            alone, row = by[str(Formed(case.parts, (0.0,)))], by[str(case)]
            n, angle = len(case.angles), _angles(alone)[0]
            angles += [abs(x - angle) for x in _angles(row)]
            forces.append(abs(row["force"] / (n * alone["force"]) - 1))
        stiff, stuck = by[str(_STIFF[0])], by[str(_STUCK[0])]
        off = max(abs(x - _angles(stiff)[0]) for x in _angles(stuck))
        crossed = [by[str(case)]["force"] for case in _CROSSED]
        pulled = [by[str(case)] for case in _PULLED]
        errors = [abs(row["force"] / row["exact"] - 1) for row in pulled]
        return {
            "angle": f"{max(angles):.2f}°",
            "force": f"{100 * max(forces):.2f} %",
            "stuck_angle": f"{off:.3f}°",
            "stuck_force": f"{100 * abs(stuck['force'] / stiff['force'] - 1):.3f} %",
            "crossed": ", ".join(f"{force:.1f}" for force in crossed),
            "pulled": f"{max(errors):.0e}",
        }

    def complaint(self, rows: list[Row]) -> str:
        bad = [
            row["case"]
            for row in rows
            if row["case"].startswith("pulled")
            and abs(row["force"] / row["exact"] - 1) > 0.005
        ]
        return f"wrong forces: {', '.join(bad)}" if bad else ""


STUDY = Stacks()
