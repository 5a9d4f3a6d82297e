"""Scenes of the subsystems, of a fraction of a second each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy import ndarray
from skfem import MeshQuad

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    Macro,
    OnePoint,
    Outline,
    Ply,
    Quadratic,
    Sin2,
    ToleranceStepper,
    drape,
    fit_to_fibres,
    mesh_along_fibres,
    mesh_outline,
)
from skfem_textile.scenes import (
    Case,
    bias_extension,
    buckling,
    cantilever,
    double_dome,
    hemisphere,
    hemisphere_forming,
    strip,
)
from tests.helpers import tool_shapes

#: Number of linear solves, 0 without a load stepper, and figures by name.
Outcome: TypeAlias = tuple[int, Mapping[str, float]]

# Figures of a summary that are compared.
_FIGURES = (
    *("energy", "load_N", "load_N_half_width", "max_shear_angle_deg"),
    *("max_fibre_strain", "tip_z_mm", "punch_force_N", "max_penetration_mm"),
    *("max_draw_in_mm", "max_turn_of_normal_deg", "bridging_share_of_area"),
)

# Magnitude below which a figure is round-off, such as the shear angle of a cantilever.
_NOTHING = 1e-6


@dataclass(frozen=True)
class Scene:
    """A computation of a subsystem.

    Attributes
    ----------
    name
        Name in tables.
    run
        The computation.
    of
        Modules or packages whose constants it concerns; empty for all.
    """

    name: str
    run: Callable[[], Outcome]
    of: tuple[str, ...] = ("",)


def _ply(
    scene: Callable,
    fibres: float,
    shear: Any,
    steps: int,
    formulation: Any = None,
    bending: float = 0.0,
    **given: Any,
) -> Callable[[], Outcome]:
    """A run with fibre and shear stiffness in N/mm and bending stiffness in N·mm."""

    def run() -> Outcome:
        made = scene(**given)
        both: dict[str, Any] = {"bending": (bending, bending)} if bending else {}
        fabric = Fabric(fibres, shear, made.warp, made.weft, **both)
        case = Case(
            scene=made, fabric=fabric, formulation=formulation or Macro(), steps=steps
        )
        result = case.run()
        summary = case.summary(result)
        figures = {key: float(summary.get(key) or 0.0) for key in _FIGURES}
        known = {key: x for key, x in figures.items() if abs(x) > _NOTHING}
        return result.linear_solves, known

    return run


def _to_tolerance() -> Outcome:
    scene, size = bias_extension(size=(1, 1)), (1e5, 0.5)

    def at(density: float) -> LoadStepper:
        graded = scene.graded(Fabric(*size), density)
        fabric = Fabric(*size, scene.warp, scene.weft)
        ply = Ply(graded.mesh, fabric, Quadratic(400, points=6))
        return LoadStepper(ply, graded.conditions, steps=1)

    result = ToleranceStepper(at, 0.003).run()
    unknowns, rounds = float(result.ply.basis.N), float(len(result.rounds))
    return result.linear_solves, {"unknowns": unknowns, "rounds": rounds}


_CUP: dict[str, Any] = {
    **{"mesh": "aligned", "radius": 40.0, "fillet": 10.0, "travel": 20.0},
    **{"width": 160.0, "height": 160.0, "size": (3, 3)},
}

_TWO: dict[str, Any] = {
    **(_CUP | {"travel": 10.0, "layup": "[0/90, ±45]"}),
    **{"ply_friction": 0.2, "ply_thickness": 0.5},
}

_HELD = {"fixed": Condition("bottom"), "pulled": Condition("top", (0.0, 12.0))}


def _fabric(degrees: float) -> Fabric:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return Fabric(1e5, 0.5, (c, s), (-c, s))


def _bent_fabric() -> Fabric:
    def family(shift: float) -> Callable[[ndarray], ndarray]:
        def along(x: ndarray) -> ndarray:
            angle = shift + 0.006 * x[0]
            return np.stack([np.cos(angle), np.sin(angle)])

        return along

    return Fabric(1e5, 0.5, family(0.7), family(2.2))


def _specimen(hole: bool = False) -> Outline:
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    circle = np.array([25 + 8 * np.cos(turn), 45 + 8 * np.sin(turn)])
    corners = np.array([[0.0, 50, 50, 0], [0.0, 0, 100, 100]])
    return Outline(corners, [circle] if hole else [], {"bottom": [0], "top": [2]})


def _meshed(make: Callable[[], Any]) -> Callable[[], Outcome]:
    """Size of a mesh, and the smallest and the mean area of its elements."""

    def run() -> Outcome:
        mesh = make()
        x = mesh.p[:, mesh.t]
        after = np.roll(x, -1, axis=1)
        areas = 0.5 * np.abs((x[0] * after[1] - x[1] * after[0]).sum(axis=0))
        return 0, {
            "nodes": float(mesh.p.shape[1]),
            "elements": float(mesh.nelements),
            "smallest area": float(areas.min()),
            "area": float(areas.sum()),
        }

    return run


def _fitted() -> Any:
    x, y = np.linspace(0, 50, 7), np.linspace(0, 100, 13)
    mesh = MeshQuad.init_tensor(x, y).with_defaults()
    return fit_to_fibres(mesh, _fabric(50.0), _HELD).mesh


def _along_fibres() -> Any:
    corners = np.array([[0.0, 30, 45, 25, 0], [0.0, -5, 20, 40, 25]])
    return mesh_along_fibres(corners, (1.0, 0.3), (-0.3, 1.0), 5.0)


def _net(laid: Any, tool: Any = None) -> dict[str, float]:
    """Number of cells, largest shear angle, and number of remarks on a tool."""
    return {
        **({"remarks": float(len(tool.remarks))} if tool else {}),
        "cells": float(np.isfinite(laid.shear_angle()).sum()),
        "shear": float(np.nanmax(np.abs(laid.shear_angle()))),
    }


def _pattern() -> Outcome:
    sphere = drape.Sphere(50.0, (0, 0, -50.0))
    laid = drape.net(sphere, 5.0, (6, 6), (6, 6))
    sheet, turn = drape.Sheet.of_net(laid), np.linspace(0, 2 * np.pi, 31)[:-1]
    x, y = np.cos(turn), np.sin(turn)
    outer, hole = (
        drape.flat_pattern(
            sheet, np.array([r * x, r * y, np.sqrt(2500.0 - r * r) - 50 + 0 * x])
        )
        for r in (20.0, 8.0)
    )
    return 0, _net(laid) | {"area": outer.area, "hole": hole.area}


def _with_darts() -> Outcome:
    box = drape.TriangleMesh(
        *tool_shapes.deep_box(100.0, 70.0, 40.0, flange=20.0, size=6.0)
    )
    laid = drape.net_with_darts(box, 8.0, np.radians(55), point=(0, 0, 40.0))
    pattern = drape.pattern_with_darts(laid, box.facets.boundary()[0])
    return 0, {"darts": float(len(laid.darts)), "area": pattern.pattern.area}


def _best_start() -> Outcome:
    tool = drape.TriangleMesh(*tool_shapes.cap(side=100.0, size=25.0))
    best = drape.best_start(tool, 25.0, trials=2)
    return 0, {"shear": best.measure, "nets": float(len(best.measures))}


def _on_noise() -> Outcome:
    x, t = tool_shapes.cap(size=10.0)
    x = x + 0.1 * np.random.default_rng(1).standard_normal(x.shape)
    tool = drape.TriangleMesh(x, t)
    return 0, _net(drape.net(tool, 10.0), tool)


def _on_loose_triangles() -> Outcome:
    """On triangles whose copies of vertices scatter."""
    x, t = tool_shapes.cap(size=10.0)
    x = x[:, t.T.ravel()]
    x = x + np.random.default_rng(1).uniform(-0.1, 0.1, x.shape)
    tool = drape.TriangleMesh(x, np.arange(x.shape[1]).reshape(-1, 3).T)
    vertices = {"vertices": float(tool.facets.points.shape[1])}
    return 0, _net(drape.net(tool, 10.0), tool) | vertices


def _holed_tool() -> Outcome:
    tool = drape.TriangleMesh(*tool_shapes.curved_ring(size=10.0))
    return 0, _net(drape.net(tool, 15.0, point=(70.0, 0.0, 97.0)))


_DARTS = tuple(f"nets.{name}" for name in ("dart", "seam", "corners", "course"))

#: Scenes by subsystem.
SCENES = {
    "solve": (
        Scene("strip", _ply(strip, 1e5, 1.0, 2, size=(3, 4))),
        Scene("bias", _ply(bias_extension, 1e6, Sin2(0.5), 1, size=(3, 6))),
        Scene(
            "one point",
            _ply(bias_extension, 1e4, 0.01, 1, OnePoint(), size=(3, 6)),
        ),
        Scene("buckling", _ply(buckling, 1e3, 0.5, 1, bending=5.0, size=(6, 1))),
        Scene("cantilever", _ply(cantilever, 1e3, 0.5, 1, bending=0.1, size=(6, 1))),
        Scene("hemisphere", _ply(hemisphere, 1e4, 0.1, 1, size=(4, 4))),
        Scene(
            "double dome",
            _ply(double_dome, 1e4, 0.1, 1, size=(6, 4)),
            ("solve.on_surface", "solve.surface_nodes", "solve.verdict"),
        ),
        Scene("tolerance", _to_tolerance, ("solve.tolerance",)),
        Scene(
            "forming",
            _ply(hemisphere_forming, 1e4, 0.1, 1, bending=1.0, tension=0.0, **_CUP),
            ("solve.active_set", "solve.newton"),
        ),
        Scene(
            "heavy cantilever",
            _ply(cantilever, 1e3, 0.5, 2, bending=1.0, size=(6, 1)),
            ("solve.continuation", "solve.search"),
        ),
        Scene(
            "large shear",
            _ply(
                bias_extension, 1e5, 0.5, 1, OnePoint(), size=(2, 4), shear_angle=1.45
            ),
            ("solve.newton", "solve.direction"),
        ),
        Scene(
            "deep cup",
            _ply(
                hemisphere_forming,
                *(1e5, 0.1, 1),
                bending=1.0,
                tension=0.0,
                **_CUP | {"travel": 30.0},
            ),
            ("solve.active_set", "solve.newton"),
        ),
    ),
    "contact": (
        Scene(
            "slack ply",
            _ply(hemisphere_forming, 1e4, 0.1, 1, bending=1.0, tension=0.0, **_CUP),
        ),
        Scene(
            "stretched ply",
            _ply(hemisphere_forming, 1e5, 0.1, 1, bending=5.0, gap=0.35, **_CUP),
        ),
    ),
    "outlines": (
        Scene(
            "two plies",
            _ply(hemisphere_forming, 1e3, 0.1, 1, bending=5.0, **_TWO),
            ("contact.between_plies", "contact.ply_surface", "contact.stack"),
        ),
        Scene("net", _meshed(lambda: mesh_outline(_specimen(), _fabric(45.0), _HELD))),
        Scene(
            "hole",
            _meshed(lambda: mesh_outline(_specimen(True), _fabric(38.0), _HELD)),
        ),
        Scene(
            "curved fibres",
            _meshed(
                lambda: mesh_outline(_specimen(), _bent_fabric(), _HELD, size=12.0)
            ),
        ),
        Scene("fit", _meshed(_fitted)),
        Scene("along fibres", _meshed(_along_fibres)),
    ),
    "nets": (
        Scene("pattern", _pattern),
        Scene("noise", _on_noise),
        Scene("loose triangles", _on_loose_triangles),
        Scene("ring", _holed_tool),
        Scene("darts", _with_darts, _DARTS),
        Scene("best start", _best_start, ("nets.start_search",)),
    ),
}
