"""Fibre strain and shear angle of a deformation gradient, with their derivatives.

Pointwise formulas, without meshes.  Every tensor has its components first and the
points last, as in scikit-fem: a deformation gradient
``F`` has shape ``(d, 2, ...)``, a reference fibre direction ``A`` shape
``(2, ...)``; first derivatives with respect to ``F`` have shape ``(d, 2, ...)``
and second derivatives ``(d, 2, d, 2, ...)``.  The points may broadcast.

A ply in its plane has d = 2, a ply in space d = 3.  The functions determine d from the
shape of ``F``.
"""

from typing import NamedTuple

import numpy as np
from numpy import ndarray
from skfem.helpers import cross, ddot, det, dot, mul


def deformation_gradient(grad_u: ndarray) -> ndarray:
    """Deformation gradient F = I + ∇u.

    Parameters
    ----------
    grad_u
        Displacement gradient, shape (d, 2, ...).
    """
    identity = np.eye(*grad_u.shape[:2])
    return identity.reshape(identity.shape + (1,) * (grad_u.ndim - 2)) + grad_u


def area_ratio(F: ndarray) -> ndarray:
    """Current area per reference area.

    In the plane it is det F, zero or negative where the ply folds.  In space it is the
    length of `area_vector` and has no sign.
    """
    if len(F) == 2:
        return det(F)
    c = area_vector(F)
    return np.sqrt(dot(c, c))


def area_ratio_d(F: ndarray, H: ndarray) -> ndarray:
    """Derivative of the area ratio along H, a change of F."""
    if len(F) == 2:
        cofactors = np.array([[F[1, 1], -F[1, 0]], [-F[0, 1], F[0, 0]]])
        return ddot(cofactors, H)
    return dot(_unit(area_vector(F)), area_vector_d(F, H))


def area_ratio_dd(F: ndarray, H: ndarray, K: ndarray) -> ndarray:
    """Second derivative of the area ratio along H and K; independent of F in 2D.

    In space, with n = c/J and J = ``|c|`` of `area_vector`:
    n·d²c + (dc·d′c − (n·dc)(n·d′c))/J.
    """
    if len(F) == 2:
        return area_ratio_d(H, K)
    c, dc, other = area_vector(F), area_vector_d(F, H), area_vector_d(F, K)
    n, J = _unit(c), np.sqrt(dot(c, c))
    across = dot(dc, other) - dot(n, dc) * dot(n, other)
    return dot(n, area_vector_d(H, K)) + across / J


def area_vector(F: ndarray) -> ndarray:
    """Cross product of the columns of F, shape (3, ...): normal to a ply in space."""
    return cross(F[:, 0], F[:, 1])


def area_vector_d(F: ndarray, H: ndarray) -> ndarray:
    """Derivative of the area vector along H, linear in F and H and symmetric."""
    return cross(F[:, 0], H[:, 1]) + cross(H[:, 0], F[:, 1])


def fibre(F: ndarray, A: ndarray) -> ndarray:
    """Current fibre vector a = F·A, shape (d, ...); its length is the stretch λ."""
    return mul(F, A)


def fibre_strain(F: ndarray, A: ndarray) -> ndarray:
    """Logarithmic fibre strain ε = ln λ, with λ = ‖a‖ and a = F·A.

    Parameters
    ----------
    F
        Deformation gradient, shape (d, 2, ...).
    A
        Unit reference direction of the fibre, shape (2, ...).
    """
    a = mul(F, A)
    return 0.5 * np.log(dot(a, a))


def fibre_strain_d(F: ndarray, A: ndarray) -> ndarray:
    """First derivative ∂ε/∂F = a ⊗ A / λ², shape (d, 2, ...)."""
    a = fibre(F, A)
    return np.einsum("i...,J...->iJ...", a / dot(a, a), A)


def fibre_strain_dd(F: ndarray, A: ndarray) -> ndarray:
    """Second derivative ∂²ε/∂F² = (δ_ik/λ² − 2 a_i a_k/λ⁴) A_J A_L."""
    a = fibre(F, A)
    e = a / dot(a, a)
    second = _delta(a) / dot(a, a) - 2 * np.einsum("i...,k...->ik...", e, e)
    return np.einsum("ik...,J...,L...->iJkL...", second, A, A)


