"""Energies of bilinear quadrilaterals in plain numpy, from their definitions.

Nodes ``X`` at rest and ``x`` displaced have the shape (2, n_nodes), ``quads`` the shape
(4, n).  This module does not use the library.
"""

import numpy as np
from numpy import ndarray

_CORNERS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])

#: The centre, and the 2x2 points.
CENTRE = np.zeros((1, 2))
GAUSS = _CORNERS / np.sqrt(3)


def gradients(X: ndarray, quads: ndarray, points: ndarray) -> tuple[ndarray, ndarray]:
    """∂N_a/∂X at points, shape (n, n_points, 4, 2), and Jacobians, (n, n_points)."""
    (a, b), (s, t) = _CORNERS.T, points.T[:, :, None]
    dN = np.stack([a * (1 + b * t) / 4, b * (1 + a * s) / 4], axis=-1)
    J = np.einsum("ian,paj->npij", X[:, quads], dN)
    return np.einsum("paj,npjk->npak", dN, np.linalg.inv(J)), np.linalg.det(J)


def areas(X: ndarray, cells: ndarray) -> ndarray:
    """Areas of polygons, shape (n,); ``cells`` has the shape (n_corners, n)."""
    x, y = X[:, cells] - X[:, cells[:1]]
    return (
        abs((x * np.roll(y, -1, axis=0) - y * np.roll(x, -1, axis=0)).sum(axis=0)) / 2
    )


def deformation(X: ndarray, x: ndarray, quads: ndarray, points: ndarray) -> ndarray:
    """F, shape (n, n_points, 2, 2)."""
    dN_dX, _ = gradients(X, quads, points)
    return np.einsum("ian,npaJ->npiJ", x[:, quads], dN_dX)


def strains(F: ndarray, fibres: ndarray) -> ndarray:
    """ln|F A| of both families, (2, n, n_points); ``fibres`` has their angles."""
    A = np.array([np.cos(fibres), np.sin(fibres)])
    return np.log(np.linalg.norm(np.einsum("npiJ,Jf->fnpi", F, A), axis=-1))


def shear_angles(F: ndarray, fibres: ndarray) -> ndarray:
    """Angle between the families at rest minus the present one, (n, n_points)."""
    A = np.array([np.cos(fibres), np.sin(fibres)])
    turned = np.einsum("npiJ,Jf->fnpi", F, A)
    warp, weft = turned[..., 0] + 1j * turned[..., 1]
    return np.angle(np.exp(1j * (fibres[1] - fibres[0])) * warp / weft)


def energies(
    X: ndarray,
    x: ndarray,
    quads: ndarray,
    fibres: ndarray,
    E: float,
    shear: tuple[float, bool] = (0.0, False),
    one_point: bool = True,
) -> tuple[float, float]:
    """Energy of tension and of shear.

    Parameters
    ----------
    X, x, quads
        As above.
    fibres
        Angles of warp and weft at rest.
    E
        Fibre stiffness.
    shear
        Shear stiffness G, and whether the energy is ½ G sin²Γ.
    one_point
        Whether there is one point in an element, or 2x2.
    """
    points = CENTRE if one_point else GAUSS
    weight = abs(gradients(X, quads, points)[1]) * (4 if one_point else 1)
    F = deformation(X, x, quads, points)
    G, sine = shear
    gamma = shear_angles(F, fibres)
    gamma = np.sin(gamma) if sine else gamma
    tension = E / 2 * (weight * strains(F, fibres) ** 2).sum()
    return float(tension), float(G / 2 * (weight * gamma**2).sum())


def hourglass(
    X: ndarray, x: ndarray, quads: ndarray, fibres: ndarray, C_s: float
) -> float:
    """½ C_s Σ_k A/4 (Γ(ξ_k) − Γ(0))²."""
    at_points, at_centre = (
        shear_angles(deformation(X, x, quads, points), fibres)
        for points in (GAUSS, CENTRE)
    )
    squares = ((at_points - at_centre) ** 2).sum(axis=1)
    return float(C_s / 8 * (areas(X, quads) * squares).sum())


def isotropic(X: ndarray, x: ndarray, quads: ndarray, C_s: float) -> float:
    """½ C_s Σ_k A/4 ‖F(ξ_k) − F(0)‖²."""
    off = deformation(X, x, quads, GAUSS) - deformation(X, x, quads, CENTRE)
    return float(C_s / 8 * (areas(X, quads) * (off**2).sum(axis=(1, 2, 3))).sum())
