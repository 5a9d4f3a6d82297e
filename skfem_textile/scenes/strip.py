"""Scene `strip`: a ply deformed to a circle (Hamila & Boisse 2013, §2.2).

A strip of 40 mm × 60 mm, with the warp along x and the weft along y, is clamped at its
bottom.  Its right edge moves along x onto a circle of radius R, so that the weft bends
to circles and the warp stays straight: x = X e₁ + (R(1 − cos(Y/R)), R sin(Y/R)).  No
fibre is stretched, and the shear angle is Γ = Y/R.
"""

import numpy as np
from numpy import ndarray
from skfem import Mesh

from ..declarations import scenes as declared
from ..mesh.checks import MeshError
from ..solve.conditions import Condition
from .rectangle import given_or_rectangle, misfit, require_edges
from .scene import Scene, with_parameters

WIDTH, HEIGHT, RADIUS = 40.0, 60.0, 55.0


@with_parameters(declared.Strip)
def strip(given: declared.Strip) -> Scene:
    """Strip deformed to a circle, with fibres along its sides, clamped at the bottom.

    Parameters
    ----------
    mesh
        A mesh with its bottom on y = 0 and less than 86 mm high, or the kind of
        `rectangle` to generate.  The boundaries ``bottom`` and ``right`` are used if
        they exist, otherwise the lowest and the rightmost edges.  The exact solution is
        valid if the mesh fills a rectangle of which these are whole sides.
    size, jitter, seed
        As for `rectangle`.

    Raises
    ------
    ValueError
        If the mesh is not valid or does not fit.
    """
    mesh = given_or_rectangle(given, WIDTH, HEIGHT)
    _refuse_misfit(mesh)
    return Scene(
        name="strip",
        mesh=mesh,
        warp=(1.0, 0.0),
        weft=(0.0, 1.0),
        conditions={
            "bottom": Condition("bottom"),
            "right": Condition("right", _displacement_x, direction=(1.0, 0.0)),
        },
        driven="right",
        displacement=displacement,
        shear_angle=shear_angle,
        misfit=misfit(mesh, ("bottom", "right")),
    )


def displacement(X: ndarray, t: float) -> ndarray:
    """Exact displacement at the load factor t: the weft on a circle of radius R/t."""
    if t == 0:
        return np.zeros_like(X)
    R = RADIUS / t
    return np.stack([R * (1 - np.cos(X[1] / R)), R * np.sin(X[1] / R) - X[1]])


def _displacement_x(X: ndarray, t: float) -> ndarray:
    return displacement(X, t)[0]


def shear_angle(X: ndarray, t: float) -> ndarray:
    """Exact shear angle in radians at the load factor t."""
    return t * X[1] / RADIUS


def _refuse_misfit(mesh: Mesh) -> None:
    """Refuse a mesh that does not fit the scene."""
    require_edges("strip", mesh, ("bottom", "right"))
    bottom = mesh.p[1, mesh.facets[:, mesh.boundaries["bottom"]]]
    if np.abs(bottom).max() > 1e-6 * np.ptp(mesh.p[1]):
        raise MeshError("strip: the bottom edge of the mesh must lie on y = 0")
    if mesh.p[1].max() >= RADIUS * np.pi / 2:
        raise MeshError(
            f"strip: the mesh must be less than {RADIUS * np.pi / 2:.1f} mm high, not "
            f"{mesh.p[1].max():g} mm, because the shear angle would exceed 90 degrees"
        )
