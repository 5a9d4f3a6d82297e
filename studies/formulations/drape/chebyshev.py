"""The Chebyshev net of a sphere, as a mapping and as a mechanical problem.

With two great circles through the pole as first threads, the angle ω between the
families depends only on z = uv/R²: z ω″ + ω′ + sin ω = 0, ω(0) = π/2.  The net is in
equilibrium under the edge tractions T e + M_s p, with e along the fibres that end there
and p = ∂Γ/∂a normal to them in the tangent plane.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.interpolate import CubicSpline, RegularGridInterpolator
from skfem import MeshQuad, MeshTri

from skfem_textile import Condition, Fabric, OnSurface, Ply, Traction, drape
from skfem_textile.ply.terms import Formulation
from skfem_textile.scenes import tools

#: Radius of the sphere and side of the quarter ply in mm.
RADIUS = SIDE = 100.0

#: The sphere with its pole at the origin.
SPHERE = drape.Sphere(RADIUS, (0.0, 0.0, -RADIUS))

# Cells of the net that defines the traction directions.  The directions have errors of
# 1e-6, which change the result by less than 1e-4 degrees.
_CELLS = 512


def shear_angle(X: ndarray) -> ndarray:
    """Shear angle in radians at points of the flat ply, shape (2, ...)."""
    return tools.shear_angle(X[0] * X[1] / RADIUS**2)


@cache
def _directions() -> tuple[Callable, Callable]:
    """Unit directions of warp and weft as functions of points, (n, 2) -> (n, 3)."""
    h = SIDE / _CELLS
    x = drape.net(SPHERE, h, (0, _CELLS), (0, _CELLS)).positions
    s = np.linspace(0, SIDE, _CELLS + 1)
    tangents = [CubicSpline(s, x, axis=axis)(s, 1) for axis in (1, 2)]
    warp, weft = (
        RegularGridInterpolator((s, s), np.moveaxis(t, 0, -1), "cubic")
        for t in tangents
    )
    return warp, weft


def traction(family: int, tension: float, shear: float) -> Callable:
    """T e + M_s p of a family at reference points, ``(2, ...) -> (3, ...)``.

    ``tension`` is T in N/mm, ``shear`` is the stiffness G in N/mm.
    """

    def at(X: ndarray) -> ndarray:
        points = np.clip(X.reshape(2, -1), 0, SIDE).T
        a, b = (f(points).T for f in np.roll(np.array(_directions()), -family))
        e, other = (t / np.linalg.norm(t, axis=0) for t in (a, b))
        c = (e * other).sum(axis=0)
        s = np.sqrt(1 - c * c)
        moment = shear * (np.pi / 2 - np.arctan2(s, c))
        force = tension * e + moment * (other - c * e) / s
        return force.reshape(3, *X.shape[1:])

    return at


def problem(
    formulation: Formulation,
    cells: int,
    stretch: float = 1e5,
    shear: float = 0.1,
    tension: float = 2.0,
    bending: float = 0.0,
    distortion: float = 0.0,
    halvings: int = 0,
    triangles: bool = False,
) -> tuple[Ply, dict[str, Condition | OnSurface], ndarray]:
    """The ply, its conditions and the exponential map as initial guess.

    Parameters
    ----------
    formulation
        The formulation.
    cells
        The user's elements per side, before refinement.
    stretch, shear
        Stiffnesses E and G in N/mm.
    tension
        Tension on the free edges in N/mm; 0 for traction-free edges.
    bending
        Stiffness D of both families in N·mm.
    distortion
        Largest displacement of inner nodes relative to the element size.
    halvings
        Number of uniform refinements after that.
    triangles
        Use triangles instead of quadrilaterals.
    """
    s = np.linspace(0, SIDE, cells + 1)
    of = MeshTri if triangles else MeshQuad
    mesh = of.init_tensor(s, s)
    inner = ((mesh.p > 0) & (mesh.p < SIDE)).all(axis=0)
    moves = np.random.default_rng(1).uniform(-1, 1, mesh.p.shape) * distortion
    mesh = of(mesh.p + moves * inner * SIDE / cells, mesh.t)
    mesh = (mesh.refined(halvings) if halvings else mesh).with_defaults()
    names = ("right", "top") if tension else ()
    loads = [
        Traction(name, traction(family, tension, shear))
        for family, name in enumerate(names)
    ]
    fabric = Fabric(stretch, shear, bending=(bending, bending))
    ends: Any = {"left": "mirror", "bottom": "mirror"} if bending else None
    ply = Ply(mesh, fabric, formulation, loads, dimension=3, fibre_ends=ends)
    conditions: dict[str, Condition | OnSurface] = {
        "sphere": OnSurface(SPHERE),
        "x": Condition("left", (0.0, None, None)),
        "y": Condition("bottom", (None, 0.0, None)),
    }
    start = drape.exponential_map(SPHERE, ply.nodes)
    return ply, conditions, drape.displacement(ply.nodes, start)


def errors(ply: Ply, u: ndarray) -> ndarray:
    """Error of Γ at the centres of elements in degrees, shape (n_elements,)."""
    centres = ply.mesh.p[:, ply.mesh.t].mean(axis=1)
    return np.degrees(ply.shear_angle(u, ply.centre)[:, 0] - shear_angle(centres))


def error(ply: Ply, u: ndarray) -> tuple[float, float]:
    """Largest and root-mean-square error of Γ at the centres of elements, degrees."""
    off = errors(ply, u)
    return float(np.abs(off).max()), float(np.sqrt(np.mean(off**2)))
