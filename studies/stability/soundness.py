"""Verification of final states, independent of the load stepper."""

import numpy as np
from numpy import ndarray

from skfem_textile.ply import Ply
from skfem_textile.ply.parameters import PlyParameters
from skfem_textile.scenes import Scene
from skfem_textile.solve.conditions import Constraints

# A corner is flat if its parallelogram is smaller than this fraction of the largest.
_FLAT = 1e-9

# Relative tolerances of prescribed values, and of the distance to equilibrium.
_OFF, _LEFT = 1e-9, 1e-6


def is_sound(
    ply: Ply, scene: Scene, u: ndarray, parameters: PlyParameters | None = None
) -> bool:
    """True if a state is a stable equilibrium at full load without inverted elements.

    The checks are the area ratio at the corners and the fine points of the elements,
    a Cholesky factorisation of the dense tangent, scaled to a unit diagonal, and one
    more Newton step.

    Parameters
    ----------
    ply
        The ply.
    scene
        The scene with the conditions.
    u
        Displacement, DOF vector of the ply's basis.
    parameters
        Parameters of the state; by default the initial ones.

    Raises
    ------
    ValueError
        If the direction of a condition is not along an axis.
    """
    constraints = Constraints(ply.basis, scene.conditions)
    if constraints.turn is not None:
        raise ValueError("the dense check supports only conditions along the axes")
    off = np.abs(u[constraints.fixed] - constraints.fixed_values(1.0)).max()
    if not is_unfolded(ply, u) or off > _OFF * np.abs(u).max():
        return False
    free = constraints.free
    K = ply.tangent(u, 1.0, parameters).toarray()[np.ix_(free, free)]
    if not np.all(K.diagonal() > 0):
        return False
    D = 1 / np.sqrt(K.diagonal())
    try:
        L = np.linalg.cholesky(D[:, None] * K * D)
    except np.linalg.LinAlgError:
        return False
    f = ply.residual(u, 1.0, parameters)[free]
    left = D * np.linalg.solve(L.T, np.linalg.solve(L, D * f))
    return bool(np.abs(left).max(initial=0.0) <= _LEFT * np.ptp(ply.mesh.p))


def is_unfolded(ply: Ply, u: ndarray) -> bool:
    """True if det F > 0 at the corners and the fine points of all elements.

    Corners that are flat or reflex in the reference configuration are ignored.
    """
    inside = ply.area_ratio(u, ply.fine_points)
    reference = _at_corners(ply, ply.nodes)
    current = _at_corners(ply, ply.nodes + ply.nodal(u))
    largest = reference[np.abs(reference).argmax(axis=0), np.arange(len(inside))]
    counts = reference / largest > _FLAT
    return bool((inside > 0).all() and (current / reference)[counts].min() > 0)


def _at_corners(ply: Ply, x: ndarray) -> ndarray:
    """Jacobian determinant of each element at its nodes, shape (n, n_elements).

    Parameters
    ----------
    ply
        The ply.
    x
        Positions of its nodes, shape (2, n_nodes).
    """
    if ply.nodes.shape[1] == ply.mesh.p.shape[1]:
        corner = x[:, ply.mesh.t]
        ahead = np.roll(corner, -1, axis=1) - corner
        behind = np.roll(corner, 1, axis=1) - corner
        return _cross(ahead, behind)
    return _of_quadratic_triangles(ply, x)


def _of_quadratic_triangles(ply: Ply, x: ndarray) -> ndarray:
    """Jacobian determinants for triangles with midside nodes.

    In area coordinates L the map is Σ L_a (2 L_a − 1) x_a + 4 Σ L_a L_b x_ab.
    """
    vertex = x[:, ply.mesh.t]
    middle = dict(
        zip(
            [(0, 1), (1, 2), (0, 2)],
            x[:, ply.mesh.p.shape[1] + ply.mesh.t2f].transpose(1, 0, 2),
            strict=True,
        )
    )
    determinants = []
    for L in (
        (1, 0, 0),
        (0, 1, 0),
        (0, 0, 1),
        (0.5, 0.5, 0),
        (0, 0.5, 0.5),
        (0.5, 0, 0.5),
    ):
        slope = [(4 * L[a] - 1) * vertex[:, a] for a in range(3)]
        for (a, b), x_ab in middle.items():
            slope[a] = slope[a] + 4 * L[b] * x_ab
            slope[b] = slope[b] + 4 * L[a] * x_ab
        determinants.append(_cross(slope[1] - slope[0], slope[2] - slope[0]))
    return np.array(determinants)


def _cross(a: ndarray, b: ndarray) -> ndarray:
    return a[0] * b[1] - a[1] * b[0]