def stretch(F: ndarray, A: ndarray) -> ndarray:
    """Stretch λ = ‖a‖ of a fibre, a = F·A."""
    a = fibre(F, A)
    return np.sqrt(dot(a, a))


def stretch_d(F: ndarray, A: ndarray) -> ndarray:
    """First derivative ∂λ/∂F = e ⊗ A with e = a/λ, shape (d, 2, ...)."""
    return np.einsum("i...,J...->iJ...", fibre(F, A) / stretch(F, A), A)


def stretch_dd(F: ndarray, A: ndarray) -> ndarray:
    """Second derivative ∂²λ/∂F² = (δ_ik − e_i e_k)/λ A_J A_L; 0 along the fibre."""
    a, length = fibre(F, A), stretch(F, A)
    e = a / length
    m = (_delta(a) - np.einsum("i...,k...->ik...", e, e)) / length
    return np.einsum("ik...,J...,L...->iJkL...", m, A, A)


def shear_angle(F: ndarray, A1: ndarray, A2: ndarray) -> ndarray:
    """Shear angle Γ = ∠(A₁, A₂) − ∠(a₁, a₂) in radians.

    It is positive when the families approach each other and negative when they open,
    if the weft lies anticlockwise of the warp.  It is smooth until they coincide.  Its
    rate is Γ̇ = f²·L·f₁ + f¹·L·f₂ (Hamila & Boisse 2013, §3.2).

    An angle in space has no sign; it gets the sign of ∠(A₁, A₂), so that a flat ply has
    the same shear angle in space as in its plane.

    Parameters
    ----------
    F
        Deformation gradient, shape (d, 2, ...).
    A1, A2
        Unit reference directions of warp and weft, shape (2, ...).
    """
    return _closing(fibre(F, A1), fibre(F, A2), A1, A2)


def _closing(a1: ndarray, a2: ndarray, A1: ndarray, A2: ndarray) -> ndarray:
    """Shear angle of the fibre vectors a₁ and a₂, see `shear_angle`."""
    at_rest = np.arctan2(side := cross(A1, A2), dot(A1, A2))
    n = cross(a1, a2)
    if len(a1) == 2:
        return at_rest - np.arctan2(n, dot(a1, a2))
    return at_rest - np.sign(side) * np.arctan2(np.sqrt(dot(n, n)), dot(a1, a2))


def cos_angle(F: ndarray, A1: ndarray, A2: ndarray) -> ndarray:
    """Cosine of the angle ∠(a₁, a₂) at which the families cross."""
    return both_fibres(F, A1, A2).cos_angle


class BothFibres(NamedTuple):
    """Deformation of warp and weft, from one computation of their vectors.

    ``strain`` and ``stretch`` have the shape (2, ...), the shear angle and the cosine
    of the angle ∠(a₁, a₂), at which the families cross, the shape (...).
    """

    strain: ndarray
    stretch: ndarray
    shear_angle: ndarray
    cos_angle: ndarray


def both_fibres(F: ndarray, A1: ndarray, A2: ndarray) -> BothFibres:
    """Strains, stretches and angles of both families; arguments of `shear_angle`."""
    a1, a2 = mul(F, A1), mul(F, A2)
    squared = np.array([dot(a1, a1), dot(a2, a2)])
    return BothFibres(
        0.5 * np.log(squared),
        np.sqrt(squared),
        _closing(a1, a2, A1, A2),
        dot(a1, a2) / np.sqrt(squared[0] * squared[1]),
    )


def shear_angle_d(F: ndarray, A1: ndarray, A2: ndarray) -> ndarray:
    """First derivative ∂Γ/∂F, shape (d, 2, ...).

    In the plane ∂θ₁/∂F − ∂θ₂/∂F, where θ_α is the inclination of a_α: ∂θ/∂F = p ⊗ A /
    λ² with p = a rotated by 90°.  In space Σ g_α ⊗ A_α with the g_α of `crossing`.
    """
    if len(F) == 2:
        return _inclination_d(F, A1) - _inclination_d(F, A2)
    g1, g2, _, _ = crossing(fibre(F, A1), fibre(F, A2))
    d = [np.einsum("i...,J...->iJ...", g, A) for g, A in ((g1, A1), (g2, A2))]
    return _side(A1, A2) * (d[0] + d[1])


