"""How far a displacement is from the exact one, whatever code it is from."""

from typing import Any

import numpy as np
from numpy import ndarray
from skfem import CellBasis, ElementTriP1

from .. import kinematics as kin
from ..mesh.bases import GAUSS, SIX
from ..scenes import Scene


def errors(scene: Scene, basis: CellBasis, u: ndarray, load: float) -> dict[str, float]:
    """Distance of the end of a load from the exact answer.

    Parameters
    ----------
    scene
        The scene, with load factor 1 at the end.
    basis
        Basis of the displacement at the points of the fibre strains.
    u
        Displacement.
    load
        Load in N, or as a share of the exact one where the scene knows it.

    Returns
    -------
    dict
        ``position``, rms over the nodes in mm; ``angle``, rms over the elements'
        centres in degrees; ``strain``, largest fibre strain at the points; ``load``
        and its distance ``load_error`` from what it should be.
    """
    X = basis.doflocs[:, ::2]
    off = np.linalg.norm(u.reshape(-1, 2).T - scene.displacement(X, 1.0), axis=0)
    strains = [
        kin.fibre_strain(_F(basis, u), _constant(a)) for a in (scene.warp, scene.weft)
    ]
    centre = _at(basis, basis.mesh.elem.refdom.p.mean(axis=1, keepdims=True))
    vertices = scene.mesh.p[:, scene.mesh.t]
    angle = kin.shear_angle(
        _F(centre, u), _constant(scene.warp), _constant(scene.weft)
    )[:, 0] - scene.shear_angle(vertices.mean(axis=1), 1.0)
    return {
        "position": float(np.sqrt(np.mean(off**2))),
        "angle": float(
            np.degrees(np.sqrt(np.average(angle**2, weights=centre.dx[:, 0])))
        ),
        "strain": float(np.abs(strains).max()),
        "load": load,
        "load_error": abs(load - (0.0 if scene.load is None else 1.0)),
    }


def unfolded(basis: CellBasis, u: ndarray) -> bool:
    """Whether det F is positive at the 2×2 points, or at six of triangles."""
    points, _ = SIX if basis.mesh.elem is ElementTriP1 else GAUSS
    return bool((kin.area_ratio(_F(_at(basis, points), u)) > 0).all())


def _F(basis: CellBasis, u: ndarray) -> ndarray:
    field: Any = basis.interpolate(u)
    return kin.deformation_gradient(field.grad)


def _at(basis: CellBasis, points: ndarray) -> CellBasis:
    rule = (points, np.ones(points.shape[1]))
    return CellBasis(basis.mesh, basis.elem, quadrature=rule)


def _constant(direction: tuple[float, float]) -> ndarray:
    return np.reshape(direction, (2, 1, 1))
