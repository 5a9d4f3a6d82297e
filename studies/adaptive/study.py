"""Estimated errors against references, and adaptive against uniform meshes."""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from time import perf_counter
from typing import Any

import numpy as np
from numpy import ndarray

from skfem_textile import (
    AdaptiveStepper,
    Fabric,
    LoadStepper,
    Ply,
    Quadratic,
    Result,
    refine,
)
from skfem_textile.ply.ply import DEFAULT
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, bias_extension
from skfem_textile.solve.error_estimate import LOAD_OVER_SHARE, SHEAR_ANGLE_OVER_CHANGE

from ..angles.cases import G, Specimen, stored
from ..common.figures import File, figure_of, legend, style_of
from ..common.running import run
from ..common.tables import having, markdown_table, percent, span, table
from ..study import Part, Row, Study

#: Comparison at equal unknowns: fibre angles in degrees, and maximum of unknowns.
KINKS, MOST_UNKNOWNS = (30.0, 45.0, 60.0), 25_000

#: Cells along a rhombus side of the fibre-aligned mesh.
CELLS = 16

#: Tolerance of the load.
TOLERANCE = 0.01

#: Load steps of runs that are not timed.
STEPS = 8

# Corners are moved towards the element centre by this factor, so that a corner on a
# kink lies on the side of its element.  A larger difference of shear angles, in
# radians, means that a kink crosses the element.  Both are far above round-off.
_INSIDE, _JUMP = 0.99, 1e-6


@dataclass(frozen=True)
class Case:
    """Tension along the bisector of the fibres, and the purpose of the run.

    Attributes
    ----------
    task
        ``calibrates`` or ``judges`` the estimate, ``tolerance``, or ``kinks``.
    degrees, gamma
        Inclination of the fibres, and final shear angle.
    E
        Fibre stiffness in N/mm.
    mesh, across, seed
        Kind of mesh, its elements across, and seed.
    """

    task: str
    degrees: float
    gamma: float
    E: float
    mesh: str
    across: int
    seed: int = 1

    def __str__(self) -> str:
        return (
            f"{self.task}, {self.degrees:g}°, sheared {self.gamma:g}°, E {self.E:g}, "
            f"{self.mesh} {self.across}"
        )

    def scene(self) -> Scene:
        """The scene."""
        theta = np.radians(self.degrees)
        size = self.across, round(2 * self.across * np.tan(theta))
        return bias_extension(
            self.mesh,
            size,
            seed=self.seed,
            warp=theta,
            weft=np.pi - theta,
            shear_angle=np.radians(self.gamma),
        )

    def ply(self, scene: Scene, formulation: Formulation = DEFAULT) -> Ply:
        """The ply."""
        fabric = Fabric(self.E, G, scene.warp, scene.weft)
        return Ply(scene.mesh, fabric, formulation)

    @property
    def specimen(self) -> Specimen:
        """The same ply in the study of angles."""
        return Specimen(self.degrees, "linear", self.E / G)

    def reference(self, scene: Scene) -> float:
        """The final load in N, from the study of angles."""
        assert scene.load is not None
        inextensible = scene.load(self.specimen.shear_law, 1.0)
        share = stored()[self.specimen, round(self.gamma)]["load"]
        return float(share * inextensible)

    def scene_along_fibres(self) -> Scene:
        """The scene up to 40 degrees on the coarser reference mesh of that study."""
        return self.specimen.along_fibres(CELLS)

    def rows(self) -> list[Row]:
        """The rows of a case; one per mesh for ``kinks``."""
        scene, kinks = self.scene(), self.task == "kinks"
        results = _kinks(self, scene) if kinks else [_of_load(self, scene)]
        head = {"case": str(self), "task": self.task, "degrees": self.degrees}
        return [head | row for row in results]