def shear_angle_dd(F: ndarray, A1: ndarray, A2: ndarray) -> ndarray:
    """Second derivative ∂²Γ/∂F², shape (d, 2, d, 2, ...).

    In the plane ∂²θ₁/∂F² − ∂²θ₂/∂F².  In space, with v = a/λ² and `crossing`,
    ∂²Γ/∂a_α² = −(g ⊗ v + v ⊗ g + (c/s) n ⊗ n/λ²) and ∂²Γ/∂a₁∂a₂ = n ⊗ n/(s λ₁λ₂).
    """
    if len(F) == 2:
        return _inclination_dd(F, A1) - _inclination_dd(F, A2)
    a, A = (fibre(F, A1), fibre(F, A2)), (A1, A2)
    *g, n, (c, s) = crossing(*a)
    squared = [dot(x, x) for x in a]
    second = np.zeros(1)
    for i in range(2):
        half = np.einsum("i...,k...->ik...", g[i], a[i] / squared[i])
        normal = c / s / squared[i] * np.einsum("i...,k...->ik...", n, n)
        diagonal = half + half.swapaxes(0, 1) + normal
        second = second - np.einsum("ik...,J...,L...->iJkL...", diagonal, A[i], A[i])
    root = s * np.sqrt(squared[0] * squared[1])
    across = np.einsum("i...,k...->ik...", n, n) / root
    mixed = np.einsum("ik...,J...,L...->iJkL...", across, A1, A2)
    mixed = mixed + np.einsum("ik...,J...,L...->iJkL...", across, A2, A1)
    return _side(A1, A2) * (second + mixed)


def crossing(
    a1: ndarray, a2: ndarray
) -> tuple[ndarray, ndarray, ndarray, tuple[ndarray, ndarray]]:
    """Crossing of fibres in space: derivatives of the angle between them, and normal.

    With e_α = a_α/λ_α: c = e₁·e₂, s = ``|e₁×e₂|``, n = e₁×e₂/s, and
    g₁ = (e₂ − c e₁)/(s λ₁), g₂ = (e₁ − c e₂)/(s λ₂), which are −∂∠(a₁, a₂)/∂a_α.

    Parameters
    ----------
    a1, a2
        Fibre vectors, shape (3, ...).

    Returns
    -------
    tuple
        g₁, g₂ and n, shape (3, ...); the pair (c, s), shape (...).
    """
    length1, length2 = np.sqrt(dot(a1, a1)), np.sqrt(dot(a2, a2))
    e1, e2 = a1 / length1, a2 / length2
    normal, c = cross(e1, e2), dot(e1, e2)
    s = np.sqrt(dot(normal, normal))
    g1, g2 = (e2 - c * e1) / (s * length1), (e1 - c * e2) / (s * length2)
    return g1, g2, normal / s, (c, s)


def _side(A1: ndarray, A2: ndarray) -> ndarray:
    """1 where the weft lies anticlockwise of the warp at rest, −1 where clockwise."""
    return np.sign(cross(A1, A2))


def _delta(a: ndarray) -> ndarray:
    """δ_ik of vector components, with axes of length 1 for the points."""
    return np.eye(len(a)).reshape(len(a), len(a), *(1,) * (a.ndim - 1))


def _unit(c: ndarray) -> ndarray:
    return c / np.sqrt(dot(c, c))


def rotated(a: ndarray) -> ndarray:
    """The vector a rotated by +90°."""
    return np.stack([-a[1], a[0]])


def _inclination_d(F: ndarray, A: ndarray) -> ndarray:
    a = fibre(F, A)
    return np.einsum("i...,J...->iJ...", rotated(a) / dot(a, a), A)


def _inclination_dd(F: ndarray, A: ndarray) -> ndarray:
    """∂²θ/∂F² = −(p_i a_k + a_i p_k) A_J A_L / λ⁴."""
    a = fibre(F, A)
    e = a / dot(a, a)
    half = np.einsum("i...,k...->ik...", rotated(e), e)
    second = half + half.swapaxes(0, 1)
    return -np.einsum("ik...,J...,L...->iJkL...", second, A, A)
