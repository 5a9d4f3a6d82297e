"""Trials of defects of meshes: refused in one line, or a ply that computes rightly."""

import warnings
from collections.abc import Callable
from pathlib import Path

import meshio
import numpy as np
from numpy.random import Generator, default_rng
from skfem import Mesh, MeshQuad, MeshTri

from skfem_textile import Fabric, Full, Macro, OnePoint, Ply, Quadratic
from skfem_textile.io import read_mesh
from skfem_textile.mesh.splitting import cut, split, split_cells
from skfem_textile.ply.terms import Formulation

from ..trial import SILENT, Family, Finding, checked, refused, surprised
from .mesh_defects import DEFECTS, defective_sheet
from .ply_checks import PlyCheck
from .sheets import Sheet
from .specimen import C_S, FIBRE_STIFFNESS, SHEAR_STIFFNESS

#: Meshes of each defect.
_MESHES = 20


def attempt(seed: int, folder: Path) -> Finding:
    """Give the mesh of a seed to the library in one of the ways that it takes."""
    name = list(DEFECTS)[seed % len(DEFECTS)]
    rng, sound = default_rng(seed), DEFECTS[name].sound
    given = defective_sheet(name, rng)
    way = _WAYS[int(rng.integers(len(_WAYS)))]
    damage = f"{name}, {way.__name__.strip('_')}, {given.t.shape}"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            ply = _ply(given, way, folder, rng)
        except ValueError as error:
            line = str(error)
            if sound:
                return Finding(SILENT, damage, f"a sound mesh is refused: {line}")
            return refused(damage, line)
        except Exception as error:
            return surprised(damage, error)
    if sound is False:
        return Finding(SILENT, damage, f"taken: {ply}")
    warp, weft = ply.fabric.warp, ply.fabric.weft
    fibres = np.arctan2([warp[1], weft[1]], [warp[0], weft[0]])
    x = given.p[:, given.t]
    with np.errstate(all="ignore"):
        shortest = float(np.linalg.norm(np.roll(x, 1, axis=1) - x, axis=0).min())
        check = PlyCheck(ply, fibres, FIBRE_STIFFNESS, SHEAR_STIFFNESS, rng, shortest)
        return checked(damage, check.run)


def _ply(given: Sheet, way: Callable, folder: Path, rng: Generator) -> Ply:
    mesh = way(given, folder)
    angle = rng.uniform(0, np.pi)
    warp, weft = ((np.cos(a), np.sin(a)) for a in (angle, angle + rng.uniform(1, 2)))
    fabric = Fabric(FIBRE_STIFFNESS, SHEAR_STIFFNESS, warp, weft)
    return Ply(mesh, fabric, _formulation(mesh, way, rng))


def _formulation(mesh: Mesh, way: Callable, rng: Generator) -> Formulation:
    formulations: list[Formulation] = [Quadratic(), Quadratic(20.0)]
    if isinstance(mesh, MeshQuad):
        formulations = [Full(), OnePoint(C_S)]
        formulations += [Macro(C_S)] if way in (_split, _cells) else []
    return formulations[int(rng.integers(len(formulations)))]


def _made_directly(given: Sheet, folder: Path) -> Mesh:
    kind = MeshTri if len(given.t) == 3 else MeshQuad
    return kind(given.p, given.t)


def _file(given: Sheet, folder: Path) -> Mesh:
    kind = "triangle" if len(given.t) == 3 else "quad"
    points = np.pad(given.p, ((0, 1), (0, 0))).T
    meshio.Mesh(points, {kind: given.t.T}).write(folder / "mesh.vtu")
    return read_mesh(folder / "mesh.vtu")


def _file_split(given: Sheet, folder: Path) -> Mesh:
    mesh = _file(given, folder)
    return split(mesh) if isinstance(mesh, MeshTri) else mesh


def _split(given: Sheet, folder: Path) -> Mesh:
    return split(_made_directly(given, folder))


def _cut(given: Sheet, folder: Path) -> Mesh:
    mesh = _made_directly(given, folder)
    return cut(mesh) if isinstance(mesh, MeshQuad) else mesh


def _cells(given: Sheet, folder: Path) -> Mesh:
    return split_cells(given.p, [given.t])


_WAYS = (_made_directly, _made_directly, _file, _file_split, _split, _cut, _cells)

FAMILY = Family("mesh defects", attempt, len(DEFECTS) * _MESHES, short=len(DEFECTS))