def all_cases() -> Iterator[Case]:
    """All cases; validation uses other meshes, stiffnesses and more angles."""
    meshes, gammas = ("irregular", "delaunay"), (20.0, 40.0)
    for degrees, gamma, mesh, across in product(
        (30.0, 45.0, 60.0), gammas, meshes, (6, 12)
    ):
        yield Case("calibrates", degrees, gamma, 1e6, mesh, across, seed=1)
    angles = (30.0, 37.5, 45.0, 52.5, 60.0)
    for degrees, gamma, mesh, across in product(angles, gammas, meshes, (8, 16)):
        yield Case("judges", degrees, gamma, 1e5, mesh, across, seed=2)
    for degrees, gamma, mesh in product(angles, gammas, meshes):
        yield Case("tolerance", degrees, gamma, 1e5, mesh, 6, seed=3)
    for kinked in KINKS:
        yield Case("kinks", kinked, 40.0, 1e6, "delaunay", 4)


def _of_load(case: Case, scene: Scene) -> Row:
    """Load error and its estimate."""
    ply, met = case.ply(scene), None
    if case.task == "tolerance":
        result = _refined(ply, scene, TOLERANCE, MOST_UNKNOWNS)
        met = result.summary()["tolerance_met"]
    else:
        result = LoadStepper(ply, scene.conditions).run()
    began = perf_counter()
    estimate = result.estimated_error
    cost = (perf_counter() - began) / result.wall_time_s
    angle = estimate.shear_angle
    return {
        "unknowns": result.ply.basis.N,
        "error": scene.reaction(result.states[-1])[1] / case.reference(scene) - 1,
        "estimate": estimate.load,
        "carried": sum(result.states[-1].shares["energy"].values()),
        "cost": cost,
        "angle_error": scene.errors(result)["shear_angle_error_rms_deg"],
        "angle_estimate": None if angle is None else float(np.degrees(angle)),
        "met": met,
        "seconds": result.wall_time_s,
    }


def _kinks(case: Case, scene: Scene) -> list[Row]:
    """Position errors of uniform meshes and of meshes refined at kinks."""
    rows, ply = [], case.ply(scene)
    while ply.basis.N <= MOST_UNKNOWNS:
        rows.append(position(scene, ply, _end(scene, ply)) | {"mesh": "uniform"})
        ply = refine(ply, np.arange(ply.users_mesh.nelements)).ply
    most = max(row["unknowns"] for row in rows)
    fine = _refined(case.ply(scene), scene, 1e-6, most)
    rows.append(position(scene, fine.ply, fine.u) | {"mesh": "refined"})
    band = band_at_kinks(case.ply(scene), scene, most)
    rows.append(position(scene, band, _end(scene, band)) | {"mesh": "known"})
    along = case.scene_along_fibres()
    ply = case.ply(along, Quadratic())
    rows.append(position(along, ply, _end(along, ply)) | {"mesh": "along"})
    return rows


def band_at_kinks(ply: Ply, scene: Scene, most: int) -> Ply:
    """A ply refined only in elements crossed by kinks of the exact solution."""
    while True:
        corners = ply.users_mesh.p[:, ply.users_mesh.t]
        middle = corners.mean(axis=1, keepdims=True)
        inside = middle + _INSIDE * (corners - middle)
        angles = scene.shear_angle(inside.reshape(2, -1), 1.0).reshape(3, -1)
        area = ply.on_users_elements(ply.basis.dx.sum(axis=1))
        crossed = np.ptp(angles, axis=0) > _JUMP
        large = area > area[crossed].max() / 2
        finer = refine(ply, crossed & large).ply
        if most < finer.basis.N:
            return ply
        ply = finer


def _end(scene: Scene, ply: Ply) -> ndarray:
    """The displacement at full load."""
    return LoadStepper(ply, scene.conditions, STEPS).run().u


def _refined(ply: Ply, scene: Scene, tolerance: float, most: int) -> Result:
    """The result on the last mesh, even if the tolerance is not met."""
    arguments = ply, scene.conditions, tolerance, STEPS
    return run(AdaptiveStepper(*arguments, most_unknowns=most))[0]


def position(scene: Scene, ply: Ply, u: ndarray) -> Row:
    """Root-mean-square position errors in mm, over nodes and over the area."""
    off = ply.nodal(u) - scene.displacement(ply.nodes, 1.0)
    square = (off**2).sum(axis=0)
    in_elements = square[ply.mesh.t].mean(axis=0)
    return {
        "unknowns": ply.basis.N,
        "position_error": np.sqrt(square.mean()),
        "over_area": np.sqrt(np.average(in_elements, weights=ply.basis.dx.sum(axis=1))),
    }


