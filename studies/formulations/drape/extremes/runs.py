"""Runs of a case, and of the same case on a mesh of half the element size."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy import ndarray
from skfem import Mesh, MeshQuad, MeshTri

from skfem_textile import (
    Condition,
    Fabric,
    LoadStepper,
    OnSurface,
    Ply,
    Surface,
    Traction,
    drape,
    equilibrium_near,
)
from skfem_textile.ply.own_terms import FibreEnd
from skfem_textile.solve.conditions import Conditions
from skfem_textile.solve.states import State
from skfem_textile.solve.stepper import DEFAULT_WARN_ONLY

from .cases import FORMULATIONS, Extreme
from .surfaces import SIDE, SURFACES, Mirrored

SHEAR = 0.1

# Largest move of inner nodes as a share of the element size.
_DISTORTION = 0.25

# Step in mm of a difference of positions.
_STEP = 1e-3

# Equal steps in which a surface grows.
_STEPS = 4


class Drape(NamedTuple):
    """A ply on its surface, and the state that was found."""

    ply: Ply
    conditions: Conditions
    surface: Surface
    state: State

    @property
    def positions(self) -> ndarray:
        """Positions of the nodes in mm, shape (3, n_nodes)."""
        return np.pad(self.ply.nodes, ((0, 1), (0, 0))) + self.ply.nodal(self.state.u)

    @property
    def angle(self) -> ndarray:
        """Shear angle in degrees, the mean over each of the user's elements."""
        of_parts = self.ply.shear_angle(self.state.u).mean(axis=1)
        return np.degrees(self.ply.on_users_elements(of_parts))


def draped(case: Extreme, halvings: int = 0) -> Drape:
    """Drape a ply, its elements halved a number of times.

    Raises
    ------
    NoEquilibriumError, StepError
        If no state is found.
    """
    surface = SURFACES[case.surface]
    surface = Mirrored(surface) if case.mirrored else surface
    mesh = mesh_of(case)
    mesh = mesh.refined(halvings).with_defaults() if halvings else mesh
    names = ("right", "top") if case.tension else ()
    loads = [
        Traction(name, _outwards(surface, i, case.tension), factor=lambda t: t)
        for i, name in enumerate(names)
    ]
    c, s = (np.sqrt(0.5), np.sqrt(0.5)) if case.bias else (1.0, 0.0)
    fabric = Fabric(
        *(case.stiffness * SHEAR, SHEAR),
        warp=(c, s),
        weft=(-s, c),
        bending=(case.bending, case.bending),
    )
    formulation = FORMULATIONS[case.formulation]
    ends: dict[str, FibreEnd] = {}
    if case.bending:
        ends = {"left": "mirror", "bottom": "mirror"}
    ply = Ply(mesh, fabric, formulation, loads, dimension=3, fibre_ends=ends)
    conditions: Conditions = {
        "on": OnSurface(surface),
        "x": Condition("left", (0.0, None, None)),
        "y": Condition("bottom", (None, 0.0, None)),
    }
    if case.growing:
        run = LoadStepper(ply, conditions, _STEPS).run()
        return Drape(ply, conditions, surface, run.states[-1])
    start = drape.displacement(ply.nodes, drape.exponential_map(surface, ply.nodes))
    state = equilibrium_near(ply, conditions, start, warn_only=DEFAULT_WARN_ONLY)
    return Drape(ply, conditions, surface, state)


def mesh_of(case: Extreme) -> Mesh:
    """The user's mesh."""
    s = np.linspace(0, SIDE, case.cells + 1)
    of = MeshTri if "triangles" in case.mesh else MeshQuad
    mesh = of.init_tensor(s, s)
    if "distorted" in case.mesh:
        inner = ((mesh.p > 0) & (mesh.p < SIDE)).all(axis=0)
        moves = np.random.default_rng(1).uniform(-1, 1, mesh.p.shape)
        moves *= _DISTORTION * SIDE / case.cells
        mesh = replace(mesh, doflocs=mesh.p + inner * moves)
    if case.mesh == "hole":
        centres = mesh.p[:, mesh.t].mean(axis=1)
        hole = (np.abs(centres / SIDE - 0.625) < 0.13).all(axis=0)
        mesh = mesh.remove_elements(np.flatnonzero(hole))
    return mesh.with_defaults()


def _outwards(surface: Surface, side: int, tension: float) -> Callable:
    """Dead traction along the geodesics that leave the ply across a side."""

    def at(X: ndarray) -> ndarray:
        points = X.reshape(2, -1)
        step = np.zeros((2, 1))
        step[side] = _STEP
        there, back = (
            drape.exponential_map(surface, points + sign * step) for sign in (1, -1)
        )
        along = (there - back) / np.linalg.norm(there - back, axis=0)
        return tension * along.reshape(3, *X.shape[1:])

    return at
