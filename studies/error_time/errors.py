"""Errors of a displacement for results of any code."""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import CellBasis, ElementTriP1

from skfem_textile.fabric import kinematics as kin
from skfem_textile.mesh.bases import GAUSS, SIX
from skfem_textile.scenes import Scene


def shape_errors(scene: Scene, basis: CellBasis, u: ndarray) -> dict[str, float]:
    """Distance of a displacement at the end of the load from the exact motion.

    Parameters
    ----------
    scene
        The scene, with load factor 1 at the end.
    basis
        Basis of the displacement.
    u
        Displacement.

    Returns
    -------
    dict
        ``position``, rms over the nodes in mm; ``angle``, rms of the shear angle over
        the centres of the elements in degrees.
    """
    warp, weft = (np.reshape(A, (2, 1, 1)) for A in (scene.warp, scene.weft))
    centre = _at_points(basis, basis.mesh.elem.refdom.p.mean(axis=1, keepdims=True))
    angle = kin.shear_angle(_F(centre, u), warp, weft)[:, 0]
    nodes, displacement = basis.doflocs[:, ::2], u.reshape(-1, 2).T
    centres = basis.mesh.p[:, basis.mesh.t].mean(axis=1)
    off = scene.distance(nodes, displacement, centres, angle, centre.dx[:, 0], 1.0)
    return {
        "position": off["displacement_error_rms"],
        "angle": off["shear_angle_error_rms_deg"],
    }


def unfolded(basis: CellBasis, u: ndarray) -> bool:
    """Whether det F is positive at the 2×2 points, or the six of triangles."""
    points, _ = SIX if basis.mesh.elem is ElementTriP1 else GAUSS
    return bool((kin.area_ratio(_F(_at_points(basis, points), u)) > 0).all())


def _F(basis: CellBasis, u: ndarray) -> ndarray:
    field: Any = basis.interpolate(u)
    return kin.deformation_gradient(field.grad)


def _at_points(basis: CellBasis, points: ndarray) -> CellBasis:
    rule = (points, np.ones(points.shape[1]))
    return CellBasis(basis.mesh, basis.elem, quadrature=rule)