#: For errors below `SMALL`, estimates must stay below `_LEAST_LARGE`.
SMALL, _LEAST_LARGE = 0.005, 0.02

#: Accepted range of the ratio of estimate to error.
PASSES = 0.5, 3.0

#: Names of the meshes in the comparison at equal unknowns.
MESHES = {
    "refined": "refined at kinks",
    "known": "refined at the exact kinks",
    "along": "along fibres, quadratic",
}

_POSITIONS = "position_error", "over_area"

# Axis limits of load errors in per cent, and of position errors in mm.
_ENDS, _POSITION_ENDS = (0.03, 30.0), (0.004, 1.0)


def estimates(rows: Sequence[Row]) -> str:
    """Ratios of estimate to error for calibration and validation cases."""
    lines = []
    for task, name in (("calibrates", "calibration"), ("judges", "validation")):
        if selected := having(rows, task=task):
            costs = [row["cost"] for row in selected]
            cost = f"{np.median(costs):.0%}, {np.max(costs):.0%}"
            lines.append([name, *_n_passed(selected), cost])
    head = [
        "cases",
        f"estimate over error in {PASSES[0]:g} to {PASSES[1]:g}",
        f"error ≤ {SMALL:.1%}: estimate < {_LEAST_LARGE:.0%}",
        "share of run time: median, maximum",
    ]
    return markdown_table(head, lines)


def _n_passed(rows: Sequence[Row]) -> tuple[str, str]:
    """Numbers of accepted estimates for large and for small errors."""
    large = [row for row in rows if abs(row["error"]) > SMALL]
    small = [row for row in rows if abs(row["error"]) <= SMALL]
    ratios = [(row["estimate"] or 0.0) / abs(row["error"]) for row in large]
    passed = sum(PASSES[0] <= ratio <= PASSES[1] for ratio in ratios)
    below = sum((row["estimate"] or np.inf) < _LEAST_LARGE for row in small)
    return f"{passed} of {len(large)}", f"{below} of {len(small)}"


def factor(rows: Sequence[Row]) -> str:
    """Ratios of error to indicator in calibration cases, and the factors used."""
    selected = [row for row in having(rows, task="calibrates") if row["estimate"]]
    large = [row for row in selected if abs(row["error"]) > SMALL]
    load = [abs(r["error"]) / r["carried"] for r in large]
    default = SHEAR_ANGLE_OVER_CHANGE
    angle = [default * r["angle_error"] / r["angle_estimate"] for r in selected]
    lines = [
        [name, f"{np.median(x):.2f}", span(x, ".2f"), f"{used:g}"]
        for name, x, used in (
            ("load error over energy share", load, LOAD_OVER_SHARE),
            ("shear-angle error over change", angle, default),
        )
        if x
    ]
    return markdown_table(["ratio", "median", "range", "used"], lines)


def tolerances(rows: Sequence[Row]) -> str:
    """Runs to a tolerance against the reference."""
    return table(
        having(rows, task="tolerance"),
        {
            "case": lambda row: row["case"].removeprefix("tolerance, "),
            "unknowns": "{unknowns}",
            "error": "{error:.2%}",
            "estimate": "{estimate:.2%}",
            "reported as met": lambda row: "yes" if row["met"] else "no",
        },
    )


def kinks(rows: Sequence[Row]) -> str:
    """Position errors relative to uniform meshes, interpolated at equal unknowns."""
    lines, kink_rows = [], having(rows, task="kinks")
    for row in (row for row in kink_rows if row["mesh"] != "uniform"):
        line = [f"{row['degrees']:g}°", MESHES[row["mesh"]], row["unknowns"]]
        for key in _POSITIONS:
            at = _uniform(kink_rows, row, key)
            line += [f"{row[key]:.4f}", f"{at:.4f}", f"{row[key] / at:.2f}"]
        lines.append(line)
    head = ["fibres", "mesh", "unknowns"]
    for what in ("nodes", "area"):
        head += [f"{name}, {what}" for name in ("error (mm)", "uniform (mm)", "ratio")]
    return markdown_table(head, lines)


