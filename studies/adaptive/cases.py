"""Cases that calibrate the estimate, judge it, meet a tolerance, or compare meshes."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from time import perf_counter

import numpy as np
from numpy import ndarray

from skfem_textile import (
    AdaptiveStepper,
    Fabric,
    LoadStepper,
    Ply,
    Quadratic,
    Result,
    StepError,
    refine,
)
from skfem_textile.ply.ply import DEFAULT
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import Scene, bias_extension

from ..angles.cases import G, Specimen, stored
from ..common.tables import Row

#: Of the pull at equal unknowns: angles in degrees, and unknowns at most.
KINKS, MOST_UNKNOWNS = (30.0, 45.0, 60.0), 25_000

#: Cells along a side of a rhombus of the mesh along the fibres.
CELLS = 16

#: Tolerance of the load that is asked for.
TOLERANCE = 0.01

#: Load steps of the runs that are not timed.
STEPS = 8

# Corners are moved to this share of their distance from the middle, so that one on a
# kink is on the side of its element.  Shear angles that differ by more than the other,
# in radians, are of two sides of a kink.  Chosen: far above rounding.
_INSIDE, _JUMP = 0.99, 1e-6


@dataclass(frozen=True)
class Case:
    """A pull along the bisector of the fibres, and what it is for.

    Attributes
    ----------
    task
        ``calibrates`` or ``judges`` the estimate, ``tolerance``, or ``kinks``.
    degrees, gamma
        Inclination of the fibres, and shear angle at the end.
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
        """The load in N at the end: that of the study of angles."""
        assert scene.load is not None
        inextensible = scene.load(self.specimen.shear_law, 1.0)
        share = stored()[self.specimen, round(self.gamma)]["load"]
        return float(share * inextensible)

    def scene_along_fibres(self) -> Scene:
        """The scene up to 40 degrees on the coarser mesh of the study's references."""
        return self.specimen.along_fibres(CELLS)

    def rows(self) -> list[Row]:
        """The rows of a case; of kinks one for each mesh."""
        scene, kinks = self.scene(), self.task == "kinks"
        found = _kinks(self, scene) if kinks else [_of_load(self, scene)]
        head = {"case": str(self), "task": self.task, "degrees": self.degrees}
        return [head | row for row in found]


def all_cases() -> Iterator[Case]:
    """Every case; those that judge have other meshes and stiffnesses, more angles."""
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
    """Error of the load, and what was estimated."""
    ply, met = case.ply(scene), None
    if case.task == "tolerance":
        stepper = AdaptiveStepper(
            *(ply, scene.conditions, TOLERANCE, STEPS), most_unknowns=MOST_UNKNOWNS
        )
        result: Result = _best(stepper)
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
    """Position errors of uniform meshes, and of those that are finer at kinks."""
    rows, ply = [], case.ply(scene)
    while ply.basis.N <= MOST_UNKNOWNS:
        rows.append(position(scene, ply, _end(scene, ply)) | {"mesh": "uniform"})
        ply = refine(ply, np.arange(ply.users_mesh.nelements)).ply
    most = max(row["unknowns"] for row in rows)
    fine = _best(
        AdaptiveStepper(
            case.ply(scene), scene.conditions, 1e-6, STEPS, most_unknowns=most
        )
    )
    rows.append(position(scene, fine.ply, fine.u) | {"mesh": "refined"})
    band = band_at_kinks(case.ply(scene), scene, most)
    rows.append(position(scene, band, _end(scene, band)) | {"mesh": "known"})
    along = case.scene_along_fibres()
    ply = case.ply(along, Quadratic())
    rows.append(position(along, ply, _end(along, ply)) | {"mesh": "along"})
    return rows


def band_at_kinks(ply: Ply, scene: Scene, most: int) -> Ply:
    """A ply that is refined only in elements that kinks of the exact motion cross."""
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
    """The displacement under the whole load."""
    return LoadStepper(ply, scene.conditions, STEPS).run().u


def _best(stepper: AdaptiveStepper) -> Result:
    """The result, be the tolerance met or not."""
    try:
        return stepper.run()
    except StepError as error:
        return error.result


def position(scene: Scene, ply: Ply, u: ndarray) -> Row:
    """Position errors in mm, over nodes and over the area."""
    off = ply.nodal(u) - scene.displacement(ply.nodes, 1.0)
    square = (off**2).sum(axis=0)
    in_elements = square[ply.mesh.t].mean(axis=0)
    return {
        "unknowns": ply.basis.N,
        "position_error": np.sqrt(square.mean()),
        "over_area": np.sqrt(np.average(in_elements, weights=ply.basis.dx.sum(axis=1))),
    }