def _uniform(rows: Sequence[Row], row: Row, key: str) -> float:
    """The error of uniform meshes at the number of unknowns of a row."""
    uniform = having(rows, degrees=row["degrees"], mesh="uniform")
    sizes = np.log([other["unknowns"] for other in uniform])
    errors = np.log([other[key] for other in uniform])
    return float(np.exp(np.interp(np.log(row["unknowns"]), sizes, errors)))


def in_words(rows: Sequence[Row]) -> dict[str, str]:
    """The results quoted on pages, by name."""
    runs, kink_rows = having(rows, task="tolerance"), having(rows, task="kinks")
    within = [row for row in runs if abs(row["error"]) <= TOLERANCE]
    met = [row for row in runs if row["met"]]
    right = [row for row in met if row in within]
    words = {
        "estimates": _n_passed(having(rows, task="judges"))[0],
        "within": f"{len(within)} of {len(runs)}",
        "met": f"{len(met)} of {len(runs)}",
        "right": f"{len(right)} of {len(met)}",
        "met_worst": percent(max(abs(row["error"]) for row in met), ".2f"),
    }
    for mesh in MESHES:
        ratios = [
            row[key] / _uniform(kink_rows, row, key)
            for row in having(kink_rows, mesh=mesh)
            for key in _POSITIONS
        ]
        words[mesh] = span(ratios, ".2f")
    return words


def draw_errors(rows: Sequence[Row], file: File = None) -> Any:
    """Estimated against true errors of loads, and position errors by unknowns."""
    with figure_of((8.0, 6.6), file, 9) as figure:
        load, *positions = figure.subplots(2, 2).flat
        _draw_loads(load, having(rows, task="judges"))
        kinds = {"uniform": "uniform"} | MESHES
        styles = {
            label: style_of(i, markersize=4, linewidth=1.0)
            for i, label in enumerate(kinds.values())
        }
        for axes, degrees in zip(positions, KINKS, strict=True):
            for mesh, label in kinds.items():
                line = having(rows, degrees=degrees, mesh=mesh)
                errors = [row["position_error"] for row in line]
                axes.loglog([row["unknowns"] for row in line], errors, **styles[label])
            axes.set(title=f"Position, {degrees:g}°", xlabel="Unknowns")
            axes.set(ylim=_POSITION_ENDS, ylabel="Error, rms over nodes (mm)")
        legend(figure, styles, len(styles))
    return figure


def _draw_loads(axes: Any, rows: Sequence[Row]) -> None:
    ends = np.array(_ENDS)
    least, most = PASSES
    axes.fill_between(ends, least * ends, most * ends, color="0.9")
    axes.plot(ends, ends, color="grey", linewidth=0.8)
    axes.axvline(100 * SMALL, color="grey", linewidth=0.8, linestyle=":")
    known = [row for row in rows if row["estimate"] is not None]
    errors = [100 * abs(row["error"]) for row in known]
    axes.plot(errors, [100 * row["estimate"] for row in known], "o", markersize=3)
    axes.set(title="Load", xlabel="True error (%)", ylabel="Estimated error (%)")
    axes.set(xscale="log", yscale="log", xlim=_ENDS, ylim=_ENDS)


class Adaptive(Study[Case]):
    """Estimates, tolerances, and position errors at equal unknowns."""

    parts = (
        Part(
            "adaptive.csv",
            {
                "estimates.md": estimates,
                "factor.md": factor,
                "tolerances.md": tolerances,
                "kinks.md": kinks,
            },
            {"adaptive.png": draw_errors},
        ),
    )
    sample = "judges, 45°, sheared 20°, E 100000, irregular 8"
    volatile = (*Study.volatile, "cost")

    def cases(self, options: argparse.Namespace) -> Sequence[Case]:
        return list(all_cases())

    def line(self, rows: list[Row]) -> str:
        row = rows[-1]
        if row["task"] == "kinks":
            return f"{row['case']}: {row['position_error']:.4f} mm"
        estimate = row["estimate"]
        text = "none" if estimate is None else f"{estimate:.4f}"
        return f"{row['case']}: error {row['error']:.4f}, estimate {text}"

    def figures(self, rows: list[Row]) -> dict[str, str]:
        return in_words(rows)


STUDY = Adaptive()
